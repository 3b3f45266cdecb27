// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/types.hpp"
#include "locfuse/time.hpp"

/// What sensors say: plain structs. `validate` throws std::invalid_argument with the value that is
/// wrong; estimators call it on whatever they are given.
namespace locfuse {

/// Name of an anchor, a tag or a landmark: the number that the hardware or the map gives it.
using Id = std::int32_t;

/// Wheel odometry as body velocities, held from `stamp` until the next message.
struct Velocity {
  Stamp stamp = 0;
  double forward = 0.0;    ///< [m/s]
  double turn_rate = 0.0;  ///< [rad/s], counter-clockwise
};

/// Wheel odometry as the motion driven from `begin` to `stamp`.
///
/// It takes effect at `begin`: a measurement taken in between sees its share of the arc.
struct Increment {
  Stamp begin = 0;
  Stamp stamp = 0;
  Pose2 motion;  ///< T_body(begin)_body(stamp): dx, dy [m], dheading [rad]

  /// ekim2020 eq. (6): drive `trans` [m] along the old heading, then turn by `rot` [rad].
  [[nodiscard]] static Increment from_trans_rot(Stamp begin, Stamp stamp, double trans,
                                                double rot) {
    return {begin, stamp, {trans, 0.0, rot}};
  }
};

/// Distance between a tag on the body and an anchor in the world.
struct Range {
  Stamp stamp = 0;
  Id tag = 0;
  Id anchor = 0;
  double range = 0.0;           ///< [m]
  std::optional<double> sigma;  ///< [m]; without it the model's own sigma is used
};

/// Position of an antenna or a tag on the body in the world, from GPS, an RTLS, multilateration.
struct PositionFix {
  Stamp stamp = 0;
  Vector<2> position = Vector<2>::Zero();          ///< [m]
  Matrix<2, 2> covariance = Matrix<2, 2>::Zero();  ///< [m^2], as a driver tells it
  std::optional<Id> tag = {};                      ///< without it, of the antenna
};

/// T_world_body from another localizer, such as AMCL or a scan matcher.
struct PoseObservation {
  Stamp stamp = 0;
  Pose2 pose;
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();  ///< of (x, y, heading), as a driver tells it
};

/// Height of an altimeter on the body over z = 0 of the world. With a PositionFix of the same stamp
/// it is a fix in space.
struct Altitude {
  Stamp stamp = 0;
  double height = 0.0;  ///< [m]
  double sigma = 0.1;   ///< [m]
};

/// A landmark seen from a sensor on the body: how far away its centre is, in which direction, or
/// both; of a body that flies also how high above the sensor's plane. A range is measured along the
/// line of sight.
struct RangeBearing {
  Stamp stamp = 0;
  std::optional<Id> landmark;                  ///< without it, whichever fits
  std::optional<double> range;                 ///< [m]
  std::optional<double> bearing;               ///< from the sensor's x, counter-clockwise [rad]
  std::optional<Matrix<2, 2>> covariance;      ///< of (range, bearing); else the model's own
  std::optional<double> elevation = {};        ///< of the line of sight, up [rad]
  std::optional<double> sigma_elevation = {};  ///< [rad]; else the model's own
};

/// How a 2D laser sits on the body and sees: beam i leaves at angle_min + i * angle_increment.
/// Every number is at most 1e6.
struct LaserGeometry {
  Pose2 pose_in_body;            ///< T_body_laser
  double angle_min = 0.0;        ///< of the first beam, counter-clockwise from the laser's x [rad]
  double angle_increment = 0.0;  ///< [rad], negative if the laser turns clockwise
  double range_min = 0.0;        ///< [m]
  double range_max = 0.0;        ///< [m]

  /// Whether something was seen at this range; false for NaN.
  [[nodiscard]] bool is_return(double range) const {
    return range >= range_min && range < range_max;
  }
};

/// One turn of a 2D laser, as if measured in one moment.
///
/// NaN is a beam without return. So is a range outside [range_min, range_max): many lasers report
/// range_max where nothing came back.
struct LaserScan {
  Stamp stamp = 0;
  std::shared_ptr<const LaserGeometry> geometry;
  std::vector<double> ranges;  ///< [m]
  std::vector<double> intensities =
      {};  ///< of what came back, in the laser's own unit; may be empty
};

void validate(const Velocity& message);
void validate(const Increment& message);
void validate(const Range& message);
/// A covariance is symmetric positive definite, or says in the way of drivers what is not known:
/// messages/told_covariance.hpp.
void validate(const PositionFix& message);
void validate(const PoseObservation& message);
void validate(const Altitude& message);
/// Of a sighting in the plane: one with an elevation is refused, its range is none of the plane.
void validate(const RangeBearing& message);
/// Of a sighting from a body that flies.
void validate_in_space(const RangeBearing& message);
void validate(const LaserGeometry& geometry);
void validate(const LaserScan& message);

}  // namespace locfuse
