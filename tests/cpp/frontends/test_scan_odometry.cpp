// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "locfuse/frontends/scan_odometry.hpp"
#include "support/expect.hpp"
#include "support/lasers.hpp"

namespace locfuse {
namespace {

using testing::expect_pose_near;
using testing::expect_refused;
using testing::is_covariance;
using testing::normal;
using testing::Rng;
using testing::scan_from;

constexpr Stamp kTenth = 100'000'000;

Matrix<3, 3> covariance_of_step() { return Vector<3>(0.01, 0.005, 0.01).cwiseAbs2().asDiagonal(); }

/// A circle of 0.8 m in a random room, 5 cm per tenth of a second, with noisy wheels.
struct Drive {
  Drive(std::uint64_t seed, const ScanOdometryConfig& config) : rng(seed), odometry(config) {
    const Pose2 middle = testing::random_pose(rng, 1.0);
    walls = testing::room_around(middle);
    truth = start = middle * Pose2{0.0, -0.8, 0.0};
  }

  ScanMotion step() {
    const Pose2 motion = steps++ > 0 ? arc(0.05, 0.0, 0.0625) : Pose2{};
    truth = truth * motion;
    const Pose2 reported =
        retract(motion, {normal(rng, 0.01), normal(rng, 0.005), normal(rng, 0.01)});
    LaserScan scan = scan_from(walls, truth, rng, 0.01);
    scan.stamp = steps * kTenth;
    wheels = steps > 1 ? wheels * reported : wheels;
    return odometry.on(scan, reported, covariance_of_step());
  }

