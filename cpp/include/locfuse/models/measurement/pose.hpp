// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Pose from another localizer, h(x) = x (ekim2020 eq. 11); docs/models/pose.md.
class PoseModel {
 public:
  /// Expected measurement.
  [[nodiscard]] Pose2 predict(const Pose2& T_world_body) const { return T_world_body; }

  /// Jacobian with respect to (x, y, theta) of T_world_body: the identity.
  [[nodiscard]] Linearization<3, 3> linearize(const Pose2& T_world_body,
                                              const PoseObservation& z) const {
    return {local(z.pose, T_world_body), Matrix<3, 3>::Identity(), z.covariance};
  }
};

}  // namespace locfuse
