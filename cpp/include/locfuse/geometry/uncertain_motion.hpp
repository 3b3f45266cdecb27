// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/geometry/pose2.hpp"

namespace locfuse {

/// A motion in the previous body frame with the covariance of (forward, left, heading).
struct UncertainMotion {
  Pose2 motion;
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();
};

}  // namespace locfuse
