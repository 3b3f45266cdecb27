// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "locfuse/particles/mcl.hpp"
#include "support/rooms.hpp"

namespace locfuse::test_mcl_health {
namespace {

using testing::normal;
using testing::Rng;

constexpr Stamp kStep = 200'000'000;

/// Particles that are as sure of their wheels as they may be: with the default's wider noise they
/// find a robot that is carried a little way before anything is noticed.
Mcl::Config good_wheels() {
  Mcl::Config config;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  return config;
}

/// A robot drives a circle of one metre about a pose in a room.
struct Robot {
  Rng rng;
  testing::Room room;
  Pose2 pose;
  Mcl mcl;
  Stamp stamp = 0;
  double cover = 0.0;  // share of the beams that something covers
  bool blind = false;  // no returns at all

  explicit Robot(std::uint64_t seed, const Mcl::Config& config = good_wheels())
      : rng(seed),
        room(testing::random_room(rng)),
        pose(room.middle * Pose2{0.0, -1.0, 0.0}),
        mcl(config, testing::on_map(room.map), 0) {
    mcl.start_at({{{0, pose, 0.0025 * Matrix<3, 3>::Identity()}, 1.0}});
  }

  void step(int count) {
    for (int k = 0; k < count; ++k) {
      const Pose2 motion = arc(0.1, 0.0, 0.1);
      const Pose2 odometry{motion.x + normal(rng, 0.005), motion.y + normal(rng, 0.002),
                           motion.heading + normal(rng, 0.005)};
      pose = pose * motion;
      mcl.on(Increment{stamp, stamp + kStep, odometry});
      stamp += kStep;
      look();
    }
  }

  void stand() {
    mcl.on(Increment{stamp, stamp + kStep, {}});
    stamp += kStep;
    look();
  }

  Outcome look() {
    LaserScan scan = testing::scan_from(room.walls, pose, rng, 0.02);
    scan.stamp = stamp;
    const auto hidden = static_cast<std::size_t>(cover * static_cast<double>(scan.ranges.size()));
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      scan.ranges[i] = blind        ? std::numeric_limits<double>::quiet_NaN()
                       : i < hidden ? 0.15
                                    : scan.ranges[i];
    }
    return mcl.on(scan);
  }

  [[nodiscard]] double off() const {
    const Pose2 found = mcl.estimate().pose;
    return std::hypot(found.x - pose.x, found.y - pose.y);
  }
};

TEST(MclHealth, is_initializing_until_it_converges_and_then_ok) {
  Robot robot(1);
  EXPECT_EQ(robot.mcl.health().state, HealthState::kInitializing);
  EXPECT_EQ(robot.mcl.health().wrong, 1.0);
  for (int k = 0; k < 300; ++k) {
    robot.step(1);
    if (k > 5) {
      ASSERT_EQ(robot.mcl.health().state, HealthState::kOk) << k;
    }
  }
  const HealthReport report = robot.mcl.health();
  EXPECT_GT(report.within, 0.999);
  EXPECT_LT(report.protection.x(), 0.5);
  EXPECT_LT(robot.off(), report.protection.head<2>().norm());
  ASSERT_EQ(robot.mcl.sources().size(), 1U);
  const SourceStatus& scans = robot.mcl.sources().front();
  EXPECT_EQ(scans.source.kind, Source::kScans);
  EXPECT_EQ(scans.fused, robot.stamp);
  EXPECT_GT(scans.accepted, 0.99);
  EXPECT_LT(scans.test_ratio, 1.0);
  EXPECT_NEAR(scans.interval, 0.2, 1e-9);
}

TEST(MclHealth, is_ambiguous_in_a_symmetric_room) {
  testing::Walls walls;
  testing::add_box(walls, {}, 8.0, 5.0);
  Mcl::Config config;
  config.max_particles = 20000;
  Mcl mcl(config, testing::on_map(testing::map_of(walls, 320, 320, 0.05, {-8.0, -8.0, 0.0})), 0);
  Rng rng(2);
  Pose2 pose{-1.0, 0.5, 0.3};
  for (int k = 1; k <= 40; ++k) {
    const Pose2 motion = arc(0.05, 0.0, 0.1);
    pose = pose * motion;
    mcl.on(Increment{(k - 1) * kStep, k * kStep, motion});
    LaserScan scan = testing::scan_from(walls, pose, rng, 0.02);
    scan.stamp = k * kStep;
    mcl.on(scan);
  }
  EXPECT_EQ(mcl.health().state, HealthState::kAmbiguous);
  EXPECT_EQ(mcl.health().reason, HealthReason::kSeveralPlaces);
  EXPECT_TRUE(std::isinf(mcl.health().protection.x()));
}

TEST(MclHealth, a_kidnapping_is_detected_within_two_seconds_and_health_recovers) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Robot robot(seed);
    robot.step(100);
    ASSERT_EQ(robot.mcl.health().state, HealthState::kOk) << seed;
    robot.pose = robot.room.middle * Pose2{0.8, 1.2, 2.5};
    int steps = 0;
    while (robot.mcl.health().state != HealthState::kLost && ++steps < 20) {
      robot.step(1);
    }
    EXPECT_LE(steps, 10) << seed;
    EXPECT_TRUE(std::isinf(robot.mcl.health().protection.x()));
    int wrong = 0;
    for (int k = 0; k < 400; ++k) {
      robot.step(1);
      const bool is_trusted = robot.mcl.health().wrong < 0.1;
      wrong += is_trusted && robot.off() > 1.0 ? 1 : 0;
    }
    EXPECT_EQ(wrong, 0) << seed;
    EXPECT_EQ(robot.mcl.health().state, HealthState::kOk) << seed;
    EXPECT_LT(robot.off(), 0.2) << seed;
  }
}

