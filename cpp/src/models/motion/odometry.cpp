// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/motion/odometry.hpp"

#include <stdexcept>
#include <string>

#include "math/sigma.hpp"

namespace locfuse {
namespace {

double variance_in_bounds(const char* name, double sigma) {
  internal::sigma_in_bounds(std::string("odometry.") + name, sigma);
  return sigma * sigma;
}

}  // namespace

OdometryMotion::OdometryMotion(const Config& config)
    : longitudinal_per_m_(variance_in_bounds("sigma_longitudinal_per_sqrt_m",
                                             config.sigma_longitudinal_per_sqrt_m)),
      lateral_per_m_(
          variance_in_bounds("sigma_lateral_per_sqrt_m", config.sigma_lateral_per_sqrt_m)),
      heading_per_m_(
          variance_in_bounds("sigma_heading_per_sqrt_m", config.sigma_heading_per_sqrt_m)),
      heading_per_rad_(
          variance_in_bounds("sigma_heading_per_sqrt_rad", config.sigma_heading_per_sqrt_rad)),
      longitudinal_per_s_(variance_in_bounds("sigma_longitudinal_per_sqrt_s",
                                             config.sigma_longitudinal_per_sqrt_s) +
                          variance_in_bounds("sigma_xy_per_sqrt_s", config.sigma_xy_per_sqrt_s)),
      xy_per_s_(variance_in_bounds("sigma_xy_per_sqrt_s", config.sigma_xy_per_sqrt_s)),
      heading_per_s_(
          variance_in_bounds("sigma_heading_per_sqrt_s", config.sigma_heading_per_sqrt_s)) {}

OdometryMotion::Corrected OdometryMotion::propagate(
    const Pose2& T_world_body, const Pose2& motion, double seconds, const OdometryErrors& errors,
    const std::optional<Vector<3>>& variance) const {
  const double turn = (1.0 + errors.turn_scale) * motion.heading - errors.turn_bias * seconds;
  // The direction of travel deviates by half of the unreported turn.
  const double aside = errors.direction + 0.5 * (turn - motion.heading);
  const Vector<2> reported = Pose2{0.0, 0.0, aside}.act(motion.position());
  const Vector<2> way = (1.0 + errors.scale) * reported;
  Corrected corrected;
  corrected.step = propagate(T_world_body, {way.x(), way.y(), turn}, seconds, variance);

  const Pose2 turned{0.0, 0.0, T_world_body.heading};
  const Vector<2> by_scale = turned.act(reported);
  const Vector<2> by_direction = turned.act({-way.y(), way.x()});
  corrected.by_errors.row(2) << 0.0, 0.0, motion.heading, -seconds;
  corrected.by_errors.topRows<2>() << by_scale, by_direction, 0.5 * motion.heading * by_direction,
      -0.5 * seconds * by_direction;
  return corrected;
}

}  // namespace locfuse
