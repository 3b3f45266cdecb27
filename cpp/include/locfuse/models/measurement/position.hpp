// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/tags.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Position of an antenna on the body, or of one of its tags: h(x) = p + R(theta) lever;
/// docs/models/position.md.
class PositionModel {
 public:
  struct Config {
    double antenna_forward_m = 0.0;  ///< antenna in body [m]
    double antenna_left_m = 0.0;
  };

  PositionModel() = default;

  /// Throws std::invalid_argument if a lever arm is not finite or a tag is given twice.
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

  /// Jacobian with respect to (x, y, theta) of T_world_body, 2x3. Empty if the tag is unknown.
  [[nodiscard]] std::optional<Linearization<2, 3>> linearize(const Pose2& T_world_body,
                                                             const PositionFix& z) const {
    const std::optional<Vector<2>> in_body = lever(z.tag);
    if (!in_body) {
      return std::nullopt;
    }
    const Vector<2> expected = T_world_body.act(*in_body);
    const Vector<2> arm = expected - T_world_body.position();
    Linearization<2, 3> lin;
    lin.residual = z.position - expected;
    lin.jacobian << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
    lin.noise = z.covariance;
    return lin;
  }

  /// Of a point that is itself a variable: with respect to its place in world, 2x2.
  [[nodiscard]] static Linearization<2, 2> linearize_point(const Vector<2>& point,
                                                           const PositionFix& z) {
    return {z.position - point, Matrix<2, 2>::Identity(), z.covariance};
  }

 private:
  Vector<2> antenna_in_body_ = Vector<2>::Zero();
  Tags tags_;
};

}  // namespace locfuse
