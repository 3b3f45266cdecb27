// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <optional>

#include "locfuse/estimators/scan_drive.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse::test_scan_drive {

using testing::expect_refused;
using testing::Rng;
using testing::scan_from;

constexpr Stamp kTenth = 100'000'000;

/// A circle of 0.8 m in a random room at 0.5 m/s, a scan every 0.1 s.
struct Circle {
  explicit Circle(std::uint64_t seed) : rng(seed) {
    const Pose2 middle = testing::random_pose(rng, 1.0);
    walls = testing::room_around(middle);
    truth = middle * Pose2{0.0, -0.8, 0.0};
  }

  LaserScan next() {
    truth = steps++ > 0 ? truth * motion : truth;
    LaserScan scan = scan_from(walls, truth, rng, 0.01);
    scan.stamp = steps * kTenth;
    return scan;
  }

  const Pose2 motion = arc(0.05, 0.0, 0.0625);
  Rng rng;
  testing::Walls walls;
  Pose2 truth;
  int steps = 0;
};

/// How far its end is off after 100 scans; wheels that report each step so much too long, or none.
double error_after(std::uint64_t seed, std::optional<double> wheels_scale) {
  Circle circle(seed);
  const Pose2 start = circle.truth;
  ScanDrive drive;
  Pose2 sum;
  for (int k = 0; k < 100; ++k) {
    const LaserScan scan = circle.next();
    if (wheels_scale && k > 0) {
      const Pose2 reported{*wheels_scale * circle.motion.x, *wheels_scale * circle.motion.y,
                           circle.motion.heading};
      drive.on(Increment{scan.stamp - kTenth, scan.stamp, reported, {}});
    }
    const std::optional<Increment> moved = drive.on(scan);
    EXPECT_EQ(moved.has_value(), k > 0);
    if (moved) {
      EXPECT_EQ(moved->begin, scan.stamp - kTenth);
      EXPECT_EQ(moved->stamp, scan.stamp);
      sum = sum * moved->motion;
    }
  }
  return ((start * sum).position() - circle.truth.position()).norm();
}

TEST(ScanDrive, follows_a_circle_with_and_without_wheels) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    EXPECT_LT(error_after(seed, 1.0), 0.03);
    EXPECT_LT(error_after(seed, 1.1), 0.03);  // wheels alone are 0.5 m off on their way of 5 m
    EXPECT_LT(error_after(seed, std::nullopt), 0.03);
  }
}

TEST(ScanDrive, a_velocity_of_the_wheels_is_a_guess_too) {
  Circle circle(3);
  const Pose2 start = circle.truth;
  ScanDrive drive;
  drive.on(Velocity{0, 0.5, 0.625, 0.0});
  Pose2 sum;
  for (int k = 0; k < 50; ++k) {
    const std::optional<Increment> moved = drive.on(circle.next());
    sum = moved ? sum * moved->motion : sum;
  }
  EXPECT_LT(((start * sum).position() - circle.truth.position()).norm(), 0.03);
}

/// How far its heading is off after 100 scans of 0.1 s each on the spot, at 1.5 rad/s [rad].
double turn_error(std::uint64_t seed, bool has_wheels, bool is_timed) {
  constexpr double kTurnRate = 1.5;
  constexpr int kBeams = 360;
  Circle circle(seed);
  LaserGeometry geometry = *testing::laser();
  const double each = 0.1 / kBeams;
  geometry.time_increment = is_timed ? each : 0.0;
  const auto shared = std::make_shared<const LaserGeometry>(geometry);
  ScanDrive drive;
  if (has_wheels) {
    drive.on(Velocity{0, 0.0, kTurnRate, 0.0});
  }
  double error = 0.0;
  for (int k = 0; k < 100; ++k) {
    LaserScan scan{k * kTenth, shared, {}};
    for (int i = 0; i < kBeams; ++i) {
      const double since_start = 0.1 * k + each * (i - 0.5 * (kBeams - 1));
      const Pose2 eye = circle.truth * Pose2{0.0, 0.0, kTurnRate * since_start};
      const double angle =
          (eye * geometry.pose_in_body).heading + geometry.angle_min + i * geometry.angle_increment;
      scan.ranges.push_back(
          testing::cast(circle.walls, eye.act(geometry.pose_in_body.position()), angle) +
          testing::normal(circle.rng, 0.01));
    }
    if (has_wheels) {
      drive.on(Velocity{scan.stamp, 0.0, kTurnRate, 0.0});
    }
    if (const std::optional<Increment> moved = drive.on(scan)) {
      error += moved->motion.heading - 0.1 * kTurnRate;
    }
  }
  return std::abs(error);
}

TEST(ScanDrive, beams_are_turned_to_where_the_body_was_at_the_stamp) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    for (const bool has_wheels : {false, true}) {
      EXPECT_LT(turn_error(seed, has_wheels, true), 0.03);
      EXPECT_GT(turn_error(seed, has_wheels, false), 0.1);
    }
  }
}

TEST(ScanDrive, what_is_late_is_left_out_and_a_copy_goes_on_the_same) {
  Circle circle(7);
  ScanDrive drive;
  const LaserScan first = circle.next();
  const LaserScan second = circle.next();
  const LaserScan third = circle.next();
  EXPECT_FALSE(drive.on(first));
  EXPECT_TRUE(drive.on(second));
  EXPECT_FALSE(drive.on(first));
  EXPECT_FALSE(drive.on(second));
  drive.on(Increment{0, kTenth, {0.05, 0.0, 0.0}, {}});
  ScanDrive copy = drive;
  drive.on(Increment{0, kTenth / 2, {5.0, 0.0, 0.0}, {}});  // before the end of the last
  const std::optional<Increment> moved = drive.on(third);
  const std::optional<Increment> again = copy.on(third);
  ASSERT_TRUE(moved && again);
  EXPECT_EQ(moved->motion.x, again->motion.x);
  EXPECT_EQ(moved->motion.heading, again->motion.heading);
}

TEST(ScanDrive, what_is_not_valid_is_refused_and_leaves_no_trace) {
  Circle circle(9);
  ScanDrive drive;
  (void)drive.on(circle.next());
  LaserScan bad = circle.next();
  ScanDrive copy = drive;
  bad.geometry = nullptr;
  expect_refused([&] { (void)drive.on(bad); }, "geometry");
  expect_refused([&] { drive.on(Velocity{kTenth, std::nan(""), 0.0, 0.0}); }, "forward");
  expect_refused([&] { drive.on(Increment{kTenth, 0, {}, {}}); }, "begins");
  const LaserScan scan = circle.next();
  EXPECT_EQ(drive.on(scan)->motion.x, copy.on(scan)->motion.x);
  ScanDrive::Config config;
  config.odometry.sigma_xy_per_sqrt_s = -1.0;
  expect_refused([&] { (void)ScanDrive(config); }, "sigma_xy_per_sqrt_s");
}

}  // namespace locfuse::test_scan_drive
