// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "locfuse/smoothing/scan_mapper.hpp"
#include "support/expect.hpp"
#include "support/lasers.hpp"

namespace locfuse {
namespace {

using testing::add_box;
using testing::expect_refused;
using testing::half_scan;
using testing::kFront;
using testing::kRear;
using testing::normal;
using testing::Rng;
using testing::scan_from;
using testing::Walls;

constexpr Stamp kStep = 400'000'000;

/// A corridor of 2 m around a block of 16 x 9 m, with niches and pillars that differ.
Walls floor_with_a_block() {
  Walls walls;
  add_box(walls, {}, 20.0, 13.0);
  add_box(walls, {}, 16.0, 9.0);
  add_box(walls, {-6.0, 6.2, 0.0}, 0.8, 0.4);
  add_box(walls, {1.0, 6.3, 0.0}, 1.6, 0.3);
  add_box(walls, {6.5, 4.7, 0.3}, 0.5, 0.4);
  add_box(walls, {9.7, 2.0, 0.0}, 0.4, 1.1);
  add_box(walls, {8.2, -2.4, 0.0}, 0.3, 0.3);
  add_box(walls, {3.5, -6.2, 0.0}, 0.5, 0.5);
  add_box(walls, {-3.0, -4.6, 0.0}, 1.2, 0.2);
  add_box(walls, {-9.6, -1.0, 0.0}, 0.6, 0.7);
  return walls;
}

/// A drive around the block by wheels that turn too far, and what a laser sees.
struct Drive {
  Drive(const Walls& walls, std::uint64_t seed, int corners, bool two_lasers = false) {
    Rng rng(seed);
    truth.push_back({-9.0, -5.5, 0.0});
    const double sides[] = {18.0, 11.0};
    see(walls, rng, two_lasers);
    for (int corner = 0; corner < corners; ++corner) {
      const int steps = static_cast<int>(sides[corner % 2] / 0.2);
      for (int k = 0; k < steps; ++k) {
        step(walls, rng, {0.2, 0.0, 0.0}, two_lasers);
      }
      for (int k = 0; k < 8; ++k) {
        step(walls, rng, {0.0, 0.0, kPi / 16.0}, two_lasers);
      }
    }
    for (int k = 0; k < 30; ++k) {
      step(walls, rng, {0.2, 0.0, 0.0}, two_lasers);
    }
  }

  void step(const Walls& walls, Rng& rng, const Pose2& motion, bool two_lasers) {
    const double along = std::abs(motion.x);
    const double turn = std::abs(motion.heading);
    const Pose2 reported{motion.x + normal(rng, 0.02 * std::sqrt(along)),
                         normal(rng, 0.01 * std::sqrt(along)),
                         1.05 * motion.heading + 0.004 * along +
                             normal(rng, 0.01 * std::sqrt(along) + 0.02 * std::sqrt(turn))};
    const Stamp begin = static_cast<Stamp>(truth.size() - 1) * kStep;
    // Wheels report each motion in two halves.
    const Pose2 half = arc_share(reported, 0.5);
    messages.emplace_back(Increment{begin, begin + kStep / 2, half});
    messages.emplace_back(Increment{begin + kStep / 2, begin + kStep, inverse(half) * reported});
    wheels = wheels * reported;
    truth.push_back(truth.back() * motion);
    see(walls, rng, two_lasers);
  }

  void see(const Walls& walls, Rng& rng, bool two_lasers) {
    const Stamp stamp = static_cast<Stamp>(truth.size() - 1) * kStep;
    if (two_lasers) {
      for (const Pose2& mount : {kFront, kRear}) {
        LaserScan scan = half_scan(walls, truth.back(), rng, 0.01, mount);
        scan.stamp = stamp;
        messages.emplace_back(scan);
      }
      return;
    }
    LaserScan scan = scan_from(walls, truth.back(), rng, 0.01);
    scan.stamp = stamp;
    messages.emplace_back(scan);
  }

  [[nodiscard]] ScanMapperConfig config() const {
    ScanMapperConfig config;
    config.start = {0, truth.front(), 1e-12 * Matrix<3, 3>::Identity()};
    return config;
  }

  /// Largest error of a pose at a scan [m], by the map.
  [[nodiscard]] double error(const ScanMapping& made) const {
    double worst = 0.0;
    for (const PoseEstimate& estimate : made.poses) {
      if (estimate.stamp % kStep == 0) {
        const Pose2& exact = truth[static_cast<std::size_t>(estimate.stamp / kStep)];
        worst = std::max(worst, (estimate.pose.position() - exact.position()).norm());
      }
    }
    return worst;
  }

