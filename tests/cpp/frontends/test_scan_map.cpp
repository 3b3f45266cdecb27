// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/frontends/scan_map.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;
using testing::Rng;
using testing::uniform;

TEST(ScanMap, kd_tree_equals_the_exact_field) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    Rng rng(seed);
    const testing::Room room = testing::random_room(rng);
    const ScanMap map(room.map);
    for (int i = 0; i < 2000; ++i) {
      const Vector<2> p{uniform(rng, -15.0, 15.0), uniform(rng, -15.0, 15.0)};
      ASSERT_NEAR(map.nearest_by_kdtree(p), map.occupied().nearest(p).distance, 2e-6);
    }
  }
}

TEST(ScanMap, surface_excludes_the_inside_of_walls) {
  std::vector<Cell> cells(20 * 20, Cell::kFree);
  for (int row = 0; row < 20; ++row) {
    for (int column = 0; column < 8; ++column) {
      cells[static_cast<std::size_t>(20 * row + column)] = Cell::kOccupied;
    }
  }
  const ScanMap map(std::make_shared<const OccupancyGrid>(20, 20, 0.1, Pose2{}, cells));
  EXPECT_EQ(map.occupied().targets(), 160);
  EXPECT_EQ(map.surface().targets(), 20);
  const std::size_t middle = 10;
  EXPECT_NEAR(std::abs(map.lines()[middle].normal.x()), 1.0, 1e-12);
  EXPECT_EQ(map.lines()[middle].run, 20.0);
}

TEST(ScanMap, lines_follow_slanted_walls_better_than_cells) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const double angle = uniform(rng, 0.0, kPi);
    const Vector<2> along(std::cos(angle), std::sin(angle));
    const Vector<2> middle(10.0 + uniform(rng, -0.05, 0.05), 10.0);
    const ScanMap map(
        testing::map_of({{middle - 5.0 * along, middle + 5.0 * along}}, 400, 400, 0.05, {}));
    double squares = 0.0;
    int count = 0;
    for (const ScanMap::WallLine& line : map.lines()) {
      const Vector<2> p =
          map.grid().to_world(line.point - Vector<2>::Constant(map.surface().margin_cells()));
      if (std::abs((p - middle).dot(along)) < 4.5) {
        squares += line.normal.dot(along) * line.normal.dot(along);
        ++count;
      }
    }
    EXPECT_LT(std::sqrt(squares / count), 0.11);  // rad, which kWeakShare supposes
  }
}

TEST(ScanMap, a_corner_has_no_line) {
  const ScanMap map(
      testing::map_of({{{1.0, 1.0}, {3.0, 1.0}}, {{1.0, 1.0}, {1.0, 3.0}}}, 80, 80, 0.05, {}));
  const int corner = map.surface().nearest({1.0, 1.0}).target;
  const ScanMap::WallLine& line = map.lines()[static_cast<std::size_t>(corner)];
  EXPECT_TRUE(line.normal.isZero(0.0));
  EXPECT_EQ(line.run, 0.0);
}

TEST(ScanMap, rejects_a_missing_map) {
  expect_refused([] { (void)ScanMap(nullptr); }, "ScanMap has no map");
}

TEST(ScanMap, rejects_a_map_without_walls_and_points_that_pcl_would_abort_on) {
  const auto free =
      std::make_shared<const OccupancyGrid>(2, 2, 0.1, Pose2{}, std::vector<Cell>(4, Cell::kFree));
  expect_refused([&] { (void)ScanMap(free); }, "0 occupied cells");
  const ScanMap map(testing::map_of({{{1.0, 1.0}, {3.0, 1.0}}}, 80, 80, 0.05, {}));
  for (const double far : {3e38, 1e300, HUGE_VAL, std::nan("")}) {
    expect_refused([&] { (void)map.nearest_by_kdtree({far, 0.0}); }, "million cells");
  }
}

}  // namespace
}  // namespace locfuse
