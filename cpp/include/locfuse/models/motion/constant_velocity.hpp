// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "locfuse/math/linearization.hpp"

namespace locfuse {

/// A body that nobody measures the motion of: its velocity stays as it is but for white
/// acceleration, its heading is a random walk.
///
/// Derivation: docs/models/constant_velocity.md.
class ConstantVelocityMotion {
 public:
  /// Square roots of spectral densities.
  struct Config {
    double sigma_velocity_per_sqrt_s = 1.0;  ///< of each of the velocity's axes [m/s / sqrt(s)]
    double sigma_climb_per_sqrt_s = 0.5;     ///< of the climb rate [m/s / sqrt(s)]
    double sigma_heading_per_sqrt_s = 0.5;   ///< [rad / sqrt(s)]
  };

  /// x, y, heading, height, velocity in world along x and y, climb rate.
  static constexpr int kVariables = 7;

  ConstantVelocityMotion() = default;

  /// Throws std::invalid_argument unless the sigmas are finite and positive.
  explicit ConstantVelocityMotion(const Config& config);

  /// Those variables `seconds` later; eq. (2) and (3). Exact for any step: two halves are the
  /// whole.
  [[nodiscard]] Propagation<Eigen::VectorXd, Eigen::Dynamic> propagate(const Eigen::VectorXd& state,
                                                                       double seconds) const;

 private:
  // Spectral densities.
  double velocity_per_s_ = 0.0;
  double climb_per_s_ = 0.0;
  double heading_per_s_ = 0.0;
};

}  // namespace locfuse
