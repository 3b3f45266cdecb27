// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Systematic errors of a landmark sensor and its mount.
struct LandmarkErrors {
  Pose2 mount;                ///< added to x, y and heading of T_body_sensor
  double range_offset = 0.0;  ///< by which ranges are too long [m]
  double range_scale = 0.0;   ///< ranges are (1 + range_scale) times the distance
  double delay = 0.0;         ///< by which observations are older than their stamps [s]

  static constexpr int kCount = 6;
};

/// Range and bearing from a sensor on the body to the centre of a landmark, or one of the two.
///
/// h(x) = (|d|, atan2(d_y, d_x)) with d the landmark in the sensor's frame;
/// docs/models/landmarks.md eq. (1.1).
class RangeBearingModel {
 public:
  /// R = diag(sigma_range_m^2 + (sigma_range_relative * range)^2, sigma_bearing_rad^2) where the
  /// message has no covariance; `range` is the measured one.
  struct Config {
    double sigma_range_m = 0.3;         ///< [m]
    double sigma_bearing_rad = 0.05;    ///< [rad]
    double sigma_range_relative = 0.0;  ///< share of the range, as for a camera
    double gate = 0.999;                ///< probability that a good one passes; 1: no gate
  };

  /// Additional settings for a flying body.
  struct InSpace {
    double sensor_up_m = 0.0;           ///< height of the sensor above the body's origin [m]
    double sigma_elevation_rad = 0.02;  ///< where the message has none [rad]
  };

  RangeBearingModel() : RangeBearingModel(Config{}, Pose2{}) {}

  /// `T_body_sensor` is the pose. Throws std::invalid_argument on sigmas that are not finite
  /// and positive (the relative one: not negative), or a mount that is not finite.
  RangeBearingModel(const Config& config, const Pose2& T_body_sensor)
      : RangeBearingModel(config, T_body_sensor, InSpace{}) {}
  RangeBearingModel(const Config& config, const Pose2& T_body_sensor, const InSpace& in_space);

  /// Expected range [m] and bearing [rad].
  [[nodiscard]] Vector<2> predict(const Pose2& T_world_body, const Vector<2>& landmark) const;

  /// Jacobian of range and bearing with respect to (x, y, theta) of T_world_body, 2x3: eq. (1.2).
  /// Empty if the landmark coincides with the sensor (no direction), or range or bearing is
  /// missing.
  [[nodiscard]] std::optional<Linearization<2, 3>> linearize_both(const Pose2& T_world_body,
                                                                  const Vector<2>& landmark,
                                                                  const RangeBearing& z) const {
    const std::optional<Observation> seen = look(T_world_body, landmark);
    if (!seen || !z.range || !z.bearing) {
      return std::nullopt;
    }
    return Linearization<2, 3>{residual(*seen, z), seen->by_pose, noise(z)};
  }

  /// Linearization of any observation, with one or two rows.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 3, 2>> linearize(
      const Pose2& T_world_body, const Vector<2>& landmark, const RangeBearing& z) const;

  /// Linearization with respect to (x, y, theta) and (x, y) of the landmark, five columns: eq.
  /// (1.3).
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 5, 2>> linearize_with_landmark(
      const Pose2& T_world_body, const Vector<2>& landmark, const RangeBearing& z) const;

  /// Linearization for a sensor with `errors`, on a body that moves by `rate` per second in its own
  /// frame: with respect to (x, y, theta) and the errors, x, y and heading of the mount first; eq.
  /// (1.5) to (1.7).
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 3 + LandmarkErrors::kCount, 2>>
  linearize_with_errors(const Pose2& T_world_body, const Vector<2>& landmark, const RangeBearing& z,
                        const LandmarkErrors& errors, const Pose2& rate) const;

  /// Expected range [m], bearing and elevation [rad] of a landmark (x, y, z) from a body at a
  /// height above z = 0 [m].
  [[nodiscard]] Vector<3> predict(const Pose2& T_world_body, double height,
                                  const Vector<3>& landmark) const;

  /// Linearization of any observation from there, with one to three rows, with respect to (x, y,
  /// theta) and the height: eq. (1.9). Empty also if the landmark is straight above or below the
  /// sensor.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 4, 3>> linearize(
      const Pose2& T_world_body, double height, const Vector<3>& landmark,
      const RangeBearing& z) const;

  /// Position in world of an observed landmark, with its derivatives with respect to the pose and
  /// to (range, bearing): eq. (1.4).
  struct Placed {
    Vector<2> position;
    Matrix<2, 3> by_pose;
    Matrix<2, 2> by_observation;
  };
  /// Empty if range or bearing is missing.
  [[nodiscard]] std::optional<Placed> place(const Pose2& T_world_body, const RangeBearing& z) const;

  /// R of an observation.
  [[nodiscard]] Matrix<2, 2> noise(const RangeBearing& z) const {
    if (z.covariance) {
      return *z.covariance;
    }
    Matrix<2, 2> covariance = covariance_;
    if (z.range) {
      covariance(0, 0) += relative_variance_ * *z.range * *z.range;
    }
    return covariance;
  }
  [[nodiscard]] const Pose2& T_body_sensor() const { return T_body_sensor_; }

 private:
  struct Observation {
    Vector<2> expected;
    Matrix<2, 3> by_pose;
    Matrix<2, 2> by_landmark;
  };
  [[nodiscard]] std::optional<Observation> look(const Pose2& T_world_body,
                                                const Vector<2>& landmark) const {
    return look(T_world_body, T_body_sensor_, landmark);
  }
  [[nodiscard]] static std::optional<Observation> look(const Pose2& T_world_body,
                                                       const Pose2& T_body_sensor,
                                                       const Vector<2>& landmark) {
    const Pose2 sensor = T_world_body * T_body_sensor;
    const Vector<2> d = landmark - sensor.position();
    const Vector<2> arm = sensor.position() - T_world_body.position();
    const double squared = d.squaredNorm();
    if (!(squared > kMinDistance * kMinDistance)) {
      return std::nullopt;
    }
    const double range = std::sqrt(squared);
    Observation seen;
    seen.expected << range, angle_difference(std::atan2(d.y(), d.x()), sensor.heading);
    seen.by_landmark << d.x() / range, d.y() / range, -d.y() / squared, d.x() / squared;
    seen.by_pose.leftCols<2>() = -seen.by_landmark;
    seen.by_pose.col(2) = seen.by_landmark * Vector<2>(arm.y(), -arm.x()) - Vector<2>(0.0, 1.0);
    return seen;
  }
  [[nodiscard]] static Vector<2> residual(const Observation& seen, const RangeBearing& z) {
    return {z.range.value_or(0.0) - seen.expected.x(),
            angle_difference(z.bearing.value_or(0.0), seen.expected.y())};
  }

  static constexpr double kMinDistance = 1e-9;  // with a direction [m]

  Matrix<2, 2> covariance_;
  double relative_variance_;
  Pose2 T_body_sensor_;
  double sensor_up_;
  double elevation_variance_;
};

}  // namespace locfuse
