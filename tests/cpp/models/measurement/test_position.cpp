// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/models/measurement/position.hpp"
#include "support/jacobian.hpp"

namespace locfuse::test_position {
namespace {

using testing::expect_near;
using testing::expect_refused;

TEST(PositionModel, equals_values_computed_by_hand) {
  const PositionModel model({2.0, 1.0});
  const Pose2 pose{10.0, 20.0, kPi / 2.0};  // antenna at (10 - 1, 20 + 2)
  const Matrix<2, 2> R = (Matrix<2, 2>() << 0.5, 0.1, 0.1, 0.4).finished();
  const auto lin = *model.linearize(pose, {0, {9.25, 21.5}, R});
  expect_near(model.predict(pose), Vector<2>(9.0, 22.0), 1e-14);
  expect_near(lin.residual, Vector<2>(0.25, -0.5), 1e-14);
  expect_near(lin.jacobian, (Matrix<2, 3>() << 1.0, 0.0, -2.0, 0.0, 1.0, -1.0).finished(), 1e-14);
  EXPECT_EQ(lin.noise, R);
}

TEST(PositionModel, jacobian_matches_differences_with_and_without_a_lever_arm) {
  const PositionFix z{0, {1.0, 2.0}, Matrix<2, 2>::Identity()};
  for (const PositionModel& model : {PositionModel(), PositionModel({0.7, -0.4})}) {
    for (const Pose2& pose : testing::poses_to_try()) {
      const auto h = [&](const Pose2& p) { return model.predict(p); };
      testing::expect_jacobian<2>(model.linearize(pose, z)->jacobian, h, pose);
    }
  }
}

TEST(PositionModel, does_not_observe_the_heading_without_a_lever_arm) {
  const auto lin =
      *PositionModel().linearize({1.0, 2.0, 0.7}, {0, {1.0, 2.0}, Matrix<2, 2>::Identity()});
  EXPECT_EQ(lin.jacobian(0, 2), 0.0);
  EXPECT_EQ(lin.jacobian(1, 2), 0.0);
}

const std::vector<Tag> kTags = {{4, {2.0, 1.0, 0.7}}, {-1, {0.0, -3.0, 0.1}}};

TEST(PositionModel, a_tag_has_its_own_lever_arm) {
  const PositionModel model({5.0, 5.0}, kTags);
  const PositionModel antenna({2.0, 1.0});
  const Pose2 pose{10.0, 20.0, kPi / 2.0};
  const PositionFix z{0, {9.25, 21.5}, Matrix<2, 2>::Identity(), 4};
  const auto lin = model.linearize(pose, z);
  const auto same = antenna.linearize(pose, {0, z.position, z.covariance});
  EXPECT_EQ(lin->residual, same->residual);
  EXPECT_EQ(lin->jacobian, same->jacobian);
  expect_near(*model.predict(pose, -1), Vector<2>(13.0, 20.0), 1e-14);
  for (const Pose2& other : testing::poses_to_try()) {
    const auto h = [&](const Pose2& p) { return *model.predict(p, 4); };
    testing::expect_jacobian<2>(model.linearize(other, z)->jacobian, h, other);
  }
}

TEST(PositionModel, is_empty_for_an_unknown_tag) {
  const PositionModel model({}, kTags);
  EXPECT_FALSE(model.linearize({}, {0, {1.0, 2.0}, Matrix<2, 2>::Identity(), 3}));
  EXPECT_FALSE(model.predict({}, 3));
}

TEST(PositionModel, of_a_point_is_the_point) {
  const Matrix<2, 2> R = (Matrix<2, 2>() << 0.5, 0.1, 0.1, 0.4).finished();
  const auto lin = *PositionModel().linearize_point({1.0, 2.0}, {0, {1.25, 1.5}, R, 4});
  expect_near(lin.residual, Vector<2>(0.25, -0.5), 1e-14);
  EXPECT_EQ(lin.jacobian, (Matrix<2, 2>::Identity()));
  EXPECT_EQ(lin.noise, R);
}

TEST(PositionModel, rejects_tags_given_twice_or_without_a_position) {
  expect_refused([] { (void)PositionModel({}, {{1}, {2}, {1}}); }, "tag 1", "twice");
  expect_refused(
      [] {
        (void)PositionModel({}, {{7, {std::nan(""), 0.0, 0.0}}});
      },
      "tag 7", "finite");
}

TEST(PositionModel, rejects_a_lever_arm_that_is_not_finite) {
  expect_refused([] { (void)PositionModel({std::nan(""), 0.0}); }, "antenna_forward_m");
  expect_refused([] { (void)PositionModel({0.0, std::nan("")}); }, "antenna_left_m");
}

}  // namespace
}  // namespace locfuse::test_position
