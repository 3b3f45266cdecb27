// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Position of an antenna on the body: h(x) = p + R(theta) antenna; docs/models/position.md.
class PositionModel {
 public:
  struct Config {
    double antenna_forward_m = 0.0;  ///< antenna in body [m]
    double antenna_left_m = 0.0;
  };

  PositionModel() = default;

  /// Throws std::invalid_argument if the lever arm is not finite.
  explicit PositionModel(const Config& config);

  /// Expected measurement [m].
  [[nodiscard]] Vector<2> predict(const Pose2& T_world_body) const {
    return T_world_body.act(antenna_in_body_);
  }

  /// Jacobian with respect to (x, y, theta) of T_world_body, 2x3.
  [[nodiscard]] Linearization<2, 3> linearize(const Pose2& T_world_body,
                                              const PositionFix& z) const {
    const Vector<2> expected = predict(T_world_body);
    const Vector<2> arm = expected - T_world_body.position();
    Linearization<2, 3> lin;
    lin.residual = z.position - expected;
    lin.jacobian << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
    lin.noise = z.covariance;
    return lin;
  }

 private:
  Vector<2> antenna_in_body_ = Vector<2>::Zero();
};

}  // namespace locfuse
