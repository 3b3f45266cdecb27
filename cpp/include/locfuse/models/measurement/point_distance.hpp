// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/math/linearization.hpp"

namespace locfuse {

/// A known distance between two points: h(a, b) = |b - a|; docs/models/poses.md.
class PointDistanceModel {
 public:
  struct Config {
    double sigma_m = 0.005;  ///< of the known distance [m]
    double gate = 1.0;       ///< probability that a good one passes; 1: no gate
  };

  PointDistanceModel() : PointDistanceModel(Config{}) {}

  /// Throws std::invalid_argument unless the sigma is finite and positive.
  explicit PointDistanceModel(const Config& config);

  /// Expected distance [m].
  [[nodiscard]] static double predict(const Vector<2>& a, const Vector<2>& b) {
    return (b - a).norm();
  }

  /// Jacobian with respect to (a, b), 1x4: eq. (6.2). Empty if the points coincide (no
  /// direction).
  [[nodiscard]] std::optional<Linearization<1, 4>> linearize(const Vector<2>& a, const Vector<2>& b,
                                                             double distance) const {
    const double expected = predict(a, b);
    if (!(expected > kMinDistance)) {
      return std::nullopt;
    }
    const Vector<2> u = (b - a) / expected;
    Linearization<1, 4> lin;
    lin.residual(0) = distance - expected;
    lin.jacobian << -u.x(), -u.y(), u.x(), u.y();
    lin.noise(0) = variance_;
    return lin;
  }

 private:
  static constexpr double kMinDistance = 1e-9;  // with a direction [m]

  double variance_;
};

}  // namespace locfuse
