// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "locfuse/math/linearization.hpp"

namespace locfuse {

/// Motion of a body without odometry: constant velocity with white acceleration, random-walk
/// heading.
///
/// Derivation: docs/models/motion.md.
class ConstantVelocityMotion {
 public:
  /// Square roots of spectral densities.
  struct Config {
    double sigma_velocity_per_sqrt_s = 1.0;  ///< of each axis of the velocity [m/s / sqrt(s)]
    double sigma_climb_per_sqrt_s = 0.5;     ///< of the climb rate [m/s / sqrt(s)]
    double sigma_heading_per_sqrt_s = 0.5;   ///< [rad / sqrt(s)]
  };

  /// x, y, heading, height, velocity in world along x and y, climb rate.
  static constexpr int kVariables = 7;

  ConstantVelocityMotion() = default;

  /// Throws std::invalid_argument unless the sigmas are finite and positive.
  explicit ConstantVelocityMotion(const Config& config);

  /// State `seconds` later; eq. (4.2) and (4.3). Exact for any step: two halves are equal to the
  /// whole.
  [[nodiscard]] Propagation<Eigen::VectorXd, Eigen::Dynamic> propagate(const Eigen::VectorXd& state,
                                                                       double seconds) const;

 private:
  // Spectral densities.
  double velocity_per_s_ = 0.0;
  double climb_per_s_ = 0.0;
  double heading_per_s_ = 0.0;
};

/// Points of constant velocity with white acceleration: celan2017 eq. (2) and (3).
///
/// Derivation: docs/models/motion.md.
class PointMotion {
 public:
  struct Config {
    double sigma_velocity_per_sqrt_s = 0.2;  ///< of each axis [m/s / sqrt(s)]
  };

  PointMotion() : PointMotion(Config{}) {}

  /// Throws std::invalid_argument unless the sigma is finite and positive.
  explicit PointMotion(const Config& config);

  /// All positions, then all velocities, of `Size` / 4 points in the plane `seconds` later; eq.
  /// (4.2) for each axis. Exact for any step: two halves are equal to the whole.
  template <int Size>
  [[nodiscard]] Propagation<Vector<Size>, Size> propagate(const Vector<Size>& state,
                                                          double seconds) const {
    static_assert(Size > 0 && Size % 4 == 0, "two positions and two velocities a point");
    constexpr int kHalf = Size / 2;
    const double T = seconds;
    Propagation<Vector<Size>, Size> step{state, Matrix<Size, Size>::Identity(),
                                         Matrix<Size, Size>::Zero()};
    step.moved.template head<kHalf>() += T * state.template tail<kHalf>();
    step.jacobian.template topRightCorner<kHalf, kHalf>().diagonal().setConstant(T);
    step.noise.diagonal().template head<kHalf>().setConstant(velocity_per_s_ * T * T * T / 3.0);
    step.noise.diagonal().template tail<kHalf>().setConstant(velocity_per_s_ * T);
    const double shared = velocity_per_s_ * T * T / 2.0;
    step.noise.template topRightCorner<kHalf, kHalf>().diagonal().setConstant(shared);
    step.noise.template bottomLeftCorner<kHalf, kHalf>().diagonal().setConstant(shared);
    return step;
  }

 private:
  double velocity_per_s_;  // spectral density
};

}  // namespace locfuse
