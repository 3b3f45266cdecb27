// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/messages/told_covariance.hpp"

namespace locfuse {

/// Pose from another localizer, h(x) = x (ekim2020 eq. 11); docs/models/pose.md.
class PoseModel {
 public:
  struct Config {
    double sigma_m = 0.0;                   ///< of a pose without a covariance [m]; 0: not modelled
    double sigma_heading_rad = 0.0;         ///< likewise of its heading [rad]
    double least_sigma_m = 1e-3;            ///< of any pose: less is not believed [m]
    double least_sigma_heading_rad = 1e-4;  ///< likewise [rad]
  };

  PoseModel() : PoseModel(Config{}) {}

  /// Throws std::invalid_argument on a sigma out of range.
  explicit PoseModel(const Config& config)
      : unknown_(config.sigma_m, config.sigma_m, config.sigma_heading_rad),
        least_(config.least_sigma_m, config.least_sigma_m, config.least_sigma_heading_rad) {
    check_told_sigma("pose.sigma_m", config.sigma_m);
    check_told_sigma("pose.sigma_heading_rad", config.sigma_heading_rad);
    check_least_sigma("pose.least_sigma_m", config.least_sigma_m);
    check_least_sigma("pose.least_sigma_heading_rad", config.least_sigma_heading_rad);
  }

  /// Expected measurement.
  [[nodiscard]] Pose2 predict(const Pose2& T_world_body) const { return T_world_body; }

  /// What is measured of a pose, and R of it.
  [[nodiscard]] ToldNoise<3> noise(const PoseObservation& z) const {
    return told_noise<3>(z.covariance, unknown_, least_);
  }

  /// Jacobian with respect to (x, y, theta) of T_world_body: the rows of the identity whose axes
  /// are measured. Empty if none is.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 3, 3>> linearize(
      const Pose2& T_world_body, const PoseObservation& z) const {
    return measured_rows<3, 3>(local(z.pose, T_world_body), Matrix<3, 3>::Identity(), noise(z));
  }

 private:
  Vector<3> unknown_;
  Vector<3> least_;
};

}  // namespace locfuse
