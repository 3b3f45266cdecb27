// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/pose.hpp"
#include "support/jacobian.hpp"

namespace locfuse::test_pose {
namespace {

TEST(PoseModel, expects_the_pose_itself) {
  const Pose2 expected = PoseModel().predict({1.0, 2.0, 3.0});
  testing::expect_pose_near(expected, {1.0, 2.0, 3.0}, 0.0);
}

TEST(PoseModel, residual_is_measured_minus_expected_and_wrapped) {
  const Matrix<3, 3> R = Vector<3>(0.1, 0.2, 0.3).asDiagonal();
  const PoseObservation z{0, {1.5, 1.0, kPi - 0.1}, R};
  const auto lin = *PoseModel().linearize({1.0, 2.0, -kPi + 0.1}, z);
  testing::expect_near(lin.residual, Vector<3>(0.5, -1.0, -0.2), 1e-15);
  EXPECT_EQ(lin.noise, R);
}

TEST(PoseModel, jacobian_matches_differences) {
  const PoseObservation z{0, {}, Matrix<3, 3>::Identity()};
  for (const Pose2& pose : testing::poses_to_try()) {
    const auto h = [&](const Pose2& p) { return local(PoseModel().predict(p), pose); };
    testing::expect_jacobian<3>(PoseModel().linearize(pose, z)->jacobian, h, pose);
  }
}

}  // namespace
}  // namespace locfuse::test_pose
