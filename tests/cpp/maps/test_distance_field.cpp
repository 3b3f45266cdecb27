// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "locfuse/maps/distance_field.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using Extra = DistanceField::Extra;
using testing::expect_refused;
using testing::Rng;
using testing::uniform;

std::shared_ptr<const OccupancyGrid> random_map(Rng& rng, int width, int height, double share) {
  std::vector<Cell> cells(static_cast<std::size_t>(width * height), Cell::kFree);
  for (Cell& cell : cells) {
    cell = uniform(rng, 0.0, 1.0) < share ? Cell::kOccupied : Cell::kFree;
  }
  cells.front() = Cell::kOccupied;
  return std::make_shared<const OccupancyGrid>(width, height, 0.05, Pose2{-1.0, 2.0, 0.3}, cells);
}

double by_brute_force(const OccupancyGrid& grid, const Vector<2>& p) {
  double nearest = 1e300;
  for (int row = 0; row < grid.height(); ++row) {
    for (int column = 0; column < grid.width(); ++column) {
      if (grid.at(column, row) == Cell::kOccupied) {
        nearest = std::min(nearest, (grid.center(column, row) - p).norm());
      }
    }
  }
  return nearest;
}

TEST(DistanceField, equals_brute_force_in_every_cell_and_in_its_margin) {
  for (int seed = 0; seed < 20; ++seed) {
    Rng rng(static_cast<std::uint64_t>(seed));
    const auto grid = random_map(rng, 30 + seed, 40 - seed, 0.3 / (1 + seed));
    const DistanceField field(grid, 0.4, Extra::kNearestTargets);
    const int margin = field.margin_cells();
    EXPECT_GE(margin, 8);
    for (int y = 0; y < field.height(); ++y) {
      for (int x = 0; x < field.width(); ++x) {
        const std::size_t cell = static_cast<std::size_t>(y * field.width() + x);
        const double nearest = by_brute_force(*grid, grid->center(x - margin, y - margin));
        ASSERT_NEAR(static_cast<double>(field.distances()[cell]) * 0.05, nearest, 1e-6);
        const Vector<2> target = field.center(field.nearest_targets()[cell]);
        ASSERT_NEAR((target - Vector<2>(x + 0.5, y + 0.5)).norm() * 0.05, nearest, 1e-9);
      }
    }
  }
}

TEST(DistanceField, nearest_equals_brute_force_at_any_point) {
  for (int seed = 0; seed < 20; ++seed) {
    Rng rng(static_cast<std::uint64_t>(seed));
    const auto grid = random_map(rng, 40, 30, 0.2 / (1 + seed * seed));
    const DistanceField field(grid, 0.1, seed % 2 == 0 ? Extra::kNone : Extra::kNearestTargets);
    for (int i = 0; i < 500; ++i) {
      const double reach = i % 5 == 0 ? 300.0 : 50.0;  // cells, far beyond the map, too
      Vector<2> p{uniform(rng, -reach, reach), uniform(rng, -reach, reach)};
      if (i % 7 == 0) {  // edges and centres of cells, where two are equally near
        p = (2.0 * p).array().round() / 2.0;
      }
      const Vector<2> world = grid->to_world(p);
      const DistanceField::Neighbour found = field.nearest(world);
      ASSERT_NEAR(found.distance, by_brute_force(*grid, world), 1e-9);
      const Vector<2> centre =
          field.center(found.target) - Vector<2>::Constant(field.margin_cells());
      ASSERT_NEAR((grid->to_world(centre) - world).norm(), found.distance, 1e-9);
    }
  }
}

TEST(DistanceField, look_up_is_accurate_to_half_a_diagonal_and_exact_off_the_field) {
  Rng rng(5);
  const auto grid = random_map(rng, 40, 30, 0.02);
  const DistanceField field(grid, 0.5);
  for (int i = 0; i < 2000; ++i) {
    const Vector<2> p = grid->to_world({uniform(rng, -60.0, 100.0), uniform(rng, -60.0, 90.0)});
    const Vector<2> f = field.to_field(p);
    const bool off =
        f.x() < 0.0 || f.y() < 0.0 || f.x() >= field.width() || f.y() >= field.height();
    ASSERT_NEAR(field.distance(p), by_brute_force(*grid, p), off ? 1e-9 : 0.05 * 0.7072);
  }
}

