// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "locfuse/models/measurement/line.hpp"
#include "support/expect.hpp"
#include "support/jacobian.hpp"

namespace locfuse {
namespace {

using testing::expect_near;

const Line2 kWall{5.0, 0.5 * kPi, {2.0, 5.0}, 3.0};  // y = 5, seen from below

TEST(LineModel, predicts_a_wall_by_hand) {
  const Vector<2> expected = LineModel::predict({1.0, 2.0, 0.25 * kPi}, kWall);
  EXPECT_NEAR(expected.x(), 3.0, 1e-15);
  EXPECT_NEAR(expected.y(), 0.25 * kPi, 1e-15);
  EXPECT_LT(LineModel::predict({1.0, 6.0, 0.0}, kWall).x(), 0.0);
}

TEST(LineModel, jacobian_matches_differences) {
  for (const double alpha : {-kPi, -1.0, 0.3, 2.5}) {
    const Line2 wall{1.3, alpha, {}, 1.0};
    for (const Pose2& pose : testing::poses_to_try()) {
      const Line2 seen{0.0, angle_difference(alpha, pose.heading), {1.0, 0.0}, 1.0};
      const auto lin = LineModel::linearize(pose, wall, seen, Matrix<2, 2>::Identity());
      testing::expect_jacobian<2>(
          -lin.jacobian,
          [&](const Pose2& at) {
            return LineModel::linearize(at, wall, seen, Matrix<2, 2>::Identity()).residual;
          },
          pose);
    }
  }
}

TEST(LineModel, the_residual_wraps) {
  const Line2 seen{3.1, -kPi + 0.01, {}, 1.0};
  const auto lin =
      LineModel::linearize({1.0, 2.0, -0.5 * kPi + 0.03}, kWall, seen, Matrix<2, 2>::Identity());
  expect_near(lin.residual, Vector<2>(0.1, 0.04), 1e-12);
}

/// From 1 to 3 m to the left of the foot, met by four beams whose errors of 0.1 m are independent:
/// the middle is off by 0.05 m, the direction by 0.05 sqrt(3) rad, and r, two metres from the
/// middle, by both.
TEST(LineModel, beams_meet_errors_of_the_map) {
  const Pose2 pose{1.0, 1.0, 0.0};
  const Line2 wall{5.0, 0.0, {5.0, 3.0}, 1.0};
  const Line2 seen{4.0, 0.0, {4.0, 2.0}, 1.0};
  Matrix<2, 2> expected;
  expected << 0.0025 + 4.0 * 0.0075, 2.0 * 0.0075, 2.0 * 0.0075, 0.0075;
  const Matrix<2, 2> scan = 0.001 * Matrix<2, 2>::Identity();
  expect_near(LineModel({0.1}).noise(pose, wall, seen, scan, 4.0), Matrix<2, 2>(expected + scan),
              1e-15);
  expect_near(LineModel({0.0}).noise(pose, wall, seen, scan, 4.0), scan, 0.0);
}

/// Half of what is seen is on the map: two of the beams, on a line half as long, whose middle is
/// three metres from the foot.
TEST(LineModel, a_wall_shorter_than_what_is_seen_says_less_of_the_direction) {
  const Pose2 pose{1.0, 1.0, kPi / 6.0};
  const Line2 wall{5.0, 0.0, {5.0, 4.0}, 0.5};
  const Line2 seen{4.0, -kPi / 6.0, Pose2{0.0, 0.0, -kPi / 6.0}.act({4.0, 2.0}), 1.0};
  const double turn = 3.0 * 0.005 / 0.25;
  Matrix<2, 2> expected;
  expected << 0.005 + 9.0 * turn, 3.0 * turn, 3.0 * turn, turn;
  expect_near(LineModel({0.1}).noise(pose, wall, seen, Matrix<2, 2>::Zero(), 4.0), expected, 1e-12);
}

TEST(LineModel, a_sigma_that_is_none_is_refused) {
  testing::expect_refused([] { LineModel({-0.1}); }, "sigma_wall_m is -0.1");
  testing::expect_refused([] { LineModel({std::nan("")}); }, "sigma_wall_m");
}

}  // namespace
}  // namespace locfuse
