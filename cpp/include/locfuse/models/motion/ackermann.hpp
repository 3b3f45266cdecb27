// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// A vehicle that steers its front wheels and counts the turns of one rear wheel: what the two say
/// becomes the velocity of its body, whose origin is the middle of the rear axle.
///
/// Derivation: docs/models/ackermann.md. A steering angle is that of a wheel in the middle of the
/// front axle [rad], to the left positive; a wheel's speed is negative backwards [m/s].
class AckermannVehicle {
 public:
  struct Config {
    double wheel_base_m = 0.0;        ///< from the rear to the front axle; must be told
    double encoder_left_m = 0.0;      ///< of the wheel that is counted, from the middle of its axle
    double sigma_speed_mps = 0.0;     ///< of its speed
    double sigma_steering_rad = 0.0;  ///< of the steering angle
  };

  /// Throws std::invalid_argument unless the wheel base is 1 mm to 1 km, the wheel within 1 km of
  /// the middle, and the sigmas are 0 to 1e6.
  explicit AckermannVehicle(const Config& config);

  [[nodiscard]] const Config& config() const { return config_; }

  /// Eq. (2) and (3). Throws std::invalid_argument if a value is not finite or a speed beyond
  /// 1e6 m/s, or where the wheel does not tell the speed: steered by 90 degrees and more, or about
  /// a point that is not beyond the wheel.
  [[nodiscard]] Velocity velocity(Stamp stamp, double wheel_speed, double steering) const;

  /// Of (forward, turn rate) with respect to (wheel speed, steering); eq. (4). Throws likewise.
  [[nodiscard]] Matrix<2, 2> jacobian(double wheel_speed, double steering) const;

  /// Of (forward, turn rate), by the sigmas; eq. (5). Throws likewise.
  [[nodiscard]] Matrix<2, 2> covariance(double wheel_speed, double steering) const;

 private:
  Config config_;
};

}  // namespace locfuse
