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

/// Why a message was not fused.
enum class Reason : std::uint8_t {
  kNone,            ///< it was fused, or used for the start
  kUnlikely,        ///< its nis is beyond the limit of its gate
  kSourceExcluded,  ///< it fits, but its source is likely wrong as a whole
  kAmbiguous,       ///< it fits several landmarks, or is too near one to be of a new one
  kBeyondLimits,    ///< Limits
  kFrozen,          ///< its source repeats itself while the robot moves
  kJumped,          ///< of a tag: too far from the fix before
  kBeforeEstimate,  ///< older than the estimate, as all is from before the start
  kTooLate,         ///< older than the history
  kTooFarAhead,     ///< stamped long after all before it; held until another agrees
  kSwitchedOff,     ///< its source is
  kNotStarted,      ///< the start is still searched for
  kWaits,           ///< for more ranges, which tell several places in space apart
  kNotUsed,         ///< the estimator has no use for its kind
  kUnknownAnchor,
  kUnknownTag,
  kUnknownLandmark,
  kUnnamed,      ///< it names no tag or landmark, which this estimator needs
  kNoDirection,  ///< at the anchor or landmark itself; a course at rest or without odometry
  kNoSigma,      ///< neither it nor the config says how good it is
  kNoDuration,   ///< a motion without duration has no velocity
  kIncomplete,   ///< without range or bearing it cannot place a new landmark
  kMapFull,      ///< there are as many landmarks as may be
  kNoNews,       ///< a scan from where the last one was taken
  kNoReturns,    ///< a scan that sees nothing
  kCovered,      ///< a scan of a laser that something covers
  kNumerical,    ///< it leaves no finite result
  kReplaced,     ///< a motion that was made again after a late message
  kWatched,      ///< a pose that is judged, not fused: PoseWatch
};

/// Verdict on one message, with the numbers behind it. NaN and 0 dof where nothing was compared; of
/// a fix that a TagConditioner rejects `residual` and `limit` are its distance and limit [m].
struct Outcome {
  Verdict verdict = Verdict::kIgnored;
  Reason reason = Reason::kNone;
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
