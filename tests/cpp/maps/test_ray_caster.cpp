// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "locfuse/maps/ray_caster.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;
using testing::Rng;
using testing::uniform;

constexpr double kNoHit = HUGE_VAL;

/// Rows from the top: # occupied, . free, ? unknown.
RayCaster caster(const std::vector<std::string>& rows, double resolution = 1.0,
                 const Pose2& origin = {}, bool unknown_stops = false) {
  std::vector<Cell> cells;
  for (auto row = rows.rbegin(); row != rows.rend(); ++row) {
    for (const char cell : *row) {
      cells.push_back(cell == '#' ? Cell::kOccupied : cell == '?' ? Cell::kUnknown : Cell::kFree);
    }
  }
  return RayCaster(std::make_shared<const OccupancyGrid>(static_cast<int>(rows[0].size()),
                                                         static_cast<int>(rows.size()), resolution,
                                                         origin, cells),
                   unknown_stops);
}

double degrees(double value) { return value * kPi / 180.0; }

TEST(RayCaster, beams_along_the_axes_end_at_the_face_of_the_wall) {
  const RayCaster cross = caster({"..#..",  //
                                  ".....",  //
                                  "#...#",  //
                                  ".....",  //
                                  "..#.."});
  const std::vector<double> ranges = cross.scan({2.25, 2.5, 0.0}, 0.0, degrees(90.0), 4, 10.0);
  EXPECT_NEAR(ranges[0], 1.75, 1e-15);
  EXPECT_NEAR(ranges[1], 1.5, 1e-15);
  EXPECT_NEAR(ranges[2], 1.25, 1e-15);
  EXPECT_NEAR(ranges[3], 1.5, 1e-15);
}

TEST(RayCaster, slanted_beams_end_where_their_line_meets_the_wall) {
  std::vector<std::string> rows(40, std::string(40, '.'));
  for (std::string& row : rows) {
    row.back() = '#';
  }
  const RayCaster wall = caster(rows, 0.05, {-1.0, -1.0, 0.0});
  for (const double angle : {0.7, 0.3, 0.01, 0.0, -0.2, -0.6}) {
    EXPECT_NEAR(wall.cast({0.013, 0.02}, angle, 10.0), (0.95 - 0.013) / std::cos(angle), 1e-14);
  }
}

TEST(RayCaster, no_beam_passes_the_corner_of_two_cells) {
  const RayCaster diagonal = caster({"#...",  //
                                     ".#..",  //
                                     "..#.",  //
                                     "...#"});
  EXPECT_NEAR(diagonal.cast({0.0, 0.0}, degrees(45.0), 10.0), std::sqrt(8.0), 1e-14);
  EXPECT_NEAR(diagonal.cast({4.0 - 1e-9, 4.0 - 1e-9}, degrees(-135.0), 10.0), std::sqrt(8.0), 1e-8);
  for (int i = 0; i < 1000; ++i) {
    const double angle = degrees(0.09 * i);
    EXPECT_LT(diagonal.cast({0.5, 0.5}, angle, 100.0), 6.0) << angle;
    EXPECT_LT(diagonal.cast({3.5, 3.5}, angle - kPi, 100.0), 6.0) << angle;
  }
}

TEST(RayCaster, a_start_on_a_boundary_is_in_the_cell_of_the_higher_coordinate) {
  const RayCaster two = caster({".#."});
  EXPECT_EQ(two.cast({1.0, 0.5}, kPi, 10.0), 0.0);
  EXPECT_EQ(two.cast({2.0, 0.5}, 0.0, 10.0), kNoHit);
  EXPECT_EQ(two.cast({2.0, 0.5}, kPi, 10.0), 0.0);
  EXPECT_NEAR(two.cast({0.0, 0.5}, 0.0, 10.0), 1.0, 1e-15);
  EXPECT_EQ(two.cast({1.5, 0.5}, 2.0, 0.0), 0.0);  // in the wall
}

/// 0 times an infinite distance to an edge was NaN.
TEST(RayCaster, a_beam_whose_slope_has_no_inverse_goes_along_the_axis) {
  const RayCaster wall = caster({"...#"});
  for (const double heading : {-1e-310, 0.0, 1e-310}) {
    EXPECT_EQ(wall.cast({2.5, 0.0}, heading, HUGE_VAL), 0.5) << heading;
  }
}