  Rng rng;
  testing::Walls walls;
  Pose2 start, truth, wheels;
  int steps = 0;
  ScanOdometry odometry;
};

TEST(ScanOdometry, follows_a_circle_better_than_the_wheels) {
  for (const int window : {1, 10}) {
    ScanOdometryConfig config;
    config.window_scans = window;
    double ours = 0.0;
    double wheels = 0.0;
    for (std::uint64_t seed = 0; seed < 2; ++seed) {
      Drive drive(seed, config);
      Pose2 sum;
      for (int k = 0; k < 100; ++k) {
        const ScanMotion result = drive.step();
        sum = sum * result.increment.motion;
        expect_pose_near(sum, result.pose, 1e-9);
        EXPECT_EQ(result.increment.stamp - result.increment.begin, k > 0 ? kTenth : 0);
        EXPECT_EQ(result.match.converged, k > 0);
      }
      const Vector<2> way = (inverse(drive.start) * drive.truth).position();
      ours = std::max(ours, (sum.position() - way).norm());
      wheels = std::max(wheels, (drive.wheels.position() - way).norm());
    }
    EXPECT_LT(ours, 0.03) << window;
    EXPECT_GT(wheels, 0.06);
  }
}

/// Mean squared error of T_key_body in units of the covariance, for one scan after each key scan,
/// as scans of one key scan share its noise.
double nees_to_key(const ScanOdometryConfig& config) {
  double sum = 0.0;
  int count = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Drive drive(seed, config);
    std::vector<Pose2> truth;
    Stamp compared = 0;
    for (int k = 0; k < 25; ++k) {
      const ScanMotion result = drive.step();
      truth.push_back(drive.truth);
      EXPECT_TRUE(is_covariance(result.covariance));
      const Pose2 key = truth[static_cast<std::size_t>(result.key / kTenth) - 1];
      const Pose2 in_key = inverse(key) * drive.truth;
      if (result.key != compared && std::hypot(in_key.x, in_key.y) > 0.12) {
        const Vector<3> e = local(result.match.pose, in_key);
        sum += e.dot(result.covariance.llt().solve(e));
        compared = result.key;
        ++count;
      }
    }
  }
  EXPECT_GE(count, 160);
  return sum / count;
}

// 99 % of the mean of 160 draws of three degrees of freedom.
constexpr double kLow = 2.52;
constexpr double kHigh = 3.52;

TEST(ScanOdometry, errors_since_a_single_key_scan_match_the_covariance) {
  ScanOdometryConfig config;
  config.window_scans = 1;
  const double found = nees_to_key(config);
  EXPECT_GT(found, kLow);
  EXPECT_LT(found, kHigh);
}

TEST(ScanOdometry, with_ten_key_scans_sigmas_are_too_small_by_at_most_a_tenth) {
  // Over 250 drives: 3.5 where 3 is exact, as the poses of older key scans are assumed to be known.
  const double found = nees_to_key({});
  EXPECT_GT(found, kLow);
  EXPECT_LT(found, 1.1 * 1.1 * kHigh);
}

TEST(ScanOdometry, along_a_corridor_it_follows_the_wheels) {
  testing::Walls corridor;
  testing::add_box(corridor, {0.0, 0.0, 0.0}, 400.0, 2.0);
  Rng rng(1);
  ScanOdometry odometry;
  ScanMotion result;
  for (int k = 0; k < 30; ++k) {
    LaserScan scan = scan_from(corridor, {0.1 * k, 0.2, 0.0}, rng, 0.01);
    scan.stamp = k;
    result = odometry.on(scan, {0.11, 0.01, 0.01}, covariance_of_step());
  }
  EXPECT_NEAR(result.pose.x, 29 * 0.11, 0.01);
  EXPECT_NEAR(result.pose.y, 0.0, 0.02);
  EXPECT_NEAR(result.pose.heading, 0.0, 0.01);
  ASSERT_TRUE(result.match.weak_direction);
  EXPECT_GT(std::abs(result.match.weak_direction->x()), 0.999);
  EXPECT_GT(result.covariance(0, 0), 0.01 * 0.01);
  EXPECT_LT(result.covariance(1, 1), 0.005 * 0.005);
}

TEST(ScanOdometry, wheels_that_miss_a_turn_do_not_prevent_it) {
  // On wean_hall odometry reports no motion for a moment while the robot turns by 4 degrees. With a
  // sigma of a milliradian it kept the fit at its start.
  Drive drive(3, {});
  drive.step();
  const Pose2 turn{0.0, 0.0, 0.07};
  LaserScan scan = scan_from(drive.walls, drive.start * turn, drive.rng, 0.01);
  scan.stamp = 2 * kTenth;
  const ScanMotion result = drive.odometry.on(scan, {}, Matrix<3, 3>::Zero());
  EXPECT_NEAR(result.increment.motion.heading, 0.07, 0.003);
}

TEST(ScanOdometry, without_returns_the_motion_is_that_of_the_wheels) {
  Drive drive(4, {});
  LaserScan silent = scan_from(drive.walls, drive.start, drive.rng, 0.01);
  silent.ranges.assign(100, 12.0);
  silent.stamp = 1;
  EXPECT_EQ(drive.odometry.on(silent, {}, covariance_of_step()).match.reason,
            ScanMatch::Reason::kNoReturns);
  LaserScan scan = scan_from(drive.walls, drive.start, drive.rng, 0.01);
  scan.stamp = 2;
  const Pose2 motion{0.1, 0.0, 0.2};
  ScanMotion result = drive.odometry.on(scan, motion, covariance_of_step());  // the first key scan
  EXPECT_EQ(result.match.reason, ScanMatch::Reason::kTooFewMatches);
  expect_pose_near(result.pose, motion, 1e-12);
  Matrix<3, 3> before = covariance_of_step();
  for (Stamp stamp = 3; stamp < 8; ++stamp) {
    silent.stamp = stamp;
    result = drive.odometry.on(silent, motion, covariance_of_step());
    EXPECT_EQ(result.match.reason, ScanMatch::Reason::kNoReturns);
    EXPECT_EQ(result.key, 2);
    expect_pose_near(result.increment.motion, motion, 1e-12);
    EXPECT_TRUE(is_covariance(result.covariance));
    EXPECT_GT((result.covariance - before).trace(), 0.0);
    before = result.covariance;
  }
}

TEST(ScanOdometry, starts_a_new_map_where_a_scan_does_not_match) {
  Drive drive(5, {});
  drive.step();
  testing::Walls elsewhere;
  testing::add_box(elsewhere, {0.0, 0.0, 0.0}, 40.0, 30.0);
  testing::add_box(elsewhere, {3.0, 2.0, 0.0}, 1.0, 1.0);
  ScanMotion result;
  for (int k = 2; k < 4; ++k) {
    LaserScan scan =
        scan_from(elsewhere, {0.4 * k, 0.0, 0.0}, drive.rng, 0.01, testing::laser(360, 50));
    scan.stamp = k * kTenth;
    result = drive.odometry.on(scan, {0.4, 0.0, 0.0}, covariance_of_step());
  }
  EXPECT_TRUE(result.match.converged);
  EXPECT_EQ(result.key, 2 * kTenth);
  EXPECT_GT(result.match.explained, 0.95);
  EXPECT_NEAR(result.pose.x, 0.8, 0.02);
}

TEST(ScanOdometry, a_scan_of_another_laser_at_the_same_stamp_is_in_the_map_from_then_on) {
  Drive drive(7, {});
  const auto look = [&](ScanOdometry& odometry, const Pose2& mount, Stamp stamp) {
    LaserScan scan = testing::half_scan(drive.walls, drive.truth, drive.rng, 0.01, mount);
    scan.stamp = stamp;
    return odometry.on(scan, {}, Matrix<3, 3>::Zero());
  };
  look(drive.odometry, testing::kFront, 1);
  expect_refused([&] { look(drive.odometry, testing::kFront, 1); }, "1 ns", "later");
  ScanOdometry without = drive.odometry;
  const ScanMotion second = look(drive.odometry, testing::kRear, 1);
  EXPECT_EQ(second.increment.begin, second.increment.stamp);
  EXPECT_EQ(second.key, 1);
  expect_refused([&] { look(drive.odometry, testing::kRear, 1); }, "1 ns", "later");
  expect_refused([&] { look(drive.odometry, testing::kFront, 1); }, "1 ns", "later");
  EXPECT_GT(look(drive.odometry, testing::kRear, 2).match.explained, 0.9);
  EXPECT_LT(look(without, testing::kRear, 2).match.explained, 0.6);
}

TEST(ScanOdometry, with_a_window_of_one_scan_each_laser_has_one) {
  ScanOdometryConfig config;
  config.window_scans = 1;
  Drive drive(8, config);
  const Pose2 motion = arc(0.05, 0.0, 0.0625);
  for (int k = 0; k < 60; ++k) {
    drive.truth = k > 0 ? drive.truth * motion : drive.truth;
    LaserScan scan = testing::half_scan(drive.walls, drive.truth, drive.rng, 0.01,
                                        k % 2 == 0 ? testing::kFront : testing::kRear);
    scan.stamp = k;
    const ScanMotion result =
        drive.odometry.on(scan, k > 0 ? motion : Pose2{}, covariance_of_step());
    if (k > 1) {
      EXPECT_TRUE(result.match.converged) << k;
      EXPECT_GT(result.match.explained, 0.6) << k;
    }
  }
}

TEST(ScanOdometry, rejects_invalid_input_and_stays_unchanged) {
  Drive drive(6, {});
  drive.step();
  ScanOdometry before = drive.odometry;
  LaserScan scan = scan_from(drive.walls, drive.truth, drive.rng, 0.01);
  scan.stamp = kTenth;
  const Matrix<3, 3> Q = covariance_of_step();
  const auto expect = [&](const LaserScan& given, const Pose2& motion, const Matrix<3, 3>& noise,
                          const auto&... words) {
    expect_refused([&] { drive.odometry.on(given, motion, noise); }, words...);
  };
  expect(scan, {}, Q, "100000000 ns", "later");
  scan.stamp = 2 * kTenth;
  expect(scan, {0.0, std::nan(""), 0.0}, Q, "motion.y", "nan");
  expect(scan, {1e9, 0.0, 0.0}, Q, "guess", "1e+09");
  expect(scan, {}, -Q, "semidefinite");
  LaserScan broken = scan;
  broken.geometry.reset();
  expect(broken, {}, Q, "geometry");
  EXPECT_TRUE(testing::same_bits(drive.odometry.on(scan, {}, Q).covariance,
                                 before.on(scan, {}, Q).covariance));

  ScanOdometryConfig config;
  config.window_scans = 0;
  expect_refused([&] { ScanOdometry{config}; }, "window_scans is 0", "1 or more");
  config = {};
  config.window_m = 1e7;  // a scan from that far would be refused, after others had been dropped
  expect_refused([&] { ScanOdometry{config}; }, "window_m is 1e+07", "less than a million");
  config = {};
  config.key_turn_rad = -1.0;
  expect_refused([&] { ScanOdometry{config}; }, "key_turn_rad is -1", ">= 0");
  config = {};
  config.least_sigma_m = 0.0;
  expect_refused([&] { ScanOdometry{config}; }, "least_sigma_m is 0", ">= 1e-6");
  config = {};
  config.map.max_iterations = 0;
  expect_refused([&] { ScanOdometry{config}; }, "max_iterations is 0");
}

}  // namespace
}  // namespace locfuse
