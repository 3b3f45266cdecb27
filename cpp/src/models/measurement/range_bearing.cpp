// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/range_bearing.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace locfuse {
namespace {

double variance_of(const char* name, double sigma) {
  if (!(sigma > 0.0 && sigma * sigma > 0.0 && std::isfinite(sigma * sigma))) {
    throw std::invalid_argument(std::string("landmark.") + name + " is " + std::to_string(sigma) +
                                ", expected a finite number > 0, its square as well");
  }
  return sigma * sigma;
}

/// Rows of the parts that an observation has.
template <int N>
Linearization<Eigen::Dynamic, N, 2> measured(const Linearization<2, N>& both,
                                             const RangeBearing& z) {
  Linearization<Eigen::Dynamic, N, 2> lin{both.residual, both.jacobian, both.noise};
  if (!z.range || !z.bearing) {
    const int row = z.range ? 0 : 1;
    lin.residual = both.residual.template segment<1>(row);
    lin.jacobian = both.jacobian.row(row);
    lin.noise = both.noise.template block<1, 1>(row, row);
  }
  return lin;
}

}  // namespace

RangeBearingModel::RangeBearingModel(const Config& config, const Pose2& T_body_sensor,
                                     const InSpace& in_space)
    : relative_variance_(config.sigma_range_relative * config.sigma_range_relative),
      T_body_sensor_(T_body_sensor),
      sensor_up_(in_space.sensor_up_m),
      elevation_variance_(variance_of("sigma_elevation_rad", in_space.sigma_elevation_rad)) {
  if (!(std::isfinite(relative_variance_) && config.sigma_range_relative >= 0.0)) {
    throw std::invalid_argument("landmark.sigma_range_relative is " +
                                std::to_string(config.sigma_range_relative) +
                                ", expected a finite number >= 0");
  }
  const double range = variance_of("sigma_range_m", config.sigma_range_m);
  const double bearing = variance_of("sigma_bearing_rad", config.sigma_bearing_rad);
  covariance_ << range, 0.0, 0.0, bearing;  // a throw amid it would leave it half filled
  if (!std::isfinite(T_body_sensor.x + T_body_sensor.y + T_body_sensor.heading + sensor_up_)) {
    throw std::invalid_argument("the sensor of landmarks has a pose in body that is not finite");
  }
}

Vector<2> RangeBearingModel::predict(const Pose2& T_world_body, const Vector<2>& landmark) const {
  const Vector<2> d = inverse(T_world_body * T_body_sensor_).act(landmark);
  return {d.norm(), std::atan2(d.y(), d.x())};
}

std::optional<Linearization<Eigen::Dynamic, 3, 2>> RangeBearingModel::linearize(
    const Pose2& T_world_body, const Vector<2>& landmark, const RangeBearing& z) const {
  const std::optional<Observation> seen = look(T_world_body, landmark);
  if (!seen || (!z.range && !z.bearing)) {
    return std::nullopt;
  }
  return measured<3>({residual(*seen, z), seen->by_pose, noise(z)}, z);
}

std::optional<Linearization<Eigen::Dynamic, 5, 2>> RangeBearingModel::linearize_with_landmark(
    const Pose2& T_world_body, const Vector<2>& landmark, const RangeBearing& z) const {
  const std::optional<Observation> seen = look(T_world_body, landmark);
  if (!seen || (!z.range && !z.bearing)) {
    return std::nullopt;
  }
  Matrix<2, 5> jacobian;
  jacobian << seen->by_pose, seen->by_landmark;
  return measured<5>({residual(*seen, z), jacobian, noise(z)}, z);
}

