// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/maps/occupancy_grid.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_refused;

OccupancyGrid three_by_two(const Pose2& origin) {
  return {3,
          2,
          0.5,
          origin,
          {Cell::kFree, Cell::kOccupied, Cell::kUnknown,  //
           Cell::kOccupied, Cell::kFree, Cell::kFree}};
}

TEST(OccupancyGrid, row_0_has_the_lowest_y) {
  const OccupancyGrid grid = three_by_two({10.0, 20.0, 0.0});
  EXPECT_EQ(grid.at(1, 0), Cell::kOccupied);
  EXPECT_EQ(grid.at(1, 1), Cell::kFree);
  EXPECT_EQ(grid.at(Vector<2>(10.7, 20.1)), Cell::kOccupied);
  EXPECT_EQ(grid.at(Vector<2>(10.1, 20.9)), Cell::kOccupied);
  expect_near(grid.center(2, 1), Vector<2>(11.25, 20.75), 1e-12);
}

TEST(OccupancyGrid, is_unknown_outside) {
  const OccupancyGrid grid = three_by_two({0.0, 0.0, 0.0});
  for (const Vector<2>& p : {Vector<2>(-0.01, 0.5), Vector<2>(1.5, 0.5), Vector<2>(0.5, -0.01),
                             Vector<2>(0.5, 1.0), Vector<2>(1e9, 0.5)}) {
    EXPECT_FALSE(grid.contains(p));
    EXPECT_EQ(grid.at(p), Cell::kUnknown);
  }
  EXPECT_EQ(grid.at(-1, 0), Cell::kUnknown);
  EXPECT_EQ(grid.at(0, 2), Cell::kUnknown);
}

TEST(OccupancyGrid, turns_with_its_origin) {
  const OccupancyGrid grid = three_by_two({1.0, 2.0, kPi / 2.0});  // columns lead north, rows west
  expect_near(grid.center(1, 0), Vector<2>(0.75, 2.75), 1e-12);
  EXPECT_EQ(grid.at(Vector<2>(0.75, 2.75)), Cell::kOccupied);
  testing::Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Vector<2> p{testing::uniform(rng, -9.0, 9.0), testing::uniform(rng, -9.0, 9.0)};
    expect_near(grid.to_world(grid.to_grid(p)), p, 1e-12);
  }
}

TEST(OccupancyGrid, rejects_invalid_maps) {
  const auto make = [](int width, int height, double resolution, const Pose2& origin,
                       std::size_t cells) {
    (void)OccupancyGrid(width, height, resolution, origin, std::vector<Cell>(cells, Cell::kFree));
  };
  expect_refused([&] { make(0, 2, 0.1, {}, 0); }, "width is 0");
  expect_refused([&] { make(2, -1, 0.1, {}, 0); }, "height is -1");
  expect_refused([&] { make(2, 2, 0.0, {}, 4); }, "resolution [m] is 0");
  expect_refused([&] { make(2, 2, std::nan(""), {}, 4); }, "resolution [m] is nan");
  expect_refused([&] { make(2, 2, 1e-7, {}, 4); }, "resolution [m] is 1e-07", "1e-6 to 1e6");
  expect_refused([&] { make(2, 2, 1e200, {}, 4); }, "resolution [m] is 1e+200");
  expect_refused([&] { make(2, 2, 0.1, {0.0, std::nan(""), 0.0}, 4); }, "origin");
  // A fuzzer's beam had as large a heading the other way: their difference is infinite.
  expect_refused([&] { make(2, 2, 0.1, {0.0, 0.0, -1.7e308}, 4); }, "origin is -1.7e+308");
  expect_refused([&] { make(2, 2, 0.1, {}, 5); }, "cells is 5");
  expect_refused([] { (void)OccupancyGrid(1, 1, 0.1, {}, {static_cast<Cell>(50)}); }, "is 50",
                 "occupied");
}

}  // namespace
}  // namespace locfuse
