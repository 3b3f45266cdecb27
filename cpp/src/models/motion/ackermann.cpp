// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/motion/ackermann.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "locfuse/math/angle.hpp"

namespace locfuse {
namespace {

/// Bounds within which every result is finite.
struct AckermannLimits {
  /// Minimum speed of the wheel as a share of that of the axle.
  static constexpr double kMinShare = 1e-9;
  static constexpr double kMinBase = 1e-3;    // [m]
  static constexpr double kMaxLength = 1e3;   // [m]
  static constexpr double kMaxSetting = 1e6;  // of speeds [m/s] and sigmas
};

void check(const char* name, double value, bool good, const char* expected) {
  if (!(std::isfinite(value) && good)) {
    throw std::invalid_argument(std::string("ackermann.") + name + " is " + std::to_string(value) +
                                ", expected a finite number" + expected);
  }
}

struct Turn {
  double curvature = 0.0;  // of the path of the middle of the rear axle, to the left [1/m]
  double share = 1.0;      // of its speed: speed of the wheel
};

Turn turn_of(const AckermannVehicle::Config& config, double wheel_speed, double steering) {
  check("wheel_speed", wheel_speed, std::abs(wheel_speed) <= AckermannLimits::kMaxSetting,
        " between -1e6 and 1e6");
  check("steering", steering, std::abs(steering) < 0.5 * kPi, " between -pi/2 and pi/2");
  const double curvature = std::tan(steering) / config.wheel_base_m;
  const double share = 1.0 - curvature * config.encoder_left_m;
  if (!(share >= AckermannLimits::kMinShare)) {
    throw std::invalid_argument("ackermann.steering is " + std::to_string(steering) +
                                ": the turn is not about a point beyond the wheel at " +
                                std::to_string(config.encoder_left_m) +
                                " m, expected tan(steering) * encoder_left_m < wheel_base_m");
  }
  return {curvature, share};
}

}  // namespace

AckermannVehicle::AckermannVehicle(const Config& config) : config_(config) {
  const auto is_sigma = [](double sigma) {
    return sigma >= 0.0 && sigma <= AckermannLimits::kMaxSetting;
  };
  check("wheel_base_m", config.wheel_base_m,
        config.wheel_base_m >= AckermannLimits::kMinBase &&
            config.wheel_base_m <= AckermannLimits::kMaxLength,
        " between 1e-3 and 1e3");
  check("encoder_left_m", config.encoder_left_m,
        std::abs(config.encoder_left_m) <= AckermannLimits::kMaxLength, " between -1e3 and 1e3");
  check("sigma_speed_mps", config.sigma_speed_mps, is_sigma(config.sigma_speed_mps),
        " between 0 and 1e6");
  check("sigma_steering_rad", config.sigma_steering_rad, is_sigma(config.sigma_steering_rad),
        " between 0 and 1e6");
}

Velocity AckermannVehicle::velocity(Stamp stamp, double wheel_speed, double steering) const {
  const Turn turn = turn_of(config_, wheel_speed, steering);
  const double forward = wheel_speed / turn.share;
  return {stamp, forward, forward * turn.curvature};
}

Matrix<2, 2> AckermannVehicle::jacobian(double wheel_speed, double steering) const {
  const Turn turn = turn_of(config_, wheel_speed, steering);
  const double forward = wheel_speed / turn.share;
  const double cosine = std::cos(steering);
  const double bend = 1.0 / (config_.wheel_base_m * cosine * cosine);  // of curvature, by steering
  Matrix<2, 2> jacobian;
  jacobian << 1.0, forward * bend * config_.encoder_left_m,  //
      turn.curvature, forward * bend;
  return jacobian / turn.share;
}

Matrix<2, 2> AckermannVehicle::covariance(double wheel_speed, double steering) const {
  const Vector<2> sigmas(config_.sigma_speed_mps, config_.sigma_steering_rad);
  const Matrix<2, 2> root = jacobian(wheel_speed, steering) * sigmas.asDiagonal();
  return root * root.transpose();
}

}  // namespace locfuse
