// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "locfuse/math/linearization.hpp"
#include "locfuse/math/types.hpp"

namespace locfuse {

/// Motion of a body by its angular rate and specific force: strapdown integration. The error of the
/// attitude is a rotation about the axes of the world: R = Exp(error) R_mean.
///
/// Derivation: docs/models/motion.md, section 5.
class InertialMotion {
 public:
  struct Config {
    double sigma_turn_per_sqrt_s = 0.002;       ///< white noise of the gyro [rad / sqrt(s)]
    double sigma_velocity_per_sqrt_s = 0.05;    ///< of the accelerometer [m/s / sqrt(s)]
    double sigma_bias_radps = 0.02;             ///< of each axis of the gyro at the start [rad/s]
    double sigma_bias_mps2 = 0.2;               ///< of each axis of the accelerometer [m/s^2]
    double sigma_bias_radps_per_sqrt_s = 1e-4;  ///< random walk of the gyro's bias
    double sigma_bias_mps2_per_sqrt_s = 1e-3;   ///< of the accelerometer's
    double sigma_scale = 0.01;                  ///< of the gyro's scale
    /// Attitude of the sensor's axes in the body: by roll, then pitch, then yaw [rad].
    Vector<3> mount = Vector<3>::Zero();
  };

  static constexpr double kGravity = 9.80665;  ///< [m/s^2]

  /// Rows of the error state: x, y, heading, height, velocity in world, tilt about x and y of
  /// world, bias of the gyro and of the accelerometer in body.
  static constexpr int kVariables = 15;
  static constexpr std::array<int, 3> kPosition{0, 1, 3};
  static constexpr std::array<int, 3> kVelocity{4, 5, 6};
  static constexpr std::array<int, 3> kRotation{7, 8, 2};
  static constexpr std::array<int, 3> kRateBias{9, 10, 11};
  static constexpr std::array<int, 3> kForceBias{12, 13, 14};

  struct State {
    Vector<3> position = Vector<3>::Zero();            ///< in world [m]
    Vector<3> velocity = Vector<3>::Zero();            ///< in world [m/s]
    Matrix<3, 3> attitude = Matrix<3, 3>::Identity();  ///< R_world_body
    Vector<3> rate_bias = Vector<3>::Zero();           ///< in body [rad/s]
    Vector<3> force_bias = Vector<3>::Zero();          ///< [m/s^2]
  };
  struct Step {
    State moved;
    Matrix<kVariables, kVariables> jacobian;  ///< of the error state
    Matrix<kVariables, kVariables> noise;
  };

  InertialMotion() : InertialMotion(Config{}) {}

  /// Throws std::invalid_argument unless the sigmas are finite and positive and the mount finite.
  explicit InertialMotion(const Config& config);

  /// What a sensor measures, in the axes of the body.
  [[nodiscard]] Vector<3> in_body(const Vector<3>& measured) const { return mount_ * measured; }

  /// State `seconds` later, by the mean angular rate [rad/s] and specific force [m/s^2] in body of
  /// that time; eq. (5.1) to (5.4). `heading_share` is the root of the share of the horizontal
  /// force that is no noise, by which a heading may be learnt; eq. (5.5).
  [[nodiscard]] Step propagate(const State& state, const Vector<3>& rate, const Vector<3>& force,
                               double seconds, double heading_share = 1.0) const;

  [[nodiscard]] const Config& config() const { return config_; }

 private:
  Config config_;
  Matrix<3, 3> mount_;
};

}  // namespace locfuse
