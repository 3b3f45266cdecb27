// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/filters/belief.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_belief {
namespace {

using testing::expect_near;
using testing::expect_pose_near;
using testing::expect_refused;
using testing::same_bits;

const Matrix<2, 2> kI2 = Matrix<2, 2>::Identity();
const Matrix<3, 3> kI3 = Matrix<3, 3>::Identity();

GaussianBelief body_and_two_points() {
  GaussianBelief belief = GaussianBelief::of_pose(5, {1.0, 2.0, 3.0}, kI3);
  belief.add("left", SlotKind::kPoint2, Vector<2>(4.0, 5.0), 2.0 * kI2);
  belief.add("right", SlotKind::kPoint2, Vector<2>(6.0, 7.0), 3.0 * kI2);
  return belief;
}

TEST(GaussianBelief, of_a_pose_has_one_slot_named_body) {
  const GaussianBelief belief = GaussianBelief::of_pose(5, {1.0, 2.0, 3.0 + 2.0 * kPi}, 2.0 * kI3);
  EXPECT_EQ(belief.stamp, 5);
  EXPECT_EQ(belief.dimension(), 3);
  EXPECT_EQ(belief.offset(belief.slot("body")), 0);
  expect_pose_near(belief.pose(belief.slot("body")), {1.0, 2.0, 3.0}, 1e-14);
  EXPECT_EQ(belief.P, Eigen::MatrixXd(2.0 * kI3));
  EXPECT_EQ(belief.angle_rows(), std::vector<int>{2});
}

// The covariance of a position by ranges, turned by a lever arm, was symmetric but for rounding,
// and a start by it stayed so until the first update.
TEST(GaussianBelief, a_covariance_that_is_symmetric_but_for_rounding_becomes_so_to_the_bit) {
  Matrix<3, 3> P = 2.0 * kI3;
  P(0, 1) = 0.1;
  P(1, 0) = std::nextafter(0.1, 1.0);
  GaussianBelief belief = GaussianBelief::of_pose(0, {}, P);
  belief.add("second", SlotKind::kPose2, Vector<3>::Zero(), P);
  EXPECT_TRUE(testing::is_covariance(belief.P));
}

TEST(GaussianBelief, adds_a_variable_without_correlation) {
  GaussianBelief belief = GaussianBelief::of_pose(0, {1.0, 2.0, 3.0}, 2.0 * kI3);
  const Slot second = belief.add("second", SlotKind::kPose2, Vector<3>(4.0, 5.0, 7.0), 3.0 * kI3);
  EXPECT_EQ(belief.dimension(), 6);
  expect_pose_near(belief.pose(second), {4.0, 5.0, 7.0 - 2.0 * kPi}, 1e-14);
  EXPECT_EQ(belief.P.topRightCorner(3, 3), Eigen::MatrixXd::Zero(3, 3));
  EXPECT_EQ(belief.P.bottomLeftCorner(3, 3), Eigen::MatrixXd::Zero(3, 3));
  EXPECT_EQ(belief.marginal(second), Eigen::MatrixXd(3.0 * kI3));
  EXPECT_EQ(belief.angle_rows(), (std::vector<int>{2, 5}));
}

TEST(GaussianBelief, removing_a_variable_keeps_the_handles_of_the_others) {
  GaussianBelief belief = body_and_two_points();
  testing::Rng rng(1);
  belief.P = testing::random_covariance(rng, 7);
  const GaussianBelief before = belief;
  const Slot left = belief.slot("left");
  const Slot right = belief.slot("right");
  belief.remove(left);
  EXPECT_EQ(belief.dimension(), 5);
  EXPECT_EQ(belief.offset(right), 3);
  EXPECT_EQ(belief.mean(right), before.mean(right));
  const std::vector<Slot> kept = {belief.slot("body"), right};
  EXPECT_EQ(belief.marginal(kept), before.marginal(kept));
  expect_refused([&] { (void)belief.offset(left); }, "slot 1");

  const Slot again = belief.add("left", SlotKind::kPoint2, Vector<2>(8.0, 9.0), kI2);
  EXPECT_EQ(belief.offset(right), 3);
  EXPECT_EQ(belief.offset(again), 5);
  expect_refused([&] { (void)belief.offset(left); }, "slot 1");
}

TEST(GaussianBelief, finds_variables_after_others_came_and_went) {
  GaussianBelief belief = body_and_two_points();
  const Slot right = belief.slot("right");
  for (int i = 0; i < 100; ++i) {
    belief.remove(belief.add("guest", SlotKind::kPoint2, Vector<2>(8.0, 9.0), kI2));
  }
  belief.remove(belief.slot("left"));
  const Slot added = belief.add("new", SlotKind::kScalar, Vector<1>(8.0), Matrix<1, 1>(1.0));
  EXPECT_EQ(belief.offset(right), 3);
  EXPECT_EQ(belief.offset(added), 5);
  EXPECT_EQ(belief.mean(added), Vector<1>(8.0));
  EXPECT_EQ(belief.slot("new").id, added.id);
  expect_refused([&] { (void)belief.offset(Slot{added.id - 1}); }, "is not in this belief");
  expect_refused([&] { (void)belief.offset(Slot{added.id + 1}); }, "is not in this belief");
}

TEST(GaussianBelief, removing_the_pose_moves_angle_rows) {
  GaussianBelief belief = body_and_two_points();
  belief.add("second", SlotKind::kPose2, Vector<3>(0.0, 0.0, 0.0), kI3);
  EXPECT_EQ(belief.angle_rows(), (std::vector<int>{2, 9}));
  belief.remove(belief.slot("body"));
  EXPECT_EQ(belief.angle_rows(), std::vector<int>{6});
}

TEST(GaussianBelief, gives_variables_in_the_order_asked_for) {
  GaussianBelief belief = body_and_two_points();
  testing::Rng rng(2);
  belief.P = testing::random_covariance(rng, 7);
  const std::vector<Slot> slots = {belief.slot("right"), belief.slot("body")};
  EXPECT_EQ(belief.rows(slots), (std::vector<int>{5, 6, 0, 1, 2}));
  expect_near(belief.mean(slots), (Vector<5>() << 6.0, 7.0, 1.0, 2.0, 3.0).finished(), 0.0);
  const Eigen::MatrixXd marginal = belief.marginal(slots);
  EXPECT_EQ(marginal(0, 2), belief.P(5, 0));
  EXPECT_EQ(marginal(4, 1), belief.P(2, 6));
}

TEST(GaussianBelief, a_wrong_name_is_answered_with_the_names_there_are) {
  GaussianBelief belief = body_and_two_points();
  belief.remove(belief.slot("left"));
  try {
    (void)belief.slot("bodi");
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "no slot 'bodi'; there are: body, right");
  }
}

