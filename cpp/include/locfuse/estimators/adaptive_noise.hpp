// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/message.hpp"

namespace locfuse {

/// Factors of the variances that measurements are reported with, one for each kind, as their
/// innovations say; docs/models/updates.md eq. (2.7).
class AdaptiveNoise {
 public:
  struct Config {
    double messages = 0.0;  ///< memory, in messages of each kind; 0: variances stay as reported
    double least = 0.1;     ///< factor of a variance
    double most = 100.0;    ///< largest factor
  };

  /// Throws std::invalid_argument on a config out of range.
  explicit AdaptiveNoise(const Config& config);

  [[nodiscard]] bool is_on() const { return config_.messages > 0.0; }
  /// Factor of the reported variance.
  [[nodiscard]] double factor(Source source) const { return factors_[index(source)]; }
  /// A measurement was compared; `variance` is det(R)^(1 / dof), with the factor. One that was not
  /// fused says nothing.
  void record(Source source, const Outcome& outcome, double variance);

 private:
  static std::size_t index(Source source) { return static_cast<std::size_t>(source); }

  Config config_;
  std::array<double, kSources> factors_;
};

}  // namespace locfuse
