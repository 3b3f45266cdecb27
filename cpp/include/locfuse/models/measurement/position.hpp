// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/tags.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/messages/told_covariance.hpp"

namespace locfuse {

/// Position of an antenna on the body, or of one of its tags: h(x) = p + R(theta) lever;
/// docs/models/position.md.
class PositionModel {
 public:
  struct Config {
    double antenna_forward_m = 0.0;  ///< antenna in body [m]
    double antenna_left_m = 0.0;
    double sigma_m = 0.0;         ///< of a fix without one of its own [m]; 0: it is not modelled
    double least_sigma_m = 1e-3;  ///< of any fix: less is not believed [m]
  };

  PositionModel() = default;

  /// Throws std::invalid_argument if a lever arm is not finite, a sigma out of range or a tag is
  /// given twice.
  explicit PositionModel(const Config& config, std::vector<Tag> tags = {});

  /// Where on the body a fix is taken [m]: at that tag, without one at the antenna. Empty if the
  /// tag is unknown.
  [[nodiscard]] std::optional<Vector<2>> lever(const std::optional<Id>& tag) const {
    if (!tag) {
      return antenna_in_body_;
    }
    const Tag* known = tags_.find(*tag);
    return known != nullptr ? std::optional<Vector<2>>(known->position.head<2>()) : std::nullopt;
  }

  /// Expected measurement [m]: of the antenna, or of a tag; empty if that is unknown.
  [[nodiscard]] Vector<2> predict(const Pose2& T_world_body) const {
    return T_world_body.act(antenna_in_body_);
  }
  [[nodiscard]] std::optional<Vector<2>> predict(const Pose2& T_world_body, Id tag) const {
    const std::optional<Vector<2>> arm = lever(tag);
    return arm ? std::optional(T_world_body.act(*arm)) : std::nullopt;
  }

  /// What is measured of a fix, and R of it.
  [[nodiscard]] ToldNoise<2> noise(const PositionFix& z) const {
    return told_noise<2>(z.covariance, Vector<2>::Constant(config_.sigma_m),
                         Vector<2>::Constant(config_.least_sigma_m));
  }

  /// Jacobian with respect to (x, y, theta) of T_world_body, a row per axis that is measured. Empty
  /// if none is, or the tag is unknown.
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

  /// Of a point that is itself a variable: with respect to its place in world, 2 columns.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, 2, 2>> linearize_point(
      const Vector<2>& point, const PositionFix& z) const {
    return measured_rows<2, 2>(z.position - point, Matrix<2, 2>::Identity(), noise(z));
  }

 private:
  Config config_;
  Vector<2> antenna_in_body_ = Vector<2>::Zero();
  Tags tags_;
};

}  // namespace locfuse
