// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "locfuse/particles/mcl.hpp"
#include "support/lasers.hpp"
#include "support/pose_errors.hpp"

namespace locfuse::test_mcl_lasers {
namespace {

using testing::kFront;
using testing::kRear;
using Errors = testing::PoseErrors;
using testing::Rng;

constexpr Stamp kStep = 100'000'000;

/// One that sees all around, or two that see half each, read at once or in turn.
enum class Lasers { kWhole, kAtOnce, kInTurn, kFrontOnly };

Mcl::Config config(std::uint64_t seed) {
  Mcl::Config config;
  config.odometry = {0.05, 0.03, 0.04, 0.05, 0.0, 0.0};
  config.seed = seed;
  return config;
}

/// A robot drives a circle of 1.25 m in a room. A laser is news after two steps.
struct Robot {
  explicit Robot(std::uint64_t seed)
      : rng(seed),
        noise(seed + 1000),
        room(testing::random_room(rng)),
        pose(room.middle * Pose2{0.0, -1.25, 0.0}),
        mcl(config(seed), testing::on_map(room.map), 0) {
    mcl.start_at({{{0, pose, 0.0025 * Matrix<3, 3>::Identity()}, 1.0}});
  }

  void drive() {
    const Pose2 motion = arc(0.05, 0.0, 0.04);
    const Matrix<3, 3> Q = OdometryMotion(mcl.config().odometry).propagate({}, motion, 0.1).noise;
    const Vector<3> off{testing::normal(rng, std::sqrt(Q(0, 0))),
                        testing::normal(rng, std::sqrt(Q(1, 1))),
                        testing::normal(rng, std::sqrt(Q(2, 2)))};
    pose = pose * retract(motion, off);
    mcl.on(Increment{now, now + kStep, motion});
    now += kStep;
  }

  Verdict look(LaserScan scan) {
    scan.stamp = now;
    return mcl.on(scan).verdict;
  }
  Verdict look_to(const Pose2& mount) {
    return look(testing::half_scan(room.walls, pose, noise, 0.02, mount));
  }
  void look_by(Lasers lasers, bool is_even) {
    if (is_even && lasers == Lasers::kWhole) {
      look(testing::scan_from(room.walls, pose, noise, 0.02));
    } else if (is_even) {
      look_to(kFront);
    }
    if (lasers == (is_even ? Lasers::kAtOnce : Lasers::kInTurn)) {
      look_to(kRear);
    }
  }

  Rng rng, noise;  // of the drive, and of scans: so all lasers are driven the same way
  testing::Room room;
  Pose2 pose;
  Mcl mcl;
  Stamp now = 0;
};

Errors errors_with(Lasers lasers) {
  Errors errors;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Robot robot(seed);
    for (int k = 0; k < 160; ++k) {
      robot.drive();
      robot.look_by(lasers, k % 2 == 1);
      if (k >= 40) {
        errors.add(robot.mcl.estimate(), robot.pose);
      }
    }
  }
  return errors;
}

// The second laser's scans were no news, as the first one's had just been used.
TEST(MclLasers, scans_of_both_are_fused_while_it_moves) {
  Robot robot(1);
  for (int k = 0; k < 50; ++k) {
    robot.drive();
    EXPECT_EQ(robot.look_to(k % 2 == 0 ? kFront : kRear), Verdict::kFused) << k;
  }
  EXPECT_TRUE(robot.mcl.ready());
}

TEST(MclLasers, what_is_no_news_of_one_is_of_the_other) {
  Robot robot(1);
  robot.drive();
  robot.look_to(kRear);
  robot.drive();
  for (int k = 0; k < 12; ++k) {  // no more scans are used without motion
    robot.look_to(kFront);
  }
  robot.drive();
  EXPECT_EQ(robot.look_to(kFront), Verdict::kNotModelled);
  EXPECT_EQ(robot.look_to(kRear), Verdict::kFused);
  EXPECT_EQ(robot.look_to(kRear), Verdict::kNotModelled);
}

TEST(MclLasers, ten_stationary_scans_are_used_after_a_start_whichever_lasers_they_are_of) {
  Robot robot(2);
  const Vector<3> sigma(0.3, 0.3, 0.1);
  robot.mcl.start_at({{{0, robot.pose, sigma.cwiseAbs2().asDiagonal()}, 1.0}});
  int used = 0;
  for (int k = 0; k < 40; ++k) {
    robot.now += kStep / 40;
    used += robot.look_to(k % 2 == 0 ? kFront : kRear) == Verdict::kFused ? 1 : 0;
  }
  EXPECT_EQ(used, 12);  // and the first of each
}

TEST(MclLasers, two_halves_are_as_good_as_a_whole_one) {
  const Errors whole = errors_with(Lasers::kWhole);
  const Errors front = errors_with(Lasers::kFrontOnly);
  for (const Lasers lasers : {Lasers::kAtOnce, Lasers::kInTurn}) {
    const Errors halves = errors_with(lasers);
    std::printf("RMSE %.2f cm, NEES %.2f; a whole one %.2f cm, %.2f; the front alone %.2f cm\n",
                100.0 * halves.rmse(), halves.nees / halves.count, 100.0 * whole.rmse(),
                whole.nees / whole.count, 100.0 * front.rmse());
    EXPECT_LT(halves.rmse(), 1.05 * whole.rmse());
    EXPECT_LT(halves.rmse(), 0.9 * front.rmse());
    EXPECT_LT(halves.nees / halves.count, 3.0);
  }
}

// Of two scans of one stamp the second was no news, and spoke neither for the pose nor against it.
TEST(MclLasers, for_health_each_laser_is_news_by_itself) {
  Robot robot(3);
  internal::MclHealth health(internal::make_mcl_recipe(config(3), testing::on_map(robot.room.map)));
  health.start(0, 0.01);
  ScanEvidence contradicts;
  contradicts.explained = contradicts.by_chance = 0.3;
  contradicts.independent = 10.0;
  const PoseEstimate here{0, robot.pose, 1e-4 * Matrix<3, 3>::Identity()};
  std::vector<double> wrong;
  for (const Pose2& mount : {kFront, kRear, kFront}) {
    const LaserScan scan = testing::half_scan(robot.room.walls, {}, robot.rng, 0.02, mount);
    health.report_scan(scan, contradicts);
    wrong.push_back(health.report(1.0, here, true).wrong);
  }
  EXPECT_GT(wrong[1], 2.0 * wrong[0]);
  EXPECT_EQ(wrong[2], wrong[1]);
}

TEST(MclLasers, health_trusts_a_robot_with_two) {
  Robot robot(4);
  for (int k = 0; k < 600; ++k) {
    robot.drive();
    robot.look_to(kRear);
    robot.look_to(kFront);
    if (k > 20) {
      ASSERT_EQ(robot.mcl.health().state, HealthState::kOk) << k;
    }
  }
}

}  // namespace
}  // namespace locfuse::test_mcl_lasers
