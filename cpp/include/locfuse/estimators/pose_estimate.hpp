// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/types.hpp"
#include "locfuse/time.hpp"

namespace locfuse {

/// A pose at one instant, with the covariance of (x, y, heading).
struct PoseEstimate {
  Stamp stamp = 0;
  Pose2 pose;
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();

  /// The larger half axis of the position's 1-sigma ellipse [m].
  [[nodiscard]] double sigma_position() const {
    const double a = covariance(0, 0);
    const double b = covariance(1, 1);
    return std::sqrt(0.5 * (a + b) + std::hypot(0.5 * (a - b), covariance(0, 1)));
  }
  [[nodiscard]] double sigma_heading() const { return std::sqrt(covariance(2, 2)); }
};

/// A pose hypothesis and its probability among the others.
struct PoseHypothesis {
  PoseEstimate estimate;
  double probability = 0.0;
};

}  // namespace locfuse