  std::vector<Pose2> truth;
  std::vector<Message> messages;
  Pose2 wheels;
};

/// Share of the cells of a map that are within two cells of what they should be.
double likeness(const OccupancyGrid& grid, const Walls& walls) {
  const auto exact = testing::map_of(walls, 440, 300, 0.05, {-11.0, -7.5, 0.0});
  double right = 0.0;
  double all = 0.0;
  for (int row = 0; row < grid.height(); ++row) {
    for (int column = 0; column < grid.width(); ++column) {
      if (grid.at(column, row) == Cell::kOccupied) {
        const Vector<2> at = exact->to_grid(grid.center(column, row));
        bool is_near = false;
        for (int i = -2; i <= 2; ++i) {
          for (int k = -2; k <= 2; ++k) {
            is_near =
                is_near || exact->at(static_cast<int>(std::floor(at.x())) + i,
                                     static_cast<int>(std::floor(at.y())) + k) == Cell::kOccupied;
          }
        }
        right += is_near ? 1.0 : 0.0;
        all += 1.0;
      }
    }
  }
  return right / all;
}

TEST(ScanMapper, closes_the_way_around_a_block) {
  const Walls walls = floor_with_a_block();
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const Drive drive(walls, seed, 4);
    const ScanMapping made = map_scans(drive.config(), drive.messages);
    const Pose2 by_wheels = drive.truth.front() * drive.wheels;
    EXPECT_GT((by_wheels.position() - drive.truth.back().position()).norm(), 1.0);
    EXPECT_LT(drive.error(made), 0.15) << seed;
    EXPECT_GT(likeness(made.grid, walls), 0.97) << seed;
    EXPECT_GE(made.loops.size(), 5U);
    for (const ScanLoop& loop : made.loops) {
      EXPECT_TRUE(loop.kept);
      const auto from = static_cast<std::size_t>(loop.from / kStep);
      const auto to = static_cast<std::size_t>(loop.to / kStep);
      testing::expect_pose_near(loop.motion, inverse(drive.truth[from]) * drive.truth[to], 0.06);
    }
    EXPECT_EQ(made.scans, drive.truth.size());
    EXPECT_EQ(made.unmatched, 0U);
    EXPECT_EQ(made.weak, 0U);
    // One estimate a scan, and one for the wheels between two.
    EXPECT_EQ(made.poses.size(), 2 * drive.truth.size() - 1);
    for (std::size_t i = 1; i < made.poses.size(); ++i) {
      EXPECT_LT(made.poses[i - 1].stamp, made.poses[i].stamp);
    }
    // The covariance covers the error, in the middle of the way where it is largest.
    const PoseEstimate& middle = made.poses[made.poses.size() / 2 / 2 * 2];
    const Vector<3> off =
        local(middle.pose, drive.truth[static_cast<std::size_t>(middle.stamp / kStep)]);
    EXPECT_LT(off.dot(middle.covariance.llt().solve(off)), 11.3) << seed;  // 99 %
    EXPECT_LT(std::sqrt(middle.covariance(0, 0)), 1.0);
  }
}

TEST(ScanMapper, order_of_messages_and_a_second_call_change_nothing) {
  const Drive drive(floor_with_a_block(), 5, 1);
  const ScanMapping made = map_scans(drive.config(), drive.messages);
  std::vector<Message> reversed(drive.messages.rbegin(), drive.messages.rend());
  const ScanMapping again = map_scans(drive.config(), reversed);
  EXPECT_EQ(made.grid.cells(), again.grid.cells());
  ASSERT_EQ(made.poses.size(), again.poses.size());
  for (std::size_t i = 0; i < made.poses.size(); ++i) {
    testing::expect_pose_near(made.poses[i].pose, again.poses[i].pose, 0.0);
  }
}

TEST(ScanMapper, two_lasers_that_see_half_map_as_one_that_sees_all) {
  const Walls walls = floor_with_a_block();
  const Drive drive(walls, 1, 4, true);
  const ScanMapping made = map_scans(drive.config(), drive.messages);
  EXPECT_LT(drive.error(made), 0.15);
  EXPECT_GT(likeness(made.grid, walls), 0.97);
  EXPECT_GE(made.loops.size(), 5U);
}

TEST(ScanMapper, no_loop_is_seen_where_there_is_none) {
  const Drive drive(floor_with_a_block(), 2, 2);
  const ScanMapping made = map_scans(drive.config(), drive.messages);
  EXPECT_TRUE(made.loops.empty());
  const Matrix<2, 2> P = made.poses.back().covariance.topLeftCorner<2, 2>();
  const double sigma = std::sqrt(Eigen::SelfAdjointEigenSolver<Matrix<2, 2>>(P).eigenvalues()(1));
  EXPECT_GT(sigma, 0.05);
  EXPECT_LT(drive.error(made), 3.0 * sigma);
}

TEST(ScanMapper, a_robot_that_stands_shows_one_place) {
  const Walls walls = floor_with_a_block();
  Drive drive(walls, 3, 0);
  drive.messages.clear();
  drive.truth.resize(1);
  Rng rng(3);
  for (int k = 0; k < 20; ++k) {
    LaserScan scan = scan_from(walls, drive.truth.front(), rng, 0.01);
    scan.stamp = k * kStep;
    drive.messages.emplace_back(scan);
  }
  const ScanMapping made = map_scans(drive.config(), drive.messages);
  EXPECT_EQ(made.keys, 1U);
  EXPECT_EQ(made.scans, 20U);
  testing::expect_pose_near(made.poses.back().pose, drive.truth.front(), 0.02);
}

TEST(ScanMapper, continues_an_old_map_and_shows_what_changed) {
  Walls before = floor_with_a_block();
  const Drive first(before, 0, 4);
  ScanMapperConfig config = first.config();
  const auto old = std::make_shared<const OccupancyGrid>(map_scans(config, first.messages).grid);
  Walls after = before;
  after.resize(after.size() - 4);  // the last box is gone
  add_box(after, {-2.0, -6.2, 0.0}, 0.6, 0.4);
  const Drive second(after, 8, 4);
  config = second.config();
  config.onto = old;
  config.start.pose = second.truth.front() * Pose2{0.3, -0.2, 0.1};
  config.start.covariance = Vector<3>(0.3, 0.3, 0.1).cwiseAbs2().asDiagonal();
  const ScanMapping made = map_scans(config, second.messages);
  EXPECT_LT(second.error(made), 0.1);
  EXPECT_GT(std::count_if(made.loops.begin(), made.loops.end(),
                          [](const ScanLoop& loop) { return loop.is_on_map && loop.kept; }),
            30);
  EXPECT_EQ(made.grid.at(Vector<2>(-9.6, -1.0)), Cell::kFree);
  const auto walls_around = [&](const OccupancyGrid& grid, const Vector<2>& at) {
    int count = 0;
    for (int i = -4; i <= 4; ++i) {
      for (int k = -8; k <= 8; ++k) {
        count += grid.at(Vector<2>(at + 0.05 * Vector<2>(k, i))) == Cell::kOccupied ? 1 : 0;
      }
    }
    return count;
  };
  EXPECT_GE(walls_around(made.grid, {-2.0, -6.0}), 8);
  EXPECT_LE(walls_around(*old, {-2.0, -6.0}), 2);
  EXPECT_GT(likeness(made.grid, after), 0.95);
}

TEST(ScanMapper, reports_progress_and_can_be_stopped) {
  const Drive drive(floor_with_a_block(), 4, 1);
  std::vector<double> shares;
  (void)map_scans(drive.config(), drive.messages, [&](double share) { shares.push_back(share); });
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_LT(shares.front(), 0.1);
  EXPECT_GT(shares.back(), 0.8);
  EXPECT_LE(shares.back(), 1.0);
  EXPECT_THROW((void)map_scans(drive.config(), drive.messages,
                               [](double /*share*/) { throw std::runtime_error("stop"); }),
               std::runtime_error);
}

TEST(ScanMapper, refuses_what_shows_nothing) {
  const Drive drive(floor_with_a_block(), 4, 0);
  expect_refused([&] { (void)map_scans(drive.config(), {}); }, "there are none");
  std::vector<Message> blind;
  for (int k = 0; k < 3; ++k) {
    blind.emplace_back(
        LaserScan{k * kStep, testing::laser(),
                  std::vector<double>(360, std::numeric_limits<double>::quiet_NaN())});
  }
  expect_refused([&] { (void)map_scans(drive.config(), blind); }, "no scan has a return");
  ScanMapperConfig config = drive.config();
  config.resolution_m = 0.0;
  expect_refused([&] { (void)map_scans(config, drive.messages); }, "resolution");
}

}  // namespace
}  // namespace locfuse
