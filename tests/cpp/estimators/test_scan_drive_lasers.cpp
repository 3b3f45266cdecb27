// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "locfuse/estimators/scan_drive.hpp"
#include "support/expect.hpp"
#include "support/lasers.hpp"

namespace locfuse::test_scan_drive_lasers {
namespace {

using testing::kFront;
using testing::kRear;
using testing::Rng;

constexpr Stamp kStep = 50'000'000;
constexpr int kRooms = 4;

/// One that sees all around, or two that see half each, read at once or in turn.
enum class Lasers { kWhole, kAtOnce, kInTurn, kFrontOnly };

/// A circle of 0.8 m in a random room at 0.5 m/s, a scan at every second step of 0.05 s.
struct Circle {
  explicit Circle(std::uint64_t seed) : rng(seed) {
    const Pose2 middle = testing::random_pose(rng, 1.0);
    walls = testing::room_around(middle);
    truth = start = middle * Pose2{0.0, -0.8, 0.0};
  }

  void drive(bool has_wheels) {
    truth = truth * motion;
    if (has_wheels) {  // which are a tenth too large
      odometry.on(Increment{now, now + kStep, {1.1 * motion.x, 1.1 * motion.y, motion.heading}});
    }
    now += kStep;
  }

  bool look(LaserScan scan) {
    scan.stamp = now;
    const std::optional<Increment> moved = odometry.on(scan);
    sum = moved ? sum * moved->motion : sum;
    return moved.has_value();
  }
  bool look_to(const Pose2& mount) {
    return look(testing::half_scan(walls, truth, rng, 0.01, mount));
  }
  void look_by(Lasers lasers, bool is_even) {
    if (is_even && lasers == Lasers::kWhole) {
      look(testing::scan_from(walls, truth, rng, 0.01));
    } else if (is_even) {
      look_to(kFront);
    }
    if (lasers == (is_even ? Lasers::kAtOnce : Lasers::kInTurn)) {
      look_to(kRear);
    }
  }

  [[nodiscard]] double off() const { return ((start * sum).position() - truth.position()).norm(); }

  const Pose2 motion = arc(0.025, 0.0, 0.03125);
  Rng rng;
  testing::Walls walls;
  Pose2 start, truth, sum;
  Stamp now = 0;
  ScanDrive odometry;
};

/// Root mean square of how far it is off after 5 m, over rooms; it drives from the first scan on.
double error_with(Lasers lasers, bool has_wheels) {
  double squared = 0.0;
  for (int seed = 0; seed < kRooms; ++seed) {
    Circle circle(static_cast<std::uint64_t>(seed));
    circle.look_by(lasers, true);
    for (int k = 1; k <= 200; ++k) {
      circle.drive(has_wheels);
      circle.look_by(lasers, k % 2 == 0);
    }
    squared += circle.off() * circle.off() / kRooms;
  }
  return std::sqrt(squared);
}

// The map that a scan is fitted to then had nothing of what the other laser sees.
TEST(ScanDriveLasers, two_halves_drift_as_little_as_a_whole_one) {
  for (const bool has_wheels : {true, false}) {
    const double whole = error_with(Lasers::kWhole, has_wheels);
    const double front = error_with(Lasers::kFrontOnly, has_wheels);
    for (const Lasers lasers : {Lasers::kAtOnce, Lasers::kInTurn}) {
      const double halves = error_with(lasers, has_wheels);
      std::printf("off by %.1f mm, with a whole one by %.1f mm, with the front alone by %.1f mm\n",
                  1e3 * halves, 1e3 * whole, 1e3 * front);
      // The motion alone shows where the rear one's first scan lies: to half a beam's sigma.
      EXPECT_LT(halves, whole + 0.005);
      EXPECT_LT(halves, front);
    }
  }
}

// In a room with two equal ends half a scan of one end fits the other, turned around.
TEST(ScanDriveLasers, the_first_scan_of_a_second_one_is_not_taken_for_what_the_first_sees) {
  testing::Walls walls;
  testing::add_box(walls, {}, 8.0, 5.0);
  Rng rng(1);
  ScanDrive odometry;
  Pose2 sum;
  for (int k = 0; k < 20; ++k) {
    LaserScan scan = testing::half_scan(walls, {}, rng, 0.01, k % 2 == 0 ? kFront : kRear);
    scan.stamp = k * kStep;
    odometry.on(Velocity{scan.stamp, 0.0, 0.0});
    const std::optional<Increment> moved = odometry.on(scan);
    sum = moved ? sum * moved->motion : sum;
    testing::expect_pose_near(sum, {}, 0.02);
  }
}

TEST(ScanDriveLasers, of_scans_of_one_stamp_the_second_corrects_the_next_motion) {
  Circle circle(5);
  LaserScan blind = testing::half_scan(circle.walls, circle.truth, circle.rng, 0.01, kRear);
  blind.ranges.assign(blind.ranges.size(), 12.0);
  for (int k = 0; k < 100; ++k) {
    EXPECT_EQ(circle.look(blind), k > 0);
    EXPECT_FALSE(circle.look_to(kFront));
    EXPECT_FALSE(circle.look_to(kFront));  // a scan of each is enough
    circle.drive(true);
  }
  circle.look(blind);
  EXPECT_LT(circle.off(), 0.03);  // by wheels 0.25 m
}

TEST(ScanDriveLasers, one_that_turns_on_the_body_is_followed) {
  Circle circle(6);
  for (int k = 0; k < 100; ++k) {
    LaserGeometry turned = *testing::laser();
    turned.pose_in_body.heading += 0.01 * k;
    circle.look(testing::scan_from(circle.walls, circle.truth, circle.rng, 0.01,
                                   std::make_shared<const LaserGeometry>(turned)));
    circle.drive(true);
  }
  EXPECT_LT(circle.off(), 0.06);
}

}  // namespace
}  // namespace locfuse::test_scan_drive_lasers
