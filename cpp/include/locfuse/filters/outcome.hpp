// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace locfuse {

/// What became of a message.
enum class Verdict : std::uint8_t {
  kFused,        ///< it changed the belief
  kGated,        ///< too unlikely under the belief; the belief is bit for bit what it was
  kNotModelled,  ///< the model has nothing to say: unknown anchor or tag, no direction, no sigma
  kIgnored,      ///< the estimator does not use this kind of message
  kStale,        ///< older than what can still be changed
  kImplausible,  ///< beyond what a robot and its sensors can do (Limits)
};

/// Verdict on one message, with the numbers behind it. NaN and 0 dof where nothing was compared; of
/// a fix that a TagConditioner rejects `residual` and `limit` are its distance and limit [m].
struct Outcome {
  Verdict verdict = Verdict::kIgnored;
  int dof = 0;                                                 ///< rows of the innovation
  double nis = std::numeric_limits<double>::quiet_NaN();       ///< r' S^-1 r
  double residual = std::numeric_limits<double>::quiet_NaN();  ///< first row of r
  double scale = std::numeric_limits<double>::quiet_NaN();     ///< det(S)^(1/dof)
  double limit = std::numeric_limits<double>::quiet_NaN();     ///< largest nis that its gate passes
  int interventions = 0;  ///< variances that were put back into their bounds on the way

  /// log N(r; 0, S).
  [[nodiscard]] double log_likelihood() const {
    return -0.5 * (nis + dof * (std::log(scale) + kLogTwoPi));
  }

 private:
  static constexpr double kLogTwoPi = 1.8378770664093453;
};

}  // namespace locfuse
