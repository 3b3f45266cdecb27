// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "locfuse/frontends/grid_drawing.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse {
namespace {

using testing::add_box;
using testing::expect_refused;
using testing::Rng;
using testing::scan_from;
using testing::Walls;

/// Scans from places along a line through a room of 8 x 6 m.
std::vector<PlacedScan> drive(const Walls& walls, Rng& rng, int scans = 12) {
  std::vector<PlacedScan> placed;
  for (int k = 0; k < scans; ++k) {
    const Pose2 body{-2.0 + 0.3 * k, -0.4 + 0.05 * k, 0.2 * k};
    placed.push_back({scan_from(walls, body, rng, 0.01), body});
  }
  return placed;
}

Walls room() {
  Walls walls;
  add_box(walls, {}, 8.0, 6.0);
  return walls;
}

int occupied_in(const OccupancyGrid& grid, const Vector<2>& low, const Vector<2>& high) {
  int count = 0;
  for (double x = low.x(); x < high.x(); x += grid.resolution()) {
    for (double y = low.y(); y < high.y(); y += grid.resolution()) {
      count += grid.at(Vector<2>(x, y)) == Cell::kOccupied ? 1 : 0;
    }
  }
  return count;
}

TEST(GridDrawing, walls_are_occupied_and_rooms_free) {
  Rng rng(1);
  const OccupancyGrid grid = draw_grid(drive(room(), rng), 0.05);
  EXPECT_NEAR(grid.width() * 0.05, 8.1, 0.15);
  EXPECT_NEAR(grid.height() * 0.05, 6.1, 0.15);
  for (double x = -3.8; x < 3.8; x += 0.05) {
    EXPECT_GE(occupied_in(grid, {x, 2.88}, {x + 0.04, 3.12}), 1) << x;
    EXPECT_GE(occupied_in(grid, {x, -3.12}, {x + 0.04, -2.88}), 1) << x;
    EXPECT_EQ(grid.at(Vector<2>(x, 0.0)), Cell::kFree) << x;
  }
  EXPECT_EQ(occupied_in(grid, {-3.8, -2.8}, {3.8, 2.8}), 0);
  EXPECT_EQ(grid.at(Vector<2>(20.0, 0.0)), Cell::kUnknown);
}

TEST(GridDrawing, what_is_behind_a_wall_is_unknown) {
  Walls walls = room();
  add_box(walls, {0.0, 1.5, 0.0}, 1.0, 1.0);
  Rng rng(2);
  const OccupancyGrid grid = draw_grid(drive(walls, rng), 0.05);
  EXPECT_EQ(grid.at(Vector<2>(0.0, 1.5)), Cell::kUnknown);
  EXPECT_GE(occupied_in(grid, {-0.4, 0.9}, {0.4, 1.1}), 12);
}

TEST(GridDrawing, who_walks_through_is_left_out) {
  std::vector<PlacedScan> placed;
  Rng rng(3);
  for (int k = 0; k < 12; ++k) {
    Walls walls = room();
    add_box(walls, {-2.0 + 0.4 * k, 1.5, 0.0}, 0.3, 0.3);
    placed.push_back({scan_from(walls, {0.0, -1.0, 0.1 * k}, rng, 0.01), {0.0, -1.0, 0.1 * k}});
  }
  const OccupancyGrid grid = draw_grid(placed, 0.05);
  EXPECT_EQ(occupied_in(grid, {-3.0, 1.2}, {3.0, 1.8}), 0);
  for (PlacedScan& one : placed) {
    one = placed.back();
  }
  EXPECT_GT(occupied_in(draw_grid(placed, 0.05), {-3.0, 1.2}, {3.0, 1.8}), 3);
}

TEST(GridDrawing, a_wall_seen_at_a_grazing_angle_stays) {
  Walls walls;
  add_box(walls, {}, 30.0, 1.6);  // a corridor
  std::vector<PlacedScan> placed;
  Rng rng(4);
  for (int k = 0; k < 40; ++k) {
    const Pose2 body{-6.0 + 0.3 * k, 0.1, 0.0};
    placed.push_back({scan_from(walls, body, rng, 0.01), body});
  }
  const OccupancyGrid grid = draw_grid(placed, 0.05);
  int gaps = 0;
  for (double x = -5.0; x < 5.0; x += 0.05) {
    gaps += occupied_in(grid, {x, 0.68}, {x + 0.04, 0.92}) == 0 ? 1 : 0;
  }
  EXPECT_LE(gaps, 2);
}

TEST(GridDrawing, an_old_map_stays_where_no_beam_reaches) {
  Rng rng(5);
  Walls before = room();
  add_box(before, {1.0, 1.5, 0.0}, 0.6, 0.6);
  const Pose2 origin{-4.5, -3.5, 0.0};
  std::vector<Cell> cells(100 * 140, Cell::kOccupied);  // 5 x 7 m: the left of the room and more
  const auto old = std::make_shared<const OccupancyGrid>(100, 140, 0.05, origin, cells);
  const OccupancyGrid grid = draw_grid(drive(room(), rng), 0.2, old);
  EXPECT_EQ(grid.resolution(), 0.05);
  EXPECT_EQ(grid.at(Vector<2>(-1.0, 0.0)), Cell::kFree);
  EXPECT_EQ(grid.at(Vector<2>(-4.3, 0.0)), Cell::kOccupied);  // behind the wall
  EXPECT_EQ(grid.at(Vector<2>(2.0, 0.0)), Cell::kFree);       // beyond the old one
  const OccupancyGrid unseen = draw_grid({}, 0.05, old);
  EXPECT_EQ(unseen.cells(), old->cells());
}

TEST(GridDrawing, a_map_that_is_turned_keeps_its_axes) {
  Rng rng(6);
  const Pose2 origin{1.0, -5.0, 0.7};
  const auto old = std::make_shared<const OccupancyGrid>(10, 10, 0.05, origin,
                                                         std::vector<Cell>(100, Cell::kUnknown));
  const OccupancyGrid grid = draw_grid(drive(room(), rng), 0.05, old);
  EXPECT_EQ(grid.origin().heading, 0.7);
  const Vector<2> moved = old->to_grid(grid.origin().position());
  EXPECT_NEAR(moved.x(), std::round(moved.x()), 1e-9);
  EXPECT_NEAR(moved.y(), std::round(moved.y()), 1e-9);
  EXPECT_EQ(grid.at(Vector<2>(0.0, 0.0)), Cell::kFree);
  EXPECT_GE(occupied_in(grid, {-0.5, 2.9}, {0.5, 3.1}), 10);
}

TEST(GridDrawing, refuses_what_cannot_be_drawn) {
  Rng rng(7);
  std::vector<PlacedScan> placed = drive(room(), rng, 2);
  for (const double resolution : {0.0, -1.0, 11.0, std::numeric_limits<double>::quiet_NaN()}) {
    expect_refused([&] { (void)draw_grid(placed, resolution); }, "resolution", "0.001 to 10");
  }
  expect_refused([] { (void)draw_grid({}, 0.05); }, "nothing to draw");
  placed[1].pose.x = 1e5;
  placed[1].pose.y = 1e5;
  expect_refused([&] { (void)draw_grid(placed, 0.05); }, "2^28 cells");
  placed[1].pose.x = std::numeric_limits<double>::infinity();
  expect_refused([&] { (void)draw_grid(placed, 0.05); }, "not finite");
}

}  // namespace
}  // namespace locfuse