TEST(RayCaster, a_beam_may_come_from_outside_of_the_map) {
  const RayCaster one = caster({"...",  //
                                ".#.",  //
                                "..."});
  EXPECT_NEAR(one.cast({-5.0, 1.5}, 0.0, 10.0), 6.0, 1e-14);
  EXPECT_NEAR(one.cast({8.0, 1.5}, kPi, 10.0), 6.0, 1e-14);
  EXPECT_NEAR(one.cast({1.5, -3.0}, degrees(90.0), 10.0), 4.0, 1e-14);
  EXPECT_EQ(one.cast({-5.0, 1.5}, kPi, 10.0), kNoHit);
  EXPECT_EQ(one.cast({-5.0, 3.0}, 0.0, 10.0), kNoHit);
  EXPECT_EQ(one.cast({-5.0, 0.5}, 0.0, kNoHit), kNoHit);
  // Off the map again, before it is as high as the occupied cell.
  EXPECT_EQ(caster({"#...", "....", "....", "...."}).cast({0.5, 0.5}, degrees(120.0), 9.0), kNoHit);
}

TEST(RayCaster, casts_on_a_rotated_map) {
  std::string row(40, '.');
  row[30] = '#';
  const RayCaster turned = caster({row}, 0.1, {5.0, -2.0, kPi / 2.0});  // its x axis points north
  // The cell spans x from 4.9 to 5.0 and y from 1.0 to 1.1.
  EXPECT_NEAR(turned.cast({4.95, -1.5}, kPi / 2.0, 10.0), 2.5, 1e-14);
  EXPECT_NEAR(turned.cast({9.0, 1.05}, kPi, 10.0), 4.0, 1e-14);
  EXPECT_EQ(turned.cast({9.0, 1.15}, kPi, 10.0), kNoHit);
}

TEST(RayCaster, unknown_cells_pass_or_stop_beams) {
  const std::vector<std::string> rows = {"..??.#"};
  EXPECT_NEAR(caster(rows).cast({0.5, 0.5}, 0.0, 10.0), 4.5, 1e-14);
  EXPECT_NEAR(caster(rows, 1.0, {}, true).cast({0.5, 0.5}, 0.0, 10.0), 1.5, 1e-14);
}

TEST(RayCaster, a_beam_ends_at_its_maximum_range) {
  const RayCaster wall = caster({"....#"});
  EXPECT_EQ(wall.cast({0.5, 0.5}, 0.0, 3.5), 3.5);
  EXPECT_EQ(wall.cast({0.5, 0.5}, 0.0, 3.4999), kNoHit);
  EXPECT_EQ(wall.cast({0.5, 0.5}, 0.0, kNoHit), 3.5);
}

RayCaster random_caster(Rng& rng, bool unknown_stops) {
  const double walls = uniform(rng, 0.0, 1.0) < 0.5 ? 0.1 : 0.005;
  std::vector<Cell> cells(60 * 45);
  for (Cell& cell : cells) {
    const double drawn = uniform(rng, 0.0, 1.0);
    cell = drawn < walls ? Cell::kOccupied : drawn < 1.5 * walls ? Cell::kUnknown : Cell::kFree;
  }
  const Pose2 origin{-1.3, 0.4, uniform(rng, -3.0, 3.0)};
  return RayCaster(std::make_shared<const OccupancyGrid>(60, 45, 0.05, origin, cells),
                   unknown_stops);
}

/// Distance to the nearest square that stops a beam, by the slab method.
double by_brute_force(const OccupancyGrid& grid, bool unknown_stops, const Vector<2>& p_world,
                      double heading) {
  const Vector<2> p = grid.to_grid(p_world);
  const double angle = heading - grid.origin().heading;
  const Eigen::Array2d per(1.0 / std::cos(angle), 1.0 / std::sin(angle));
  double nearest = kNoHit;
  for (int row = 0; row < grid.height(); ++row) {
    for (int column = 0; column < grid.width(); ++column) {
      const Cell cell = grid.at(column, row);
      if (cell == Cell::kFree || (cell == Cell::kUnknown && !unknown_stops)) {
        continue;
      }
      const Eigen::Array2d first = (Eigen::Array2d(column, row) - p.array()) * per;
      const Eigen::Array2d second = first + per;
      const double enters = first.min(second).maxCoeff();
      const double leaves = first.max(second).minCoeff();
      if (enters <= leaves && leaves >= 0.0) {
        nearest = std::min(nearest, std::max(enters, 0.0));
      }
    }
  }
  return nearest * grid.resolution();
}