/// Before particles used health it took 97 to 176 steps.
TEST(MclHealth, lost_health_starts_recovery) {
  Mcl::Config config = good_wheels();
  config.most_drop = 1e6;  // so that only health can declare it lost
  config.min_explained = 0.0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Robot robot(seed, config);
    robot.step(100);
    robot.pose = robot.room.middle * Pose2{0.8, 1.2, 2.5};
    robot.step(25);
    EXPECT_LT(robot.off(), 0.2) << seed;
  }
}

/// With the covered returns in the scan the pose was dragged to walls.
TEST(MclHealth, a_covered_laser_is_named_and_the_pose_trusted) {
  for (const double cover : {0.35, 1.0}) {
    Robot robot(4);
    robot.step(100);
    robot.cover = cover;
    const bool hides_all = cover == 1.0;
    EXPECT_EQ(robot.look().verdict == Verdict::kGated, hides_all);
    robot.step(40);
    const HealthReport report = robot.mcl.health();
    EXPECT_EQ(report.state, hides_all ? HealthState::kDeadReckoning : HealthState::kDegraded);
    EXPECT_EQ(report.reason, HealthReason::kLaserIsCovered);
    ASSERT_TRUE(report.source);
    EXPECT_EQ(report.source->kind, Source::kScans);
    EXPECT_LT(report.wrong, 0.01);
    EXPECT_LT(robot.off(), 0.3);
    EXPECT_LT(robot.off(), report.protection.head<2>().norm());
    robot.cover = 0.0;
    robot.step(60);
    EXPECT_EQ(robot.mcl.health().state, HealthState::kOk);
  }
}

TEST(MclHealth, a_laser_without_returns_is_silent) {
  Robot robot(5);
  robot.step(100);
  robot.blind = true;
  robot.step(15);
  EXPECT_EQ(robot.mcl.health().state, HealthState::kDeadReckoning);
  EXPECT_EQ(robot.mcl.health().reason, HealthReason::kSilence);
  robot.step(300);
  EXPECT_EQ(robot.mcl.health().state, HealthState::kLost);
}

/// Health reads scans that weigh no particles, too.
TEST(MclHealth, a_kidnapping_at_standstill_is_detected) {
  Robot robot(6);
  robot.step(100);
  for (int k = 0; k < 100; ++k) {
    robot.stand();
    ASSERT_EQ(robot.mcl.health().state, HealthState::kOk) << k;
  }
  robot.pose = robot.room.middle * Pose2{0.8, 1.2, 2.5};
  for (int k = 0; k < 50; ++k) {
    robot.stand();
  }
  EXPECT_EQ(robot.mcl.health().state, HealthState::kLost);
}

/// No motion over a spacing of 0 was NaN, and so was the probability of being wrong.
TEST(MclHealth, every_scan_may_weigh_particles) {
  Mcl::Config config;
  config.spacing_m = config.spacing_heading_rad = 0.0;
  Robot robot(4, config);
  robot.step(20);
  for (int k = 0; k < 20; ++k) {
    robot.stand();
    ASSERT_LT(robot.mcl.health().wrong, 0.01) << k;
  }
  EXPECT_EQ(robot.mcl.health().state, HealthState::kOk);
}

TEST(MclHealth, poses_are_recorded_by_their_innovations) {
  Robot robot(7);
  robot.step(60);
  PoseObservation z;
  z.stamp = robot.stamp;
  z.pose = robot.mcl.estimate().pose;
  z.covariance = 0.01 * Matrix<3, 3>::Identity();
  z.pose.x += 0.1;
  const Outcome outcome = robot.mcl.on(z);
  EXPECT_EQ(outcome.verdict, Verdict::kFused);
  EXPECT_EQ(outcome.dof, 3);
  EXPECT_NEAR(outcome.residual, 0.1, 0.02);
  ASSERT_EQ(robot.mcl.sources().size(), 2U);
  EXPECT_EQ(robot.mcl.sources().front().source.kind, Source::kPoses);
  EXPECT_EQ(robot.mcl.sources().front().accepted, 1.0);
}

TEST(MclHealth, watches_poses_which_weigh_no_particles) {
  Mcl::Config watching = good_wheels();
  watching.watch_poses = true;
  Robot with(7, watching);
  Robot without(7);
  EXPECT_FALSE(without.mcl.watched().has_value());
  EXPECT_EQ(with.mcl.watched()->reason, WatchReason::kNoEstimate);
  for (int k = 0; k < 60; ++k) {
    with.step(1);
    without.step(1);
    const double off = k >= 20 && k < 40 ? 3.0 : 0.0;
    const PoseObservation z{with.stamp, with.pose * Pose2{off, 0.0, 0.0},
                            1e-3 * Matrix<3, 3>::Identity()};
    const Outcome outcome = with.mcl.on(z);
    if (k == 0) {
      continue;  // of its first scan it is not sure
    }
    EXPECT_EQ(outcome.reason, Reason::kWatched);
    EXPECT_EQ(with.mcl.watched()->state, off > 0.0 ? HealthState::kLost : HealthState::kOk) << k;
    EXPECT_NEAR(with.mcl.watched()->error.head<2>().norm(), off, 0.3);
  }
  EXPECT_EQ(with.mcl.belief().x, without.mcl.belief().x);
  EXPECT_EQ(with.mcl.belief().weight, without.mcl.belief().weight);
  PoseObservation late{0, with.pose, 1e-3 * Matrix<3, 3>::Identity()};
  EXPECT_EQ(with.mcl.on(late).verdict, Verdict::kStale);
}

}  // namespace
}  // namespace locfuse::test_mcl_health
