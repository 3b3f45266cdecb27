// SPDX-License-Identifier: Apache-2.0
#include "locfuse/messages/messages.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "locfuse/math/symmetric.hpp"
#include "locfuse/messages/reported_covariance.hpp"

namespace locfuse {
namespace {

constexpr double kMaxScanNumber = 1e6;  // of a laser's geometry
constexpr double kMaxVariance = 1e12;   // of a motion [m^2, rad^2]
constexpr double kMaxRate = 1e3;        // of an inertial sensor [rad/s]
constexpr double kMaxForce = 1e5;       // [m/s^2]

[[noreturn]] void refuse(const char* what, double value, const char* expected) {
  std::ostringstream text;
  text << what << " is " << value << ", expected " << expected;
  throw std::invalid_argument(text.str());
}

void require_finite(const char* what, double value) {
  if (!std::isfinite(value)) {
    refuse(what, value, "a finite number");
  }
}

void require_sigma(const char* what, double sigma) {
  if (!(sigma > 0.0 && sigma * sigma > 0.0 && std::isfinite(sigma * sigma))) {
    refuse(what, sigma, "a number > 0 with a finite square > 0");
  }
}

/// Scans are matched in single precision, with sines by recurrence over the increment.
void require_scan_size(const char* what, double value) {
  if (!(std::abs(value) <= kMaxScanNumber)) {
    refuse(what, value, "a finite number from -1e6 to 1e6");
  }
}

template <int N>
[[noreturn]] void refuse_covariance(const char* what, const Matrix<N, N>& covariance) {
  std::ostringstream text;
  text << what << " is not a symmetric positive definite matrix:\n" << covariance;
  throw std::invalid_argument(text.str());
}

/// Axes that the driver does not measure may hold any number.
template <int N>
void require_reported_covariance(const char* what, const Matrix<N, N>& covariance) {
  if (covariance.hasNaN()) {
    refuse_covariance(what, covariance);
  }
  const ReportedNoise<N> reported =
      reported_noise<N>(covariance, Vector<N>::Zero(), Vector<N>::Zero());
  for (Eigen::Index i = 0; is_reported(covariance) && i < reported.rows; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {  // pairs of measured axes
      if (!is_symmetric(covariance, reported.axes[static_cast<std::size_t>(i)],
                        reported.axes[static_cast<std::size_t>(j)])) {
        refuse_covariance(what, covariance);
      }
    }
  }
  if (reported.rows > 0 && !is_covariance(reported.noise)) {
    refuse_covariance(what, covariance);
  }
}

}  // namespace

void check_unknown_sigma(const char* name, double sigma) {
  if (!(std::isfinite(sigma * sigma) && sigma >= 0.0)) {
    refuse(name, sigma, "a number >= 0 with a finite square");
  }
}

void check_min_sigma(const char* name, double sigma) {
  if (!(std::isfinite(sigma * sigma) && sigma > 0.0)) {
    refuse(name, sigma, "a number > 0 with a finite square");
  }
}

std::optional<LaserScan> as_of_stamp(const LaserScan& scan, double turn_rate) {
  const double turn = turn_rate * scan.geometry->time_increment;  // from one beam to the next
  const double whole = turn * (static_cast<double>(scan.ranges.size()) - 1.0);
  if (turn == 0.0 || !(std::abs(whole) < kPi)) {
    return std::nullopt;
  }
  LaserGeometry geometry = *scan.geometry;
  geometry.angle_min -= 0.5 * whole;
  geometry.angle_increment += turn;
  geometry.time_increment = 0.0;
  if (geometry.angle_increment == 0.0) {
    return std::nullopt;
  }
  return LaserScan{scan.stamp, std::make_shared<const LaserGeometry>(geometry), scan.ranges,
                   scan.intensities};
}

void validate(const Velocity& message) {
  check_stamp(message.stamp);
  require_finite("Velocity.forward [m/s]", message.forward);
  require_finite("Velocity.turn_rate [rad/s]", message.turn_rate);
  require_finite("Velocity.left [m/s]", message.left);
}

void validate(const Increment& message) {
  check_stamp(message.begin);
  check_stamp(message.stamp);
  require_finite("Increment.motion.x [m]", message.motion.x);
  require_finite("Increment.motion.y [m]", message.motion.y);
  require_finite("Increment.motion.heading [rad]", message.motion.heading);
  if (message.stamp < message.begin) {
    throw std::invalid_argument("Increment ends at " + std::to_string(message.stamp) +
                                " ns, before it begins at " + std::to_string(message.begin) +
                                " ns");
  }
  if (message.variance) {
    for (const double variance : *message.variance) {
      if (!(variance >= 0.0 && variance <= kMaxVariance)) {
        refuse("Increment.variance [m^2, rad^2]", variance, "0 to 1e12");
      }
    }
  }
}

void validate(const Imu& message) {
  check_stamp(message.stamp);
  for (const double rate : message.angular_rate) {
    if (!(std::abs(rate) <= kMaxRate)) {
      refuse("Imu.angular_rate [rad/s]", rate, "a finite number from -1000 to 1000");
    }
  }
  for (const double force : message.specific_force.value_or(Vector<3>::Zero())) {
    if (!(std::abs(force) <= kMaxForce)) {
      refuse("Imu.specific_force [m/s^2]", force, "a finite number from -1e5 to 1e5");
    }
  }
}

void validate(const Range& message) {
  check_stamp(message.stamp);
  if (!std::isfinite(message.range) || message.range < 0.0) {
    refuse("Range.range [m]", message.range, "a finite number >= 0");
  }
  if (message.sigma) {
    require_sigma("Range.sigma [m]", *message.sigma);
  }
}

void validate(const PositionFix& message) {
  check_stamp(message.stamp);
  require_finite("PositionFix.position.x [m]", message.position.x());
  require_finite("PositionFix.position.y [m]", message.position.y());
  require_reported_covariance("PositionFix.covariance", message.covariance);
}

void validate(const PoseObservation& message) {
  check_stamp(message.stamp);
  require_finite("PoseObservation.pose.x [m]", message.pose.x);
  require_finite("PoseObservation.pose.y [m]", message.pose.y);
  require_finite("PoseObservation.pose.heading [rad]", message.pose.heading);
  require_reported_covariance("PoseObservation.covariance", message.covariance);
}

void validate(const Altitude& message) {
  check_stamp(message.stamp);
  require_finite("Altitude.height [m]", message.height);
  if (message.sigma) {
    require_sigma("Altitude.sigma [m]", *message.sigma);
  }
}

void validate(const Heading& message) {
  check_stamp(message.stamp);
  require_finite("Heading.heading [rad]", message.heading);
  if (message.sigma) {
    require_sigma("Heading.sigma [rad]", *message.sigma);
  }
}

void validate(const RangeBearing& message) {
  if (message.elevation || message.sigma_elevation) {
    throw std::invalid_argument(
        "RangeBearing.elevation is " + std::to_string(message.elevation.value_or(0.0)) +
        " rad, expected none: only a body that flies (AirEkf) has a use for it");
  }
  validate_in_space(message);
}

void validate_in_space(const RangeBearing& message) {
  check_stamp(message.stamp);
  if (!message.range && !message.bearing && !message.elevation) {
    throw std::invalid_argument("RangeBearing has neither range nor bearing, expected one of them");
  }
  if (message.elevation && !(std::abs(*message.elevation) <= 0.5 * kPi)) {
    refuse("RangeBearing.elevation [rad]", *message.elevation, "a number from -pi/2 to pi/2");
  }
  if (message.sigma_elevation) {
    require_sigma("RangeBearing.sigma_elevation [rad]", *message.sigma_elevation);
  }
  if (message.range && !(std::isfinite(*message.range) && *message.range >= 0.0)) {
    refuse("RangeBearing.range [m]", *message.range, "a finite number >= 0");
  }
  if (message.bearing) {
    require_finite("RangeBearing.bearing [rad]", *message.bearing);
  }
  if (message.covariance && !is_covariance(*message.covariance)) {
    refuse_covariance("RangeBearing.covariance", *message.covariance);
  }
}

void validate(const LaserGeometry& geometry) {
  require_scan_size("LaserGeometry.pose_in_body.x [m]", geometry.pose_in_body.x);
  require_scan_size("LaserGeometry.pose_in_body.y [m]", geometry.pose_in_body.y);
  require_scan_size("LaserGeometry.pose_in_body.heading [rad]", geometry.pose_in_body.heading);
  require_scan_size("LaserGeometry.angle_min [rad]", geometry.angle_min);
  require_scan_size("LaserGeometry.angle_increment [rad]", geometry.angle_increment);
  if (geometry.angle_increment == 0.0) {
    refuse("LaserGeometry.angle_increment [rad]", geometry.angle_increment, "other than 0");
  }
  if (!std::isfinite(geometry.range_min) || geometry.range_min < 0.0) {
    refuse("LaserGeometry.range_min [m]", geometry.range_min, "a finite number >= 0");
  }
  require_scan_size("LaserGeometry.range_max [m]", geometry.range_max);
  if (geometry.range_max <= geometry.range_min) {
    refuse("LaserGeometry.range_max [m]", geometry.range_max, "a number above range_min");
  }
  require_scan_size("LaserGeometry.time_increment [s]", geometry.time_increment);
  if (geometry.time_increment < 0.0) {
    refuse("LaserGeometry.time_increment [s]", geometry.time_increment, "a number >= 0");
  }
}

void validate(const LaserScan& message) {
  check_stamp(message.stamp);
  if (!message.geometry) {
    throw std::invalid_argument("LaserScan.geometry is null, expected a LaserGeometry");
  }
  validate(*message.geometry);
  for (const double range : message.ranges) {
    if (std::isinf(range) || range < 0.0) {
      refuse("LaserScan.ranges [m]", range, "a finite number >= 0, or NaN without return");
    }
  }
  if (!message.intensities.empty() && message.intensities.size() != message.ranges.size()) {
    throw std::invalid_argument("LaserScan.intensities are " +
                                std::to_string(message.intensities.size()) + ", expected none or " +
                                std::to_string(message.ranges.size()) + ", one per beam");
  }
  for (const double intensity : message.intensities) {
    require_finite("LaserScan.intensities", intensity);
  }
}

}  // namespace locfuse
