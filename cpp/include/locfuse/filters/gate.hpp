// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <limits>

#include "locfuse/math/chi_squared.hpp"

namespace locfuse {

/// Chi-square gate given as the probability that a good measurement passes. The limit on the NIS
/// follows from the measurement's degrees of freedom.
class Gate {
 public:
  /// Lets everything through.
  Gate() { limits_.fill(std::numeric_limits<double>::infinity()); }

  /// Lets nothing through.
  [[nodiscard]] static Gate closed() {
    Gate gate;
    gate.limits_.fill(-1.0);
    gate.probability_ = 0.0;
    return gate;
  }

  /// Throws std::invalid_argument unless 0 < probability <= 1; 1 lets everything through.
  explicit Gate(double probability);

  /// Largest NIS that passes. Throws std::invalid_argument if `dof` is below 1.
  [[nodiscard]] double limit(int dof) const {
    if (dof >= 1 && (dof <= kMaxTabledDof || probability_ == 0.0)) {
      return limits_[static_cast<std::size_t>(std::min(dof, kMaxTabledDof))];
    }
    return chi_squared_quantile(dof, probability_);
  }

  [[nodiscard]] double probability() const { return probability_; }

 private:
  static constexpr int kMaxTabledDof = 32;

  double probability_ = 1.0;
  std::array<double, kMaxTabledDof + 1> limits_{};
};

}  // namespace locfuse
