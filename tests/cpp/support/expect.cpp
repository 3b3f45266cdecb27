// SPDX-License-Identifier: Apache-2.0
#include "support/expect.hpp"

#include <Eigen/Eigenvalues>

namespace locfuse::testing {

void expect_pose_near(const Pose2& actual, const Pose2& expected, double tolerance) {
  EXPECT_NEAR(actual.x, expected.x, tolerance);
  EXPECT_NEAR(actual.y, expected.y, tolerance);
  EXPECT_NEAR(angle_difference(actual.heading, expected.heading), 0.0, tolerance);
  EXPECT_GE(actual.heading, -kPi);
  EXPECT_LT(actual.heading, kPi);
}

void expect_near(const Eigen::MatrixXd& actual, const Eigen::MatrixXd& expected, double tolerance) {
  ASSERT_EQ(actual.rows(), expected.rows());
  ASSERT_EQ(actual.cols(), expected.cols());
  const double difference = (actual - expected).cwiseAbs().maxCoeff();
  EXPECT_TRUE(difference <= tolerance) << "differs by " << difference << ", actual\n"
                                       << actual << "\nexpected\n"
                                       << expected;
}

bool is_covariance(const Eigen::MatrixXd& P) {
  return same_bits(P, P.transpose()) &&
         Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(P, Eigen::EigenvaluesOnly)
                 .eigenvalues()
                 .minCoeff() > 0.0;
}

}  // namespace locfuse::testing
