// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Heading of the body, h(x) = theta + offset, or course of its antenna, h(x) = theta + beta, where
/// beta is the direction in which the antenna travels in body: section 8 of docs/models/poses.md.
class HeadingModel {
 public:
  struct Config {
    /// What the sensor reads more than the heading: its mount, the declination [rad]
    double offset_rad = 0.0;
    double sigma_rad = 0.1;          ///< of a heading without a sigma of its own [rad]
    double least_sigma_rad = 0.1;    ///< minimum sigma of a heading [rad]
    double min_speed_mps = 0.5;      ///< minimum speed at which a course is fused [m/s]
    double antenna_forward_m = 0.0;  ///< place of the antenna of courses in body [m]
    double antenna_left_m = 0.0;     ///< [m]
    double gate = 0.999;             ///< probability that a good one passes; 1: no gate
  };

  HeadingModel() : HeadingModel(Config{}) {}

  /// Throws std::invalid_argument on a number out of range.
  explicit HeadingModel(const Config& config);

  /// Direction in which the antenna travels in body [rad], for a body that moves at `rate` (m/s,
  /// m/s, rad/s). Empty below min_speed_mps, of the antenna.
  [[nodiscard]] std::optional<double> direction(const Pose2& rate) const;

  /// Jacobian with respect to (x, y, theta) of T_world_body and to the error of the offset, which
  /// is `offset_error` [rad]; a course does not depend on that. Empty for a course below
  /// min_speed_mps.
  [[nodiscard]] std::optional<Linearization<1, 4>> linearize(const Pose2& T_world_body,
                                                             double offset_error, const Heading& z,
                                                             const Pose2& rate) const;

  /// The same of a body that rests and an offset without error.
  [[nodiscard]] std::optional<Linearization<1, 3>> linearize(const Pose2& T_world_body,
                                                             const Heading& z,
                                                             const Pose2& rate = {}) const;

 private:
  Config config_;
};

}  // namespace locfuse
