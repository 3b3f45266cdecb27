// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/types.hpp"
#include "locfuse/time.hpp"

/// Messages of sensors: plain structs. `validate` throws std::invalid_argument with the invalid
/// value; estimators call it on every message.
namespace locfuse {

/// Id of an anchor, a tag or a landmark: its number in the hardware or the map.
using Id = std::int32_t;

/// Wheel odometry as body velocities, held from `stamp` until the next message.
struct Velocity {
  Stamp stamp = 0;
  double forward = 0.0;    ///< [m/s]
  double turn_rate = 0.0;  ///< [rad/s], counter-clockwise
  double left = 0.0;       ///< [m/s], of wheels that roll sideways, too
};

/// Wheel odometry as the motion from `begin` to `stamp`.
///
/// It takes effect at `begin`: for a measurement in between its share of the arc counts.
struct Increment {
  Stamp begin = 0;
  Stamp stamp = 0;
  Pose2 motion;  ///< T_body(begin)_body(stamp): dx, dy [m], dheading [rad]
  /// Of dx, dy [m^2] and dheading [rad^2], as white noise from one to the next; else that of the
  /// model, by distance and turn.
  std::optional<Vector<3>> variance = {};

  static constexpr std::size_t kNoOrigin = std::numeric_limits<std::size_t>::max();
  /// Of a motion that an OdometryTimeline made: MadeMotion.
  std::size_t origin = kNoOrigin;
  bool again = false;

  /// Motion of `trans` [m] along the old heading, then a turn by `rot` [rad]: ekim2020 eq. (6).
  [[nodiscard]] static Increment from_drive_then_turn(Stamp begin, Stamp stamp, double trans,
                                                      double rot) {
    return {begin, stamp, {trans, 0.0, rot}};
  }
};

/// What an inertial sensor on the body measures, in its own axes.
struct Imu {
  Stamp stamp = 0;
  Vector<3> angular_rate = Vector<3>::Zero();  ///< [rad/s]
  /// Acceleration less gravity [m/s^2]: at rest 9.81 upwards. Empty without an accelerometer.
  std::optional<Vector<3>> specific_force = {};
};

/// Distance between a tag on the body and an anchor in the world.
struct Range {
  Stamp stamp = 0;
  Id tag = 0;
  Id anchor = 0;
  double range = 0.0;           ///< [m]
  std::optional<double> sigma;  ///< [m]; else that of the model
};

/// Position in world of an antenna or a tag on the body, from GPS, an RTLS or multilateration.
struct PositionFix {
  Stamp stamp = 0;
  Vector<2> position = Vector<2>::Zero();          ///< [m]
  Matrix<2, 2> covariance = Matrix<2, 2>::Zero();  ///< [m^2], as reported by the driver
  std::optional<Id> tag = {};                      ///< if empty, of the antenna
};

/// T_world_body from another localizer, such as AMCL or a scan matcher.
struct PoseObservation {
  Stamp stamp = 0;
  Pose2 pose;
  Matrix<3, 3> covariance =
      Matrix<3, 3>::Zero();  ///< of (x, y, heading), as reported by the driver
};

/// Height of an altimeter on the body above z = 0 of the world. With a PositionFix of the same
/// stamp it is a fix in 3D.
struct Altitude {
  Stamp stamp = 0;
  double height = 0.0;               ///< [m]
  std::optional<double> sigma = {};  ///< [m]; else that of the model
};

/// Heading of the body in world: of a magnetometer, the orientation of an inertial unit or two
/// antennas. Of GPS it is the course, in which its antenna travels.
struct Heading {
  Stamp stamp = 0;
  double heading = 0.0;              ///< counter-clockwise from the x axis of world [rad]
  std::optional<double> sigma = {};  ///< [rad]; else that of the model
  bool is_course = false;            ///< whether it is the direction of travel of the antenna
};

/// Observation of a landmark by a sensor on the body: range, bearing or both of its centre; from a
/// flying body also the elevation. The range is along the line of sight.
struct RangeBearing {
  Stamp stamp = 0;
  std::optional<Id> landmark;                  ///< if empty, by association
  std::optional<double> range;                 ///< [m]
  std::optional<double> bearing;               ///< from the sensor's x, counter-clockwise [rad]
  std::optional<Matrix<2, 2>> covariance;      ///< of (range, bearing); else that of the model
  std::optional<double> elevation = {};        ///< of the line of sight, up [rad]
  std::optional<double> sigma_elevation = {};  ///< [rad]; else that of the model
};

/// Mount and beams of a 2D laser: beam i has the angle angle_min + i * angle_increment. The
/// magnitude of every number is at most 1e6.
struct LaserGeometry {
  Pose2 pose_in_body;            ///< T_body_laser
  double angle_min = 0.0;        ///< of the first beam, counter-clockwise from the laser's x [rad]
  double angle_increment = 0.0;  ///< [rad], negative if the laser turns clockwise
  double range_min = 0.0;        ///< [m]
  double range_max = 0.0;        ///< [m]
  double time_increment = 0.0;   ///< from one beam to the next [s]; 0: all at once

  /// Whether a range is a return; false for NaN.
  [[nodiscard]] bool is_return(double range) const {
    return range > range_min && range < range_max;
  }
};

/// One turn of a 2D laser; `stamp` is that of its middle.
///
/// NaN, and every range outside (range_min, range_max), is a beam without return: many lasers
/// report range_max for it.
struct LaserScan {
  Stamp stamp = 0;
  std::shared_ptr<const LaserGeometry> geometry;
  std::vector<double> ranges;            ///< [m]
  std::vector<double> intensities = {};  ///< of the returns, in the unit of the laser; may be empty
};

/// The scan as if measured at its stamp, by a body that turns at a rate [rad/s]; empty where that
/// is the same.
[[nodiscard]] std::optional<LaserScan> as_of_stamp(const LaserScan& scan, double turn_rate);

void validate(const Velocity& message);
void validate(const Increment& message);
void validate(const Imu& message);
void validate(const Range& message);
/// The covariance must be symmetric positive definite, or mark unknown axes by a convention of
/// drivers: messages/reported_covariance.hpp.
void validate(const PositionFix& message);
void validate(const PoseObservation& message);
void validate(const Altitude& message);
void validate(const Heading& message);
/// Observation in the plane: an elevation is refused, as its range is not in the plane.
void validate(const RangeBearing& message);
/// Observation from a flying body.
void validate_in_space(const RangeBearing& message);
void validate(const LaserGeometry& geometry);
void validate(const LaserScan& message);

}  // namespace locfuse