TEST(DistanceField, distances_beyond_the_field_are_accurate_to_three_cells) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Rng rng(seed);
    const auto grid = random_map(rng, 40, 30, 0.01);
    const DistanceField field(grid, 0.2, Extra::kSurroundings);
    const float* const far = field.distances().data() + field.width() * field.height();
    ASSERT_EQ(field.distances().data() + field.distances().size(),
              far + field.far_width() * field.far_height());
    for (int i = 0; i < 2000; ++i) {
      const double x = uniform(rng, -field.width(), 2.0 * field.width());
      const double y = uniform(rng, -field.height(), 2.0 * field.height());
      const int column = static_cast<int>((x + field.width()) / DistanceField::kFarCells);
      const int row = static_cast<int>((y + field.height()) / DistanceField::kFarCells);
      const double exact = field.nearest_in_field(x, y).distance;
      ASSERT_NEAR(static_cast<double>(far[row * field.far_width() + column]), exact, 3.0);
    }
  }
}

TEST(DistanceField, holds_only_the_extras_asked_for) {
  Rng rng(2);
  const auto grid = random_map(rng, 50, 40, 0.02);
  const DistanceField plain(grid, 0.3);
  const auto cells = static_cast<std::size_t>(plain.width() * plain.height());
  EXPECT_EQ(plain.distances().capacity(), cells);
  EXPECT_TRUE(plain.nearest_targets().empty());
  const DistanceField far(grid, 0.3, Extra::kSurroundings);
  EXPECT_GT(far.distances().size(), cells);
  EXPECT_TRUE(std::equal(plain.distances().begin(), plain.distances().end(),  //
                         far.distances().begin()));
}

TEST(DistanceField, rejects_a_missing_map) {
  expect_refused([] { (void)DistanceField(nullptr); }, "DistanceField has no map");
  expect_refused([] { (void)DistanceField(nullptr, {1}, 0.0); }, "DistanceField has no map");
}

TEST(DistanceField, rejects_a_map_without_walls_and_invalid_points) {
  const auto empty =
      std::make_shared<const OccupancyGrid>(2, 2, 0.1, Pose2{}, std::vector<Cell>(4, Cell::kFree));
  expect_refused([&] { (void)DistanceField(empty); }, "0 occupied cells");
  Rng rng(1);
  const auto grid = random_map(rng, 4, 4, 0.5);
  expect_refused([&] { (void)DistanceField(grid, -1.0); }, "margin is -1");
  expect_refused([&] { (void)DistanceField(grid, {1, 1}, 0.0); }, "2 cells");
  const auto fine =
      std::make_shared<const OccupancyGrid>(1, 1, 1e-6, Pose2{}, std::vector{Cell::kOccupied});
  expect_refused([&] { (void)DistanceField(fine, 1e4); }, "10000000001", "2^30");
  expect_refused([&] { (void)DistanceField(fine, 17.0); }, "2^24");
  const DistanceField field(grid);
  expect_refused([&] { (void)field.distance({std::nan(""), 0.0}); }, "nan");
  expect_refused([&] { (void)field.nearest({0.0, INFINITY}); }, "inf");
  expect_refused([&] { (void)field.nearest({1e200, 0.0}); }, "1e9 cells");  // squares are infinite
}

TEST(DistanceField, nan_has_the_target_next_to_the_corner) {
  const auto grid = std::make_shared<const OccupancyGrid>(
      2, 1, 1.0, Pose2{}, std::vector{Cell::kOccupied, Cell::kOccupied});
  EXPECT_EQ(DistanceField(grid).nearest_in_field(std::nan(""), std::nan("")).target, 0);
}

}  // namespace
}  // namespace locfuse
