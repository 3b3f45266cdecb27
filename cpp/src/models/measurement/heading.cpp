// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/heading.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "locfuse/math/angle.hpp"
#include "locfuse/messages/reported_covariance.hpp"

namespace locfuse {
namespace {

/// Receivers report the velocity of the middle of an interval as that of its end [s].
constexpr double kDelayOfCourse = 0.1;
/// Wheels do not roll exactly where they point [rad].
constexpr double kSigmaOfTravel = 0.03;
/// Of a velocity of three sigma, below which it has no direction [rad].
constexpr double kMaxSigmaOfCourse = 1.0 / 3.0;

}  // namespace

HeadingModel::HeadingModel(const Config& config) : config_(config) {
  check_min_sigma("heading.sigma_rad", config.sigma_rad);
  check_min_sigma("heading.least_sigma_rad", config.least_sigma_rad);
  if (!std::isfinite(config.offset_rad) || !std::isfinite(config.antenna_forward_m) ||
      !std::isfinite(config.antenna_left_m)) {
    throw std::invalid_argument("heading.offset_rad and the place of the antenna must be finite");
  }
  if (!(config.min_speed_mps > 0.0 && std::isfinite(config.min_speed_mps))) {
    throw std::invalid_argument("heading.min_speed_mps is " + std::to_string(config.min_speed_mps) +
                                ", expected a finite number > 0");
  }
}

std::optional<double> HeadingModel::direction(const Pose2& rate) const {
  const double forward = rate.x - rate.heading * config_.antenna_left_m;
  const double left = rate.y + rate.heading * config_.antenna_forward_m;
  if (!(std::hypot(forward, left) >= config_.min_speed_mps)) {
    return std::nullopt;
  }
  return std::atan2(left, forward);
}

std::optional<Linearization<1, 4>> HeadingModel::linearize(const Pose2& T_world_body,
                                                           double offset_error, const Heading& z,
                                                           const Pose2& rate) const {
  Linearization<1, 4> lin;
  const double sigma = std::max(z.sigma.value_or(config_.sigma_rad), config_.least_sigma_rad);
  lin.noise(0) = sigma * sigma;
  double turned = config_.offset_rad + offset_error;
  if (z.is_course) {
    const std::optional<double> travel = direction(rate);
    if (!travel || sigma > kMaxSigmaOfCourse) {
      return std::nullopt;
    }
    turned = *travel;
    const double delayed = kDelayOfCourse * rate.heading;
    lin.noise(0) += kSigmaOfTravel * kSigmaOfTravel + delayed * delayed;
  }
  lin.residual(0) = wrap_angle(z.heading - (T_world_body.heading + turned));
  lin.jacobian << 0.0, 0.0, 1.0, (z.is_course ? 0.0 : 1.0);
  return lin;
}

std::optional<Linearization<1, 3>> HeadingModel::linearize(const Pose2& T_world_body,
                                                           const Heading& z,
                                                           const Pose2& rate) const {
  const auto full = linearize(T_world_body, 0.0, z, rate);
  if (!full) {
    return std::nullopt;
  }
  Linearization<1, 3> lin;
  lin.residual = full->residual;
  lin.jacobian = full->jacobian.leftCols<3>();
  lin.noise = full->noise;
  return lin;
}

}  // namespace locfuse
