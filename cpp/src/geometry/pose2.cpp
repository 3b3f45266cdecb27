// SPDX-License-Identifier: Apache-2.0
#include "locfuse/geometry/pose2.hpp"

#include <Eigen/Core>
#include <cmath>

namespace locfuse {

Matrix<3, 3> covariance_after(const Pose2& pose, const Matrix<3, 3>& P, const Pose2& motion,
                              const Matrix<3, 3>& Q) {
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  Matrix<3, 3> F = Matrix<3, 3>::Identity();
  F.topRightCorner<2, 1>() << -(s * motion.x + c * motion.y), c * motion.x - s * motion.y;
  Matrix<3, 3> G = Matrix<3, 3>::Identity();
  G.topLeftCorner<2, 2>() << c, -s, s, c;
  const Matrix<3, 3> sum = F * P * F.transpose() + G * Q * G.transpose();
  return 0.5 * (sum + sum.transpose());
}

}  // namespace locfuse
