// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/expect.hpp"
#include "support/robot.hpp"

namespace locfuse::test_pose_ekf_odometry {
namespace {

using testing::at;
using testing::ekf_at;
using testing::expect_near;
using testing::expect_pose_near;
using testing::kSecond;
using testing::range_to;

const Pose2 kStart{1.0, 2.0, 0.5};

PoseEkf::Config patient() {
  PoseEkf::Config config;
  config.hold_s = 100.0;
  return config;
}

Range blind(Range z) {  // so imprecise that it moves nothing
  z.sigma = 1e9;
  return z;
}

TEST(PoseEkf, stands_until_odometry_says_otherwise) {
  const PoseEstimate estimate = ekf_at(kStart, patient()).estimate(50 * kSecond);
  EXPECT_EQ(estimate.stamp, 50 * kSecond);
  expect_pose_near(estimate.pose, kStart, 0.0);
}

TEST(PoseEkf, holds_a_velocity_straight_ahead) {
  PoseEkf ekf = ekf_at(kStart, patient());
  EXPECT_EQ(ekf.on(Velocity{0, 1.5, 0.0}).verdict, Verdict::kFused);
  expect_pose_near(ekf.estimate(2 * kSecond).pose,
                   {1.0 + 3.0 * std::cos(0.5), 2.0 + 3.0 * std::sin(0.5), 0.5}, 1e-14);
}

TEST(PoseEkf, holds_a_velocity_on_the_exact_arc_however_often_it_is_asked) {
  PoseEkf ekf = ekf_at(kStart, patient());
  ekf.on(Velocity{0, 1.5, 0.8});
  const double radius = 1.5 / 0.8;  // the textbook's unicycle over 2.5 s
  const Pose2 expected{1.0 + radius * (std::sin(2.5) - std::sin(0.5)),
                       2.0 - radius * (std::cos(2.5) - std::cos(0.5)), 2.5};
  expect_pose_near(ekf.estimate(at(2.5)).pose, expected, 1e-13);
  for (int i = 1; i <= 25; ++i) {
    ekf.advance_to(i * kSecond / 10);
  }
  expect_pose_near(ekf.pose(), expected, 1e-13);
}

TEST(PoseEkf, holds_a_velocity_sideways_as_an_increment_of_the_same_motion) {
  PoseEkf held = ekf_at(kStart, patient());
  held.on(Velocity{0, 0.5, 0.8, -0.3});
  PoseEkf moved = ekf_at(kStart, patient());
  moved.on(Increment{0, 2 * kSecond, arc(1.0, -0.6, 1.6)});
  expect_pose_near(held.estimate(2 * kSecond).pose, moved.estimate(2 * kSecond).pose, 1e-13);
}

TEST(PoseEkf, a_velocity_rules_from_its_stamp_on) {
  PoseEkf ekf = ekf_at({}, patient());
  ekf.on(Velocity{0, 1.0, 0.0});
  ekf.on(Velocity{2 * kSecond, 3.0, 0.0});
  ekf.on(Velocity{3 * kSecond, 0.0, 0.0});
  expect_pose_near(ekf.estimate(9 * kSecond).pose, {5.0, 0.0, 0.0}, 1e-14);
}

TEST(PoseEkf, chained_increments_compose) {
  PoseEkf ekf = ekf_at(kStart);
  Pose2 expected = kStart;
  for (int i = 0; i < 40; ++i) {
    const Pose2 motion{0.1, 0.01 * (i % 3), 0.3};
    EXPECT_EQ(ekf.on(Increment{at(0.1 * i), at(0.1 * (i + 1)), motion}).verdict, Verdict::kFused);
    expected = expected * motion;
  }
  expect_pose_near(ekf.estimate().pose, expected, 1e-13);
}

TEST(PoseEkf, estimate_carries_to_the_end_of_an_increment_and_changes_nothing) {
  PoseEkf ekf = ekf_at(kStart);
  const Pose2 motion{0.6, 0.1, 0.4};
  ekf.on(Increment{kSecond, 2 * kSecond, motion});
  const GaussianBelief before = ekf.belief();
  const PoseEstimate estimate = ekf.estimate();
  EXPECT_EQ(estimate.stamp, 2 * kSecond);
  expect_pose_near(estimate.pose, kStart * motion, 1e-15);
  EXPECT_EQ(ekf.current().stamp, kSecond);
  expect_pose_near(ekf.current().pose, kStart, 0.0);
  EXPECT_TRUE(testing::same_bits(ekf.belief(), before));
}

TEST(PoseEkf, a_range_within_an_increment_sees_its_share_of_the_arc) {
  PoseEkf ekf = ekf_at(kStart);
  const Pose2 motion{1.0, -0.3, 1.5};
  ekf.on(Increment{0, kSecond, motion});
  for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    const Pose2 there = kStart * arc_share(motion, share);
    const Outcome outcome = ekf.on(blind(range_to(2, there, at(share), 0.125)));
    EXPECT_EQ(outcome.verdict, Verdict::kFused);
    EXPECT_NEAR(outcome.residual, 0.125, 1e-13) << share;
  }
  expect_pose_near(ekf.pose(), kStart * motion, 1e-13);
}

TEST(PoseEkf, increments_in_shares_have_the_covariance_of_a_straight_whole) {
  PoseEkf whole = ekf_at(kStart);
  whole.on(Increment{0, kSecond, {1.0, 0.0, 0.0}});
  PoseEkf shares = whole;
  whole.advance_to(kSecond);
  shares.advance_to(at(0.3));
  shares.advance_to(kSecond);
  expect_pose_near(shares.pose(), whole.pose(), 1e-15);
  // Heading noise of the first share leaks sideways in the second: 0.02^2 * 0.3 m over 0.7 m.
  const Vector<2> sideways(-std::sin(0.5), std::cos(0.5));
  Matrix<3, 3> difference = shares.belief().P - whole.belief().P;
  const double leak = 0.0004 * 0.3;
  difference.topLeftCorner<2, 2>() -= leak * 0.7 * 0.7 * sideways * sideways.transpose();
  difference.topRightCorner<2, 1>() -= leak * 0.7 * sideways;
  difference.bottomLeftCorner<1, 2>() -= leak * 0.7 * sideways.transpose();
  expect_near(difference, Matrix<3, 3>(Matrix<3, 3>::Zero()), 1e-16);
}

/// After 4 s on an arc of 2 m and 1.2 rad, sent in `messages` pieces.
template <class Feed>
PoseEstimate after_an_arc(int messages, const Feed& feed) {
  PoseEkf::Config config = patient();
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  PoseEkf ekf = ekf_at(kStart, config);
  for (int i = 0; i < messages; ++i) {
    feed(ekf, 4 * kSecond * i / messages, 4 * kSecond * (i + 1) / messages);
  }
  return ekf.estimate(4 * kSecond);
}

PoseEstimate after_increments(int messages) {
  const Pose2 share = arc_share(arc(2.0, 0.0, 1.2), 1.0 / messages);
  return after_an_arc(messages, [&](PoseEkf& ekf, Stamp begin, Stamp end) {
    ekf.on(Increment{begin, end, share});
  });
}

PoseEstimate after_velocities(int messages) {
  return after_an_arc(messages, [](PoseEkf& ekf, Stamp begin, Stamp) {
    ekf.on(Velocity{begin, 0.5, 0.3});
  });
}

TEST(PoseEkf, the_same_drive_is_as_uncertain_at_any_message_rate) {
  const PoseEstimate slow = after_increments(40);
  for (const PoseEstimate& fast : {after_increments(4000), after_velocities(4000)}) {
    expect_pose_near(fast.pose, slow.pose, 1e-12);
    // 10 Hz sees chords instead of arcs and leaves out what heading noise does within a step.
    EXPECT_NEAR(fast.covariance(2, 2), slow.covariance(2, 2), 1e-6);
    const double spread = slow.covariance.cwiseAbs().maxCoeff();
    expect_near(fast.covariance, slow.covariance, 0.003 * spread);
  }
}

TEST(PoseEkf, an_increment_and_the_velocity_of_its_arc_leave_the_same_belief) {
  const PoseEstimate increments = after_increments(80);
  const PoseEstimate velocities = after_velocities(80);
  expect_pose_near(velocities.pose, increments.pose, 1e-13);
  expect_near(velocities.covariance, increments.covariance, 1e-14);
}

TEST(PoseEkf, an_increment_received_late_counts_with_the_share_that_is_left) {
  PoseEkf ekf = ekf_at(kStart);
  ekf.advance_to(at(0.25));  // it stood, for all it knew
  const Pose2 motion{1.0, 0.2, 0.8};
  EXPECT_EQ(ekf.on(Increment{0, kSecond, motion}).verdict, Verdict::kFused);
  expect_pose_near(ekf.estimate().pose, kStart * arc_share(motion, 0.75), 1e-15);
}

TEST(PoseEkf, translation_and_rotation_follow_equation_6_of_ekim2020) {
  PoseEkf ekf = ekf_at(kStart);
  ekf.on(Increment::from_drive_then_turn(0, kSecond, 0.8, 0.3));
  expect_pose_near(ekf.estimate().pose,
                   {1.0 + 0.8 * std::cos(0.5), 2.0 + 0.8 * std::sin(0.5), 0.5 + 0.3}, 1e-15);
}

TEST(PoseEkf, a_displacement_without_duration_happens_at_once_and_has_no_rate) {
  PoseEkf ekf = ekf_at(kStart, patient());
  const Pose2 motion{0.5, 0.1, 0.2};
  ekf.on(Increment{kSecond, kSecond, motion});
  expect_pose_near(ekf.pose(), kStart * motion, 1e-15);
  expect_pose_near(ekf.estimate(5 * kSecond).pose, kStart * motion, 1e-15);
}

TEST(PoseEkf, after_the_hold_it_stands_and_spreads) {
  PoseEkf::Config config;
  config.hold_s = 1.0;
  PoseEkf ekf = ekf_at({}, config);
  ekf.on(Velocity{0, 2.0, 0.0});
  const PoseEstimate held = ekf.estimate(kSecond);
  const PoseEstimate lost = ekf.estimate(4 * kSecond);
  expect_pose_near(held.pose, {2.0, 0.0, 0.0}, 1e-15);
  expect_pose_near(lost.pose, {2.0, 0.0, 0.0}, 1e-15);
  const Matrix<3, 3> spread = Vector<3>(0.25 * 3.0, 0.25 * 3.0, 0.25 * 3.0).asDiagonal();
  expect_near(lost.covariance - held.covariance, spread, 1e-15);
}

TEST(PoseEkf, after_an_increment_its_rate_is_held_and_then_it_stands) {
  PoseEkf::Config config;
  config.hold_s = 0.5;
  PoseEkf ekf = ekf_at(kStart, config);
  const Pose2 motion{1.0, 0.0, 0.6};
  ekf.on(Increment{0, kSecond, motion});
  expect_pose_near(ekf.estimate(at(1.25)).pose, kStart * arc_share(motion, 1.25), 1e-14);
  expect_pose_near(ekf.estimate(at(1.5)).pose, kStart * arc_share(motion, 1.5), 1e-14);
  expect_pose_near(ekf.estimate(9 * kSecond).pose, kStart * arc_share(motion, 1.5), 1e-14);
}

TEST(PoseEkf, what_an_increment_measured_and_what_is_held_of_it_are_two_steps) {
  PoseEkf at_once = ekf_at(kStart);
  at_once.on(Increment{0, kSecond, {1.0, 0.0, 0.6}});
  PoseEkf in_steps = at_once;
  at_once.advance_to(at(1.5));
  in_steps.advance_to(kSecond);
  in_steps.advance_to(at(1.5));
  EXPECT_TRUE(testing::same_bits(at_once.belief(), in_steps.belief()));
}

TEST(PoseEkf, spreads_from_the_end_of_the_hold_whatever_odometry_said_last) {
  PoseEkf::Config config;
  config.hold_s = 0.5;
  config.odometry = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  config.sigma_lost_xy_per_sqrt_s = 0.2;
  config.sigma_lost_heading_per_sqrt_s = 0.3;
  const Matrix<3, 3> per_second = Vector<3>(0.04, 0.04, 0.09).asDiagonal();
  const auto expect_spread = [&](const PoseEkf& ekf, double lost) {
    const PoseEstimate held = ekf.estimate(at(3.0 - lost));
    const PoseEstimate now = ekf.estimate(at(3.0));
    expect_pose_near(now.pose, held.pose, 1e-15);
    expect_near(now.covariance - held.covariance, lost * per_second, 1e-14);
    if (lost < 2.5) {
      const Matrix<3, 3> before = ekf.estimate(at(2.9 - lost)).covariance;
      EXPECT_NEAR(before(2, 2), held.covariance(2, 2), 1e-15);
    }
  };
  PoseEkf ekf = ekf_at(kStart, config);
  expect_spread(ekf, 2.5);  // never received odometry
  ekf.on(Increment{0, kSecond, {0.5, 0.0, 0.2}});
  expect_spread(ekf, 1.5);
  ekf.on(Velocity{2 * kSecond, 0.5, 0.2});
  expect_spread(ekf, 0.5);
}

TEST(PoseEkf, a_hold_longer_than_any_clock_lasts) {
  // 1e10 s in nanoseconds exceed a Stamp: it used to be lost at once instead of never.
  for (const double hold : {1e9, 1e10, 1e300}) {
    PoseEkf::Config config;
    config.hold_s = hold;
    const Stamp now = 1'700'000'000 * kSecond;  // since 1970
    PoseEkf ekf(config, {testing::hall()}, {now, kStart, Matrix<3, 3>::Identity()});
    ekf.on(Velocity{now, 0.001, 0.0});
    EXPECT_NEAR((ekf.estimate(now + 10'000 * kSecond).pose.position() - kStart.position()).norm(),
                10.0, 1e-9);
  }
}

TEST(PoseEkf, drives_again_when_odometry_returns) {
  PoseEkf ekf = ekf_at({});
  ekf.on(Velocity{0, 1.0, 0.0});
  ekf.on(Velocity{10 * kSecond, 2.0, 0.0});
  expect_pose_near(ekf.estimate(at(10.5)).pose, {2.0, 0.0, 0.0}, 1e-14);
}

TEST(PoseEkf, covariance_of_a_straight_drive_equals_values_computed_by_hand) {
  PoseEkf::Config config = patient();
  config.odometry = {0.03, 0.01, 0.02, 0.0, 0.0, 0.0};
  PoseEkf ekf = ekf_at({}, config);
  ekf.on(Increment{0, kSecond, {2.0, 0.0, 0.0}});
  Matrix<3, 3> expected;
  expected << 0.01 + 0.0009 * 2.0, 0.0, 0.0,                  //
      0.0, 0.01 + 4.0 * 0.0025 + 0.0001 * 2.0, 2.0 * 0.0025,  //
      0.0, 2.0 * 0.0025, 0.0025 + 0.0004 * 2.0;
  expect_near(ekf.estimate().covariance, expected, 1e-16);
}

TEST(PoseEkf, a_motion_of_nanoseconds_is_not_held_on_faster_than_a_robot_is) {
  PoseEkf ekf = testing::ekf_at({});
  ekf.on(Increment{0, 100, {0.01, 0.0, 0.0}});
  EXPECT_NEAR(ekf.estimate(testing::kSecond).pose.x, 0.01, 1e-12);
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_odometry
