// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/tags.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/math/noise_kind.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/messages/reported_covariance.hpp"

namespace locfuse {

/// Position of an antenna or a tag on the body: h(x) = p + R(theta) lever;
/// docs/models/poses.md.
class PositionModel {
 public:
  struct Config {
    double antenna_forward_m = 0.0;  ///< antenna in body [m]
    double antenna_left_m = 0.0;
    double sigma_m = 0.0;         ///< of a fix without a reported covariance [m]; 0: not used
    double least_sigma_m = 1e-3;  ///< minimum sigma of a fix [m]
    double gate = 0.999;          ///< probability that a good one passes; 1: no gate
    NoiseKind noise = NoiseKind::kGaussian;  ///< distribution of their noise
  };

  PositionModel() = default;

  /// Throws std::invalid_argument if a lever arm is not finite, a sigma out of range or a tag is
  /// given twice.
  explicit PositionModel(const Config& config, std::vector<Tag> tags = {});

  /// Lever arm of a fix in body [m]: of its tag, or without one of the antenna. Empty if the tag is
  /// unknown.
  [[nodiscard]] std::optional<Vector<2>> lever(const std::optional<Id>& tag) const {
    if (!tag) {
      return antenna_in_body_;
    }
    const Tag* known = tags_.find(*tag);
    return known != nullptr ? std::optional<Vector<2>>(known->position.head<2>()) : std::nullopt;
  }

  /// Expected measurement [m] of the antenna, or of a tag; empty if the tag is unknown.
  [[nodiscard]] Vector<2> predict(const Pose2& T_world_body) const {
    return T_world_body.act(antenna_in_body_);
  }
  [[nodiscard]] std::optional<Vector<2>> predict(const Pose2& T_world_body, Id tag) const {
    const std::optional<Vector<2>> arm = lever(tag);
    return arm ? std::optional(T_world_body.act(*arm)) : std::nullopt;
  }

  /// Measured axes of a fix, and R of them.
  [[nodiscard]] ReportedNoise<2> noise(const PositionFix& z) const {
    return reported_noise<2>(z.covariance, Vector<2>::Constant(config_.sigma_m),
                             Vector<2>::Constant(config_.least_sigma_m));
  }

  /// Jacobian with respect to (x, y, theta) of T_world_body, one row per measured axis. Empty if
  /// there are none, or the tag is unknown.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 3, 2>> linearize(
      const Pose2& T_world_body, const PositionFix& z) const {
    const std::optional<Vector<2>> in_body = lever(z.tag);
    if (!in_body) {
      return std::nullopt;
    }
    const Vector<2> expected = T_world_body.act(*in_body);
    const Vector<2> arm = expected - T_world_body.position();
    Matrix<2, 3> jacobian;
    jacobian << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
    return measured_rows<2, 3>(z.position - expected, jacobian, noise(z));
  }

  /// Linearization for a point that is itself a variable: with respect to its position in world,
  /// 2 columns.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 2, 2>> linearize_point(
      const Vector<2>& point, const PositionFix& z) const {
    return measured_rows<2, 2>(z.position - point, Matrix<2, 2>::Identity(), noise(z));
  }

  [[nodiscard]] const std::vector<Tag>& tags() const { return tags_.all(); }

 private:
  Config config_;
  Vector<2> antenna_in_body_ = Vector<2>::Zero();
  Tags tags_;
};

}  // namespace locfuse
