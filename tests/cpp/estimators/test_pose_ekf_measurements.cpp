// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/recovery/initializer.hpp"
#include "support/expect.hpp"
#include "support/linear_kalman.hpp"
#include "support/robot.hpp"

namespace locfuse::test_pose_ekf_measurements {
namespace {

using testing::ekf_at;
using testing::expect_near;
using testing::expect_pose_near;
using testing::kSecond;
using testing::linear_kalman;
using testing::LinearKalman;
using testing::range_to;

const Pose2 kStart{1.0, 2.0, 0.5};
using AnyRows = Linearization<Eigen::Dynamic, 3>;

void expect_textbook(const PoseEkf& after, const GaussianBelief& before, const AnyRows& lin) {
  const LinearKalman expected =
      linear_kalman(before.x, before.P, lin.residual, lin.jacobian, lin.noise);
  expect_near(after.belief().x, expected.x, 1e-14);
  expect_near(after.belief().P, expected.P, 1e-15);
}

TEST(PoseEkf, a_range_pulls_as_the_textbook_says) {
  PoseEkf ekf = ekf_at(kStart);
  const Range z = range_to(1, kStart, 0, 0.2);
  const GaussianBelief before = ekf.belief();
  const Linearization<1, 3> lin = *ekf.range_model().linearize(kStart, z);
  const Outcome outcome = ekf.on(z);
  EXPECT_EQ(outcome.verdict, Verdict::kFused);
  EXPECT_EQ(outcome.dof, 1);
  EXPECT_NEAR(outcome.residual, 0.2, 1e-14);
  expect_textbook(ekf, before, {lin.residual, lin.jacobian, lin.noise});
}

TEST(PoseEkf, each_range_of_an_epoch_is_linearized_where_the_one_before_led) {
  PoseEkf ekf({}, {testing::hall(), testing::one_tag()},
              {0, kStart, Matrix<3, 3>(Vector<3>(4.0, 4.0, 0.1).asDiagonal())});
  for (const Id anchor : {0, 1, 2, 3}) {
    const Range z = range_to(anchor, {2.0, 0.5, 0.3}, 0);
    const GaussianBelief before = ekf.belief();
    const Linearization<1, 3> lin = *ekf.range_model().linearize(ekf.pose(), z);
    ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
    expect_textbook(ekf, before, {lin.residual, lin.jacobian, lin.noise});
  }
  EXPECT_NEAR(ekf.pose().x, 2.0, 0.05);
  EXPECT_NEAR(ekf.pose().y, 0.5, 0.05);
}

TEST(PoseEkf, a_position_as_sure_as_the_belief_goes_half_way) {
  PoseEkf ekf({}, {testing::hall()}, {0, {1.0, 2.0, 0.5}, Matrix<3, 3>::Identity()});
  EXPECT_EQ(ekf.on(PositionFix{0, {2.0, 1.0}, Matrix<2, 2>::Identity()}).verdict, Verdict::kFused);
  expect_pose_near(ekf.pose(), {1.5, 1.5, 0.5}, 1e-15);
  expect_near(ekf.belief().P, Matrix<3, 3>(Vector<3>(0.5, 0.5, 1.0).asDiagonal()), 1e-15);
}

TEST(PoseEkf, a_position_of_an_antenna_tells_of_the_heading) {
  PoseEkf::Config config;
  config.position = {1.0, 0.0};
  PoseEkf ekf = ekf_at({0.0, 0.0, 0.0}, config);
  const Matrix<2, 2> R = 0.01 * Matrix<2, 2>::Identity();
  ekf.on(PositionFix{0, {1.0, 0.05}, R});  // S = 0.01 + 0.0025 + 0.01 sideways
  EXPECT_NEAR(ekf.pose().heading, 0.05 * 0.0025 / 0.0225, 1e-14);
  EXPECT_NEAR(ekf.pose().y, 0.05 * 0.01 / 0.0225, 1e-14);
}

TEST(PoseEkf, three_tags_of_an_rtls_are_rigid_and_tell_pose_and_heading) {
  const std::vector<Tag> tags = {
      {1, {0.5, 0.0, 1.0}}, {2, {-0.3, 0.25, 1.0}}, {3, {-0.3, -0.25, 1.0}}};
  const Pose2 truth{2.0, 1.0, 0.7};
  const double sigma = 0.1;
  const Vector<3> vague(9.0, 9.0, 1.0);
  PoseEkf ekf({}, {testing::hall(), tags}, {0, {1.5, 1.5, 0.5}, vague.asDiagonal()});
  for (int epoch = 0; epoch < 200; ++epoch) {
    for (const Tag& tag : tags) {
      const PositionFix z{0, truth.act(tag.position.head<2>()),
                          sigma * sigma * Matrix<2, 2>::Identity(), tag.id};
      ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
    }
  }
  expect_pose_near(ekf.pose(), truth, 2e-3);
  // The information of 200 epochs: the inertia of the three lever arms, (4) of rigid_fit.md.
  const double inertia = 200.0 * (0.533333 * 0.533333 + 2.0 * (0.266667 * 0.266667 + 0.0625));
  EXPECT_NEAR(ekf.belief().P(2, 2), sigma * sigma / inertia, 0.05 * sigma * sigma / inertia);
}

TEST(PoseEkf, a_position_of_an_unknown_tag_changes_nothing) {
  PoseEkf ekf = ekf_at(kStart);
  const GaussianBelief before = ekf.belief();
  const PositionFix z{kSecond, kStart.position(), Matrix<2, 2>::Identity(), 17};
  EXPECT_EQ(ekf.on(z).verdict, Verdict::kNotModelled);
  EXPECT_TRUE(testing::same_bits(ekf.belief(), before));
}

TEST(Initializer, positions_of_tags_start_and_tell_the_heading) {
  const std::vector<Tag> tags = {{1, {0.5, 0.0, 1.0}}, {2, {-0.5, 0.0, 1.0}}};
  Initializer initializer({}, {{}, tags});
  const Pose2 truth{2.0, 1.0, 2.5};
  const Matrix<2, 2> R = 0.0004 * Matrix<2, 2>::Identity();
  initializer.on(PositionFix{0, {9.0, 9.0}, R, 5});  // of a tag that nobody knows
  EXPECT_TRUE(initializer.state().hypotheses.empty());
  for (int epoch = 0; epoch < 3; ++epoch) {
    for (const Tag& tag : tags) {
      initializer.on(PositionFix{0, truth.act(tag.position.head<2>()), R, tag.id});
    }
  }
  const Initializer::State state = initializer.state();
  ASSERT_EQ(state.status, StartStatus::kReady) << state.reason;
  expect_pose_near(state.hypotheses.front().estimate.pose, truth, 0.02);
}

TEST(PoseEkf, a_pose_across_the_cut_turns_the_short_way) {
  PoseEkf ekf({}, {testing::hall()}, {0, {0.0, 0.0, kPi - 0.1}, Matrix<3, 3>::Identity()});
  const PoseObservation z{0, {1.0, -1.0, -kPi + 0.3}, Matrix<3, 3>::Identity()};
  EXPECT_EQ(ekf.on(z).verdict, Verdict::kFused);
  expect_pose_near(ekf.pose(), {0.5, -0.5, -kPi + 0.1}, 1e-15);
}

TEST(PoseEkf, a_message_of_the_variant_is_the_message) {
  const std::vector<Message> messages = {
      Increment{0, kSecond, {0.5, 0.0, 0.1}}, range_to(0, kStart, kSecond / 2, 0.1),
      PositionFix{kSecond, {1.4, 2.3}, 0.1 * Matrix<2, 2>::Identity()},
      PoseObservation{kSecond, {1.4, 2.2, 0.6}, 0.1 * Matrix<3, 3>::Identity()},
      Velocity{2 * kSecond, 1.0, 0.1}};
  PoseEkf typed = ekf_at(kStart);
  PoseEkf variant = ekf_at(kStart);
  for (const Message& message : messages) {
    const Outcome first = std::visit([&](const auto& m) { return typed.on(m); }, message);
    const Outcome second = variant.on(message);
    EXPECT_EQ(first.verdict, Verdict::kFused);
    EXPECT_EQ(second.verdict, Verdict::kFused);
    EXPECT_EQ(first.dof, second.dof);
  }
  EXPECT_TRUE(testing::same_bits(typed.belief(), variant.belief()));
}

AnyRows stacked(const PoseEkf& ekf, const std::vector<Range>& epoch) {
  const auto n = static_cast<Eigen::Index>(epoch.size());
  AnyRows lin{Eigen::VectorXd(n), Eigen::MatrixXd(n, 3), Eigen::MatrixXd::Zero(n, n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Range& z = epoch[static_cast<std::size_t>(i)];
    const Linearization<1, 3> one = *ekf.range_model().linearize(ekf.pose(), z);
    lin.residual(i) = one.residual(0);
    lin.jacobian.row(i) = one.jacobian;
    lin.noise(i, i) = one.noise(0);
  }
  return lin;
}

TEST(PoseEkf, ranges_of_one_instant_are_one_measurement) {
  PoseEkf ekf = ekf_at(kStart);
  std::vector<Range> epoch;
  for (Id anchor = 0; anchor < 4; ++anchor) {
    epoch.push_back(range_to(anchor, kStart, 0, 0.1 - 0.05 * anchor));
  }
  epoch[2].sigma = 0.3;
  const GaussianBelief before = ekf.belief();
  const AnyRows lin = stacked(ekf, epoch);
  const Outcome outcome = ekf.on_joint(epoch);
  EXPECT_EQ(outcome.verdict, Verdict::kFused);
  EXPECT_EQ(outcome.dof, 4);
  expect_textbook(ekf, before, lin);
}

TEST(PoseEkf, a_joint_measurement_leaves_out_what_is_not_modelled) {
  PoseEkf ekf = ekf_at(kStart);
  std::vector<Range> known = {range_to(0, kStart, 0, 0.1), range_to(3, kStart, 0, -0.1)};
  std::vector<Range> all = known;
  all.insert(all.begin() + 1, {0, 0, 77, 5.0, {}});
  all.push_back({0, 5, 0, 5.0, {}});
  const GaussianBelief before = ekf.belief();
  const AnyRows lin = stacked(ekf, known);
  const Outcome outcome = ekf.on_joint(all);
  EXPECT_EQ(outcome.dof, 2);
  expect_textbook(ekf, before, lin);
}

TEST(PoseEkf, a_joint_measurement_is_gated_as_a_whole) {
  PoseEkf ekf = ekf_at(kStart);
  const GaussianBelief before = ekf.belief();
  const Outcome outcome =
      ekf.on_joint({range_to(0, kStart, kSecond), range_to(1, kStart, kSecond, 9.0)});
  EXPECT_EQ(outcome.verdict, Verdict::kGated);
  EXPECT_EQ(outcome.dof, 2);
  EXPECT_TRUE(testing::same_bits(ekf.belief(), before));
}

TEST(PoseEkf, somebody_else_s_linearization_counts_as_much_as_its_own) {
  PoseEkf own = ekf_at(kStart);
  PoseEkf other = ekf_at(kStart);
  own.on(Velocity{0, 0.5, 0.2});
  other.on(Velocity{0, 0.5, 0.2});
  const Range z = range_to(2, other.estimate(kSecond).pose, kSecond, 0.3);
  const Linearization<1, 3> lin = *other.range_model().linearize(other.estimate(kSecond).pose, z);
  const Outcome first = own.on(z);
  const Outcome second = other.fuse(kSecond, {lin.residual, lin.jacobian, lin.noise}, Gate(0.999));
  EXPECT_EQ(second.verdict, Verdict::kFused);
  EXPECT_NEAR(first.nis, second.nis, 1e-12);
  EXPECT_NEAR(first.log_likelihood(), second.log_likelihood(), 1e-12);
  EXPECT_EQ(own.belief().stamp, other.belief().stamp);
  expect_near(own.belief().x, other.belief().x, 1e-14);
  expect_near(own.belief().P, other.belief().P, 1e-15);
}

TEST(PoseEkf, a_copy_is_a_snapshot) {
  PoseEkf ekf = ekf_at(kStart);
  ekf.on(Increment{0, kSecond, {0.5, 0.0, 0.1}});
  const PoseEkf snapshot = ekf;
  const GaussianBelief before = ekf.belief();
  ekf.on(range_to(0, kStart, kSecond, 0.1));
  ekf.on(Velocity{2 * kSecond, 3.0, 0.0});
  EXPECT_TRUE(testing::same_bits(snapshot.belief(), before));
  expect_pose_near(snapshot.estimate().pose, kStart * Pose2{0.5, 0.0, 0.1}, 1e-15);
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_measurements