TEST(GaussianBelief, refuses_handles_it_never_gave) {
  const GaussianBelief belief = body_and_two_points();
  for (const int id : {-1, 3, 1000}) {
    expect_refused([&] { (void)belief.offset(Slot{id}); }, "slot " + std::to_string(id));
    expect_refused([&] { (void)belief.kind(Slot{id}); }, "slot " + std::to_string(id));
  }
  expect_refused([&] { (void)belief.pose(belief.slot("left")); }, "not a pose");
}

TEST(GaussianBelief, refuses_to_remove_what_is_not_there) {
  GaussianBelief belief = body_and_two_points();
  const Slot left = belief.slot("left");
  belief.remove(left);
  const GaussianBelief before = belief;
  for (const Slot gone : {left, Slot{3}, Slot{-1}}) {
    expect_refused([&] { belief.remove(gone); }, "slot " + std::to_string(gone.id));
  }
  EXPECT_TRUE(same_bits(belief, before));
  EXPECT_EQ(belief.offset(belief.slot("right")), 3);
}

TEST(GaussianBelief, refuses_what_does_not_fit_and_stays_as_it_was) {
  GaussianBelief belief = body_and_two_points();
  const GaussianBelief before = belief;
  const auto add = [&](const char* name, const Eigen::VectorXd& mean, const Eigen::MatrixXd& P) {
    belief.add(name, SlotKind::kPoint2, mean, P);
  };
  const Vector<2> zero = Vector<2>::Zero();
  Matrix<2, 2> bad = kI2;
  expect_refused([&] { add("left", zero, kI2); }, "'left'", "already");
  expect_refused([&] { add("a", Vector<3>::Zero(), kI2); }, "'a'", "a mean of 3");
  expect_refused([&] { add("a", zero, kI3); }, "'a'", "3 x 3");
  expect_refused([&] { add("a", Vector<2>(std::nan(""), 0.0), kI2); }, "'a'", "nan");
  bad << 1.0, 2.5, 2.5, 1.0;
  expect_refused([&] { add("a", zero, bad); }, "'a'", "2.5");
  bad << 1.0, 0.5, 0.25, 1.0;
  expect_refused([&] { add("a", zero, bad); }, "'a'", "0.25");
  EXPECT_TRUE(same_bits(belief, before));
  expect_refused([&] { (void)belief.slot("a"); }, "left, right");
}

TEST(GaussianBelief, refuses_a_pose_that_is_none) {
  expect_refused([] { (void)GaussianBelief::of_pose(0, {0.0, std::nan(""), 0.0}, kI3); }, "nan");
  expect_refused([] { (void)GaussianBelief::of_pose(0, {}, -kI3); }, "-1");
  expect_refused([] { (void)GaussianBelief::of_pose(0, {}, Matrix<3, 3>::Zero()); }, "body");
}

TEST(GaussianBelief, a_copy_is_a_snapshot) {
  GaussianBelief belief = body_and_two_points();
  const GaussianBelief snapshot = belief;
  belief.remove(belief.slot("body"));
  belief.x(0) = 99.0;
  EXPECT_EQ(snapshot.dimension(), 7);
  EXPECT_EQ(snapshot.offset(snapshot.slot("left")), 3);
  EXPECT_EQ(snapshot.mean(snapshot.slot("left"))(0), 4.0);
}

TEST(GaussianBelief, refuses_variances_without_a_square) {
  testing::expect_refused(
      [] { GaussianBelief::of_pose(0, {}, Vector<3>(1.7e308, 1.0, 1.0).asDiagonal()); },
      "covariance");
}

}  // namespace
}  // namespace locfuse::test_belief
