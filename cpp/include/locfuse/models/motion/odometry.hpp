// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <optional>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/geometry/uncertain_motion.hpp"
#include "locfuse/math/linearization.hpp"

namespace locfuse {

/// Systematic errors of odometry.
struct OdometryErrors {
  double scale = 0.0;       ///< the distance is (1 + scale) times the reported one
  double direction = 0.0;   ///< of travel relative to the heading, counter-clockwise [rad]
  double turn_scale = 0.0;  ///< the turn is (1 + turn_scale) times the reported one
  double turn_bias = 0.0;   ///< turn rate reported in addition, as by a gyro [rad/s]

  static constexpr int kCount = 4;
};

/// Wheel odometry: motion in the previous body frame. Its noise grows with the distance driven and
/// the angle turned, so it does not depend on the message rate.
///
/// Derivation: docs/models/motion.md.
class OdometryMotion {
 public:
  /// Standard deviations of a random walk over distance and turn. The defaults are of wheels of
  /// which nothing is known; those of a good robot slip a third as much.
  struct Config {
    double sigma_longitudinal_per_sqrt_m = 0.1;  ///< [m / sqrt(m)]
    double sigma_lateral_per_sqrt_m = 0.05;      ///< [m / sqrt(m)]
    double sigma_heading_per_sqrt_m = 0.02;      ///< [rad / sqrt(m)]
    double sigma_heading_per_sqrt_rad = 0.1;     ///< [rad / sqrt(rad)]
    double sigma_xy_per_sqrt_s = 0.0;            ///< at any speed, also at rest [m / sqrt(s)]
    double sigma_heading_per_sqrt_s = 0.0;       ///< of the heading, also at rest [rad / sqrt(s)]
    double sigma_longitudinal_per_sqrt_s = 0.0;  ///< along the heading, also at rest [m / sqrt(s)]
  };

  OdometryMotion() = default;

  /// Throws std::invalid_argument unless every sigma is 0 to 1e6.
  explicit OdometryMotion(const Config& config);

  /// T_world_body after `motion` (previous body frame), which took `seconds`; eq. (1.1) to (1.4).
  /// `variance` of the motion's dx, dy and dheading, where it is known, replaces eq. (1.3).
  [[nodiscard]] Propagation<Pose2, 3> propagate(
      const Pose2& T_world_body, const Pose2& motion, double seconds,
      const std::optional<Vector<3>>& variance = {}) const {
    const double c = std::cos(T_world_body.heading);
    const double s = std::sin(T_world_body.heading);
    const double dx = c * motion.x - s * motion.y;
    const double dy = s * motion.x + c * motion.y;
    const double distance = std::sqrt(dx * dx + dy * dy);
    const double turn = std::abs(motion.heading);

    Propagation<Pose2, 3> step;
    step.moved = {T_world_body.x + dx, T_world_body.y + dy,
                  wrap_angle(T_world_body.heading + motion.heading)};
    step.jacobian << 1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0;
    double along = longitudinal_per_m_ * distance + longitudinal_per_s_ * seconds;
    double across = lateral_per_m_ * distance + xy_per_s_ * seconds;
    double heading = heading_per_m_ * distance + heading_per_rad_ * turn + heading_per_s_ * seconds;
    if (variance) {
      along = variance->x();
      across = variance->y();
      heading = variance->z();
    }
    const double xy = c * s * (along - across);
    step.noise << c * c * along + s * s * across, xy, 0.0,  //
        xy, s * s * along + c * c * across, 0.0,            //
        0.0, 0.0, heading;
    return step;
  }

  /// Appends `next` to a motion with its covariance; `propagate` with that motion as the pose.
  void append(UncertainMotion& so_far, const Pose2& next, double seconds,
              const std::optional<Vector<3>>& variance = {}) const {
    const Propagation<Pose2, 3> step = propagate(so_far.motion, next, seconds, variance);
    so_far.motion = step.moved;
    so_far.covariance = step.jacobian * so_far.covariance * step.jacobian.transpose() + step.noise;
  }

  /// Propagation by a motion that was reported with `errors`, and the derivative of the moved pose
  /// with respect to them, in their order; eq. (1.7) and (1.8).
  struct Corrected {
    Propagation<Pose2, 3> step;
    Matrix<3, OdometryErrors::kCount> by_errors;
  };
  [[nodiscard]] Corrected propagate(const Pose2& T_world_body, const Pose2& motion, double seconds,
                                    const OdometryErrors& errors,
                                    const std::optional<Vector<3>>& variance = {}) const;

 private:
  // Variances per metre, radian and second.
  double longitudinal_per_m_ = 0.0;
  double lateral_per_m_ = 0.0;
  double heading_per_m_ = 0.0;
  double heading_per_rad_ = 0.0;
  double longitudinal_per_s_ = 0.0;
  double xy_per_s_ = 0.0;
  double heading_per_s_ = 0.0;
};

}  // namespace locfuse
