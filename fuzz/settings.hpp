// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/estimators/air_ekf.hpp"
#include "locfuse/estimators/gyro_odometry.hpp"
#include "locfuse/estimators/landmark_ekf.hpp"
#include "locfuse/estimators/tag_triangle_ekf.hpp"
#include "locfuse/frontends/scan_matcher.hpp"
#include "locfuse/frontends/scan_odometry.hpp"
#include "locfuse/frontends/tag_conditioner.hpp"
#include "worlds.hpp"

/// Byte format of the settings of filters and scan matching.
namespace locfuse::fuzz {

template <class Io>
void code_settings(Io& io, OdometryMotion::Config& c) {
  code(io,
       {&c.sigma_longitudinal_per_sqrt_m, &c.sigma_lateral_per_sqrt_m, &c.sigma_heading_per_sqrt_m,
        &c.sigma_heading_per_sqrt_rad, &c.sigma_xy_per_sqrt_s, &c.sigma_heading_per_sqrt_s,
        &c.sigma_longitudinal_per_sqrt_s},
       0.0, 1.0);
}
template <class Io>
void code_settings(Io& io, RangeModel::Config& c) {
  code(io, {&c.sigma_m, &c.sigma_relative}, 0.0, 1.0);
}
template <class Io>
void code_settings(Io& io, PositionModel::Config& c) {
  code(io, {&c.antenna_forward_m, &c.antenna_left_m}, -1.0, 1.0);
  code(io, {&c.sigma_m, &c.least_sigma_m}, 0.0, 3.0);
}
template <class Io>
void code_settings(Io& io, PoseModel::Config& c) {
  code(io, {&c.sigma_m, &c.sigma_heading_rad, &c.least_sigma_m, &c.least_sigma_heading_rad}, 0.0,
       3.0);
}
template <class Io>
void code_settings(Io& io, RangeBearingModel::Config& c) {
  code(io, {&c.sigma_range_m, &c.sigma_bearing_rad, &c.sigma_range_relative}, 0.0, 1.0);
}
template <class Io>
void code_settings(Io& io, Limits& c) {
  code(io, {&c.speed_mps, &c.turn_rate_radps}, 0.0, 100.0);
  code(io, c.range_m, 0.0, 1e4);
  code(io, c.distance_m, 0.0, 2e7);
}
template <class Io>
void code_settings(Io& io, Calibration::Config& c) {
  code(io,
       {&c.sigma_scale, &c.sigma_direction_rad, &c.sigma_turn_scale, &c.sigma_turn_bias_radps,
        &c.sigma_turn_bias_radps_per_sqrt_s, &c.sigma_sensor_m, &c.sigma_sensor_rad,
        &c.sigma_range_offset_m, &c.sigma_range_scale, &c.sigma_delay_s, &c.sigma_anchor_offset_m,
        &c.sigma_anchor_scale, &c.sigma_range_delay_s},
       0.0, 0.5);
  code(io, c.anchor_offset_correlation_s, 0.0, 30.0);
  code(io, c.consider);
}

template <class Io>
void code_settings(Io& io, PoseEkf::Config& c) {
  code_settings(io, c.odometry);
  code_settings(io, c.range);
  code_settings(io, c.position);
  code_settings(io, c.pose);
  code_settings(io, c.landmark);
  code_settings(io, c.calibration);
  code_settings(io, c.limits);
  code(io, {&c.adaptive.messages, &c.adaptive.most}, 0.0, 200.0);
  code(io,
       {&c.adaptive.least, &c.range.gate, &c.position.gate, &c.pose.gate, &c.landmark.gate,
        &c.sigma_lost_xy_per_sqrt_s, &c.sigma_lost_heading_per_sqrt_s},
       0.0, 1.0);
  code(io, c.hold_s, 0.0, 10.0);
}

template <class Io>
void code_settings(Io& io, LandmarkEkf::Config& c) {
  code_settings(io, c.odometry);
  code_settings(io, c.landmark);
  code_settings(io, c.position);
  code_settings(io, c.limits);
  code(io,
       {&c.landmark.gate, &c.position.gate, &c.gate_new, &c.sigma_lost_xy_per_sqrt_s,
        &c.sigma_lost_heading_per_sqrt_s},
       0.0, 1.0);
  code(io, c.min_sightings);
  code(io, {&c.confirm_within_s, &c.hold_s}, 0.0, 10.0);
}

template <class Io>
void code_settings(Io& io, TagTriangleEkf::Config& c) {
  code_settings(io, c.range);
  code_settings(io, c.position);
  code_settings(io, c.limits);
  code(io,
       {&c.motion.sigma_velocity_per_sqrt_s, &c.velocity.sigma_forward_mps,
        &c.velocity.sigma_lateral_mps, &c.velocity.sigma_turn_rate_radps,
        &c.velocity.sigma_point_mps, &c.side.sigma_m, &c.sigma_start_velocity_mps, &c.position.gate,
        &c.velocity.gate, &c.side.gate, &c.range.gate},
       0.0, 1.0);
}

template <class Io>
void code_settings(Io& io, GyroOdometry::Config& c) {
  code_settings(io, c.odometry);
  code(io,
       {&c.sigma_turn_per_sqrt_s, &c.sigma_bias_radps, &c.sigma_bias_radps_per_sqrt_s,
        &c.sigma_scale, &c.sigma_turn_scale},
       0.0, 1.0);
  bool is_average = c.turn == GyroOdometry::Turn::kAverage;
  code(io, is_average);
  c.turn = is_average ? GyroOdometry::Turn::kAverage : GyroOdometry::Turn::kWeighted;
}

template <class Io>
void code_settings(Io& io, TagConditioner::Config& c) {
  code(io,
       {&c.cutoff_hz, &c.bias_x_m, &c.bias_y_m, &c.max_speed_mps, &c.jump_margin_m,
        &c.frozen_motion_m, &c.hold_s},
       0.0, 5.0);
  code(io, c.restart_after);
}

template <class Io>
void code_settings(Io& io, AirEkf::Config& c) {
  code_settings(io, c.odometry);
  code_settings(io, c.range);
  code_settings(io, c.position);
  code_settings(io, c.pose);
  code_settings(io, c.landmark);
  code_settings(io, c.limits);
  code(io, {&c.altitude.altimeter_up_m, &c.landmark_in_space.sensor_up_m}, -1.0, 1.0);
  code(io,
       {&c.landmark_in_space.sigma_elevation_rad,
        &c.constant_velocity.sigma_velocity_per_sqrt_s,
        &c.constant_velocity.sigma_climb_per_sqrt_s,
        &c.constant_velocity.sigma_heading_per_sqrt_s,
        &c.sigma_height_per_sqrt_s,
        &c.sigma_start_velocity_mps,
        &c.sigma_start_climb_mps,
        &c.range.gate,
        &c.position.gate,
        &c.pose.gate,
        &c.altitude.gate,
        &c.landmark.gate,
        &c.sigma_lost_xy_per_sqrt_s,
        &c.sigma_lost_heading_per_sqrt_s,
        &c.sigma_lost_height_per_sqrt_s,
        &c.inertial.sigma_turn_per_sqrt_s,
        &c.inertial.sigma_velocity_per_sqrt_s,
        &c.inertial.sigma_bias_radps,
        &c.inertial.sigma_bias_mps2,
        &c.inertial.sigma_scale},
       0.0, 1.0);
  for (double& angle : c.inertial.mount) {
    code(io, angle, -4.0, 4.0);
  }
  code_noise(io, c);
  code(io, c.hold_s, 0.0, 10.0);
}

template <class Io>
void code_settings(Io& io, ScanMatcherConfig& c) {
  code(io,
       {&c.sigma_range_m, &c.outlier_share, &c.no_return_share, &c.wrong_probability,
        &c.min_explained},
       0.0, 1.0);
  code(io, c.max_hypotheses);
  code(io, c.max_iterations);
  code(io, c.exact_neighbours);
}
template <class Io>
void code_settings(Io& io, ScanOdometryConfig& c) {
  code(io, {&c.map.sigma_range_m, &c.map.trimmed_share, &c.map.min_explained}, 0.0, 1.0);
  code(io,
       {&c.map.max_distance_m, &c.window_m, &c.key_distance_m, &c.key_turn_rad, &c.least_sigma_m,
        &c.least_sigma_rad},
       0.0, 10.0);
  code(io, c.map.max_iterations);
  code(io, c.window_scans);
}

}  // namespace locfuse::fuzz
