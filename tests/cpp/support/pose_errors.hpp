// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/geometry/pose2.hpp"

namespace locfuse::testing {

/// Errors of estimates against the truth, and how large the estimates say that they are.
struct PoseErrors {
  double squared = 0.0;
  double squared_heading = 0.0;
  double nees = 0.0;
  int count = 0;

  void add(const PoseEstimate& estimate, const Pose2& truth) {
    const Vector<3> e = local(estimate.pose, truth);
    squared += e.head<2>().squaredNorm();
    squared_heading += e.z() * e.z();
    nees += e.dot(estimate.covariance.llt().solve(e));
    ++count;
  }
  [[nodiscard]] double rmse() const { return std::sqrt(squared / count); }
};

}  // namespace locfuse::testing
