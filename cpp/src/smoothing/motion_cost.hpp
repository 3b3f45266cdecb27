// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <cmath>

#include "locfuse/geometry/pose2.hpp"

namespace locfuse::internal {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// Pose of a solver's variables: x, y, and a heading that is not wrapped.
[[nodiscard]] inline Pose2 pose_of(const double* x) { return {x[0], x[1], wrap_angle(x[2])}; }

/// How a pose lies to another: docs/smoothing.md eq. (2).
class MotionCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  /// `whiten` takes errors in the axes of the first pose to sigmas.
  MotionCost(const Pose2& motion, const Matrix<3, 3>& whiten) : motion_(motion), whiten_(whiten) {}

  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    const double c = std::cos(x[0][2]);
    const double s = std::sin(x[0][2]);
    const Vector<2> d(x[1][0] - x[0][0], x[1][1] - x[0][1]);
    const Vector<2> moved(c * d.x() + s * d.y(), -s * d.x() + c * d.y());
    Eigen::Map<Vector<3>> residual(residuals);
    residual = whiten_ * Vector<3>(moved.x() - motion_.x, moved.y() - motion_.y,
                                   wrap_angle(x[1][2] - x[0][2] - motion_.heading));
    if (jacobians != nullptr) {
      Matrix<3, 3> turned;
      turned << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
      if (jacobians[0] != nullptr) {
        Matrix<3, 3> by_first = -turned;
        by_first(0, 2) = moved.y();
        by_first(1, 2) = -moved.x();
        Eigen::Map<RowMajor3> jacobian(jacobians[0]);
        jacobian = whiten_ * by_first;
      }
      if (jacobians[1] != nullptr) {
        Eigen::Map<RowMajor3> jacobian(jacobians[1]);
        jacobian = whiten_ * turned;
      }
    }
    return true;
  }

 private:
  Pose2 motion_;
  Matrix<3, 3> whiten_;
};

}  // namespace locfuse::internal
