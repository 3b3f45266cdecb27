// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/math/noise_kind.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/messages/reported_covariance.hpp"

namespace locfuse {

/// Pose from another localizer, h(x) = x (ekim2020 eq. 11); docs/models/poses.md.
class PoseModel {
 public:
  struct Config {
    double sigma_m = 0.0;            ///< of a pose without a reported covariance [m]; 0: not used
    double sigma_heading_rad = 0.0;  ///< of its heading [rad]
    double least_sigma_m = 1e-3;     ///< minimum sigma of a pose [m]
    double least_sigma_heading_rad = 1e-4;  ///< minimum sigma of its heading [rad]
    /// Whether the localizer goes by the odometry that the filter goes by, so that its stamps are
    /// as late: a PoseEkf does not learn how late they are then.
    bool shares_odometry = false;
    double gate = 0.999;                     ///< probability that a good one passes; 1: no gate
    NoiseKind noise = NoiseKind::kGaussian;  ///< distribution of their noise
  };

  PoseModel() : PoseModel(Config{}) {}

  /// Throws std::invalid_argument on a sigma out of range.
  explicit PoseModel(const Config& config)
      : unknown_(config.sigma_m, config.sigma_m, config.sigma_heading_rad),
        min_sigma_(config.least_sigma_m, config.least_sigma_m, config.least_sigma_heading_rad) {
    check_unknown_sigma("pose.sigma_m", config.sigma_m);
    check_unknown_sigma("pose.sigma_heading_rad", config.sigma_heading_rad);
    check_min_sigma("pose.least_sigma_m", config.least_sigma_m);
    check_min_sigma("pose.least_sigma_heading_rad", config.least_sigma_heading_rad);
  }

  /// Expected measurement.
  [[nodiscard]] Pose2 predict(const Pose2& T_world_body) const { return T_world_body; }

  /// Measured axes of a pose, and R of them.
  [[nodiscard]] ReportedNoise<3> noise(const PoseObservation& z) const {
    return reported_noise<3>(z.covariance, unknown_, min_sigma_);
  }

  /// Jacobian with respect to (x, y, theta) of T_world_body: rows of the identity for the measured
  /// axes. Empty if there are none.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 3, 3>> linearize(
      const Pose2& T_world_body, const PoseObservation& z) const {
    return measured_rows<3, 3>(local(z.pose, T_world_body), Matrix<3, 3>::Identity(), noise(z));
  }

 private:
  Vector<3> unknown_;
  Vector<3> min_sigma_;
};

}  // namespace locfuse