TEST(RayCaster, equals_the_nearest_face_of_all_squares) {
  int hits = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const bool unknown_stops = seed % 2 == 0;
    const RayCaster rays = random_caster(rng, unknown_stops);
    for (int i = 0; i < 150; ++i) {
      const Vector<2> p =
          rays.grid().to_world({uniform(rng, -30.0, 90.0), uniform(rng, -20.0, 65.0)});
      const double heading = uniform(rng, -7.0, 7.0);
      const double expected = by_brute_force(rays.grid(), unknown_stops, p, heading);
      const double range = rays.cast(p, heading, 2.5);
      if (expected > 2.5) {
        ASSERT_EQ(range, kNoHit) << seed << " " << i << " " << expected;
      } else {
        ASSERT_NEAR(range, expected, 1e-12) << seed << " " << i;
        ++hits;
      }
    }
  }
  EXPECT_GT(hits, 500);
}

TEST(RayCaster, small_steps_enter_a_wall_only_at_the_range) {
  Rng rng(7);
  const RayCaster rays = random_caster(rng, false);
  const Pose2 laser{-1.0, 1.0, 0.3};
  const std::vector<double> ranges = rays.scan(laser, -3.0, 0.033, 180, 3.0);
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const double angle = laser.heading - 3.0 + 0.033 * static_cast<double>(i);
    const Vector<2> along(std::cos(angle), std::sin(angle));
    const auto at = [&](double range) {
      return rays.grid().at(Vector<2>(laser.position() + range * along));
    };
    for (double step = 0.0; step < std::min(ranges[i], 3.0) - 1e-9; step += 2e-3) {
      ASSERT_NE(at(step), Cell::kOccupied) << i << " at " << step;
    }
    if (ranges[i] < 3.0) {
      ASSERT_EQ(at(ranges[i] + 1e-9), Cell::kOccupied) << i;
    }
  }
}

TEST(RayCaster, crosses_a_map_larger_than_its_count_of_rings) {
  std::vector<Cell> cells(1000 * 700, Cell::kFree);
  cells[1000 * 600 + 900] = Cell::kOccupied;
  const RayCaster rays(std::make_shared<const OccupancyGrid>(1000, 700, 1.0, Pose2{}, cells));
  const double angle = std::atan2(600.5 - 0.5, 900.5 - 0.5);
  EXPECT_NEAR(rays.cast({0.5, 0.5}, angle, kNoHit), 899.5 / std::cos(angle), 1e-10);
  EXPECT_EQ(rays.cast({0.5, 0.5}, angle + 0.002, kNoHit), kNoHit);
}

TEST(RayCaster, rejects_a_missing_map) {
  expect_refused([] { (void)RayCaster(nullptr); }, "RayCaster has no map");
}

TEST(RayCaster, rejects_numbers_that_are_not_finite) {
  const RayCaster rays = caster({".#"});
  const double nan = std::nan("");
  expect_refused([&] { (void)rays.cast({nan, 0.0}, 0.0, 1.0); }, "position is (nan");
  expect_refused([&] { (void)rays.cast({0.0, -HUGE_VAL}, 0.0, 1.0); }, "-inf");
  expect_refused([&] { (void)rays.cast({1e300, 0.0}, 0.0, kNoHit); }, "1e9 cells");
  expect_refused([&] { (void)rays.cast({0.0, 0.0}, nan, 1.0); }, "heading is nan rad");
  expect_refused([&] { (void)rays.cast({0.0, 0.0}, 0.0, nan); }, "max_range is nan m");
  expect_refused([&] { (void)rays.cast({0.0, 0.0}, 0.0, -1.0); }, "max_range is -1");
  expect_refused([&] { (void)rays.scan({0.0, 0.0, nan}, 0.0, 0.1, 3, 1.0); }, "heading");
  expect_refused([&] { (void)rays.scan({}, nan, 0.1, 3, 1.0); }, "angle_min");
  expect_refused([&] { (void)rays.scan({}, 0.0, HUGE_VAL, 3, 1.0); }, "angle_increment is inf");
  expect_refused([&] { (void)rays.scan({}, 1e308, 1e308, 3, 1.0); }, "heading is inf");
  expect_refused([&] { (void)rays.scan({}, 0.0, 0.1, -1, 1.0); }, "count is -1");
  expect_refused([&] { (void)rays.scan({}, 0.0, 0.1, 2147483647, 1.0); }, "count is 2147483647");
  EXPECT_TRUE(rays.scan({}, 0.0, 0.1, 0, 1.0).empty());
}

}  // namespace
}  // namespace locfuse
