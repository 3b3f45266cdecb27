// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Velocity of a vehicle from its steering angle and the speed of one rear wheel. The origin of the
/// body is the middle of the rear axle.
///
/// Derivation: docs/models/motion.md. The steering angle is that of a virtual wheel in
/// the middle of the front axle [rad], positive to the left; the wheel speed is negative backwards
/// [m/s].
class AckermannVehicle {
 public:
  struct Config {
    double wheel_base_m = 0.0;     ///< from the rear to the front axle; required
    double encoder_left_m = 0.0;   ///< of the wheel with the encoder, from the middle of its axle
    double sigma_speed_mps = 0.0;  ///< of the wheel speed
    double sigma_steering_rad = 0.0;  ///< of the steering angle
  };

  /// Throws std::invalid_argument unless the wheel base is 1 mm to 1 km, the wheel within 1 km of
  /// the middle, and the sigmas are 0 to 1e6.
  explicit AckermannVehicle(const Config& config);

  [[nodiscard]] const Config& config() const { return config_; }

  /// Velocity of the body, eq. (3.2) and (3.3). Throws std::invalid_argument if a value is not
  /// finite, a speed exceeds 1e6 m/s, or the wheel does not determine the speed: steered by 90
  /// degrees or more, or about a point that is not beyond the wheel.
  [[nodiscard]] Velocity velocity(Stamp stamp, double wheel_speed, double steering) const;

  /// Jacobian of (forward, turn rate) with respect to (wheel speed, steering); eq. (3.4). Throws as
  /// `velocity` does.
  [[nodiscard]] Matrix<2, 2> jacobian(double wheel_speed, double steering) const;

  /// Covariance of (forward, turn rate) from the sigmas; eq. (3.5). Throws as `velocity` does.
  [[nodiscard]] Matrix<2, 2> covariance(double wheel_speed, double steering) const;

 private:
  Config config_;
};

}  // namespace locfuse