std::optional<Linearization<Eigen::Dynamic, 3 + LandmarkErrors::kCount, 2>>
RangeBearingModel::linearize_with_errors(const Pose2& T_world_body, const Vector<2>& landmark,
                                         const RangeBearing& z, const LandmarkErrors& errors,
                                         const Pose2& rate) const {
  const Pose2 then = T_world_body * arc(-errors.delay * rate.x, -errors.delay * rate.y,
                                        -errors.delay * rate.heading);
  const Pose2 mount{T_body_sensor_.x + errors.mount.x, T_body_sensor_.y + errors.mount.y,
                    T_body_sensor_.heading + errors.mount.heading};
  std::optional<Observation> seen = look(then, mount, landmark);
  if (!seen || (!z.range && !z.bearing)) {
    return std::nullopt;
  }
  const double distance = seen->expected.x();
  const double slope = 1.0 + errors.range_scale;
  seen->expected.x() = slope * distance + errors.range_offset;
  seen->by_pose.row(0) *= slope;

  const Vector<2> back = then.position() - T_world_body.position();
  const Vector<2> velocity = Pose2{0.0, 0.0, then.heading}.act({rate.x, rate.y});
  Matrix<2, 2> axes;  // of the body, in world
  axes << std::cos(then.heading), -std::sin(then.heading), std::sin(then.heading),
      std::cos(then.heading);
  Matrix<2, 3 + LandmarkErrors::kCount> jacobian;
  jacobian.leftCols<3>() = seen->by_pose;
  jacobian.col(2) += seen->by_pose.leftCols<2>() * Vector<2>(-back.y(), back.x());
  jacobian.middleCols<2>(3) = seen->by_pose.leftCols<2>() * axes;
  jacobian.col(5) << 0.0, -1.0;
  jacobian.col(6) << 1.0, 0.0;
  jacobian.col(7) << distance, 0.0;
  jacobian.col(8) = -seen->by_pose * Vector<3>(velocity.x(), velocity.y(), rate.heading);
  return measured<3 + LandmarkErrors::kCount>({residual(*seen, z), jacobian, noise(z)}, z);
}

Vector<3> RangeBearingModel::predict(const Pose2& T_world_body, double height,
                                     const Vector<3>& landmark) const {
  const Vector<2> planar = predict(T_world_body, landmark.head<2>());
  const double up = landmark.z() - (height + sensor_up_);
  return {std::hypot(planar.x(), up), planar.y(), std::atan2(up, planar.x())};
}

std::optional<Linearization<Eigen::Dynamic, 4, 3>> RangeBearingModel::linearize(
    const Pose2& T_world_body, double height, const Vector<3>& landmark,
    const RangeBearing& z) const {
  const std::optional<Observation> planar = look(T_world_body, landmark.head<2>());
  if (!planar) {
    return std::nullopt;
  }
  const double along = planar->expected.x();
  const double up = landmark.z() - (height + sensor_up_);
  const double range = std::sqrt(along * along + up * up);
  const Matrix<1, 3> along_by_pose = planar->by_pose.row(0);
  const Vector<3> residual(z.range.value_or(0.0) - range,
                           angle_difference(z.bearing.value_or(0.0), planar->expected.y()),
                           z.elevation.value_or(0.0) - std::atan2(up, along));
  Matrix<3, 4> jacobian;
  jacobian << (along / range) * along_by_pose, -up / range,  //
      planar->by_pose.row(1), 0.0,                           //
      (-up / (range * range)) * along_by_pose, -along / (range * range);
  Matrix<3, 3> R = Matrix<3, 3>::Zero();
  R.topLeftCorner<2, 2>() = noise(z);
  R(2, 2) = z.sigma_elevation ? *z.sigma_elevation * *z.sigma_elevation : elevation_variance_;
  std::vector<int> rows;
  for (const auto& [measured, row] : {std::pair(z.range.has_value(), 0),
                                      {z.bearing.has_value(), 1},
                                      {z.elevation.has_value(), 2}}) {
    if (measured) {
      rows.push_back(row);
    }
  }
  if (rows.empty()) {
    return std::nullopt;
  }
  return Linearization<Eigen::Dynamic, 4, 3>{residual(rows), jacobian(rows, Eigen::all),
                                             R(rows, rows)};
}

std::optional<RangeBearingModel::Placed> RangeBearingModel::place(const Pose2& T_world_body,
                                                                  const RangeBearing& z) const {
  if (!z.range || !z.bearing) {
    return std::nullopt;
  }
  const Pose2 sensor = T_world_body * T_body_sensor_;
  const double c = std::cos(sensor.heading + *z.bearing);
  const double s = std::sin(sensor.heading + *z.bearing);
  Placed placed;
  placed.position = sensor.position() + *z.range * Vector<2>(c, s);
  const Vector<2> arm = placed.position - T_world_body.position();
  placed.by_pose << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
  placed.by_observation << c, -*z.range * s, s, *z.range * c;
  return placed;
}

}  // namespace locfuse
