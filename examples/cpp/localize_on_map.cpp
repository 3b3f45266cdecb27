// SPDX-License-Identifier: Apache-2.0
// A robot with a laser starts anywhere on its map.
#include <cmath>
#include <cstdio>
#include <locfuse/locfuse.hpp>
#include <utility>
#include <vector>

int main() {
  using namespace locfuse;
  constexpr int kWidth = 80;
  constexpr int kHeight = 60;
  std::vector<Cell> cells(kWidth * kHeight, Cell::kFree);  // 4 x 3 m
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      const bool is_rim = row == 0 || column == 0 || row == kHeight - 1 || column == kWidth - 1;
      const bool is_box = row < 20 && column < 30;
      cells[static_cast<std::size_t>(row * kWidth + column)] =
          is_rim || is_box ? Cell::kOccupied : Cell::kFree;
    }
  }
  const auto grid =
      std::make_shared<const OccupancyGrid>(kWidth, kHeight, 0.05, Pose2{}, std::move(cells));
  const RayCaster walls(grid);  // stands for the laser
  LaserGeometry geometry;
  geometry.angle_min = -kPi;
  geometry.angle_increment = kPi / 90.0;
  geometry.range_min = 0.05;
  geometry.range_max = 10.0;
  const auto laser = std::make_shared<const LaserGeometry>(geometry);

  Mcl mcl({}, {{}, {}, {}, grid, {}}, 0);
  double x = 2.0;
  for (int step = 0; step < 50; ++step) {  // five a second, straight on
    const Stamp now = step * 200'000'000LL;
    mcl.on(Velocity{now, 0.1, 0.0});
    mcl.on(LaserScan{now, laser,
                     walls.scan({x, 2.0, 0.0}, geometry.angle_min, geometry.angle_increment, 180,
                                geometry.range_max)});
    x += 0.02;
  }
  const Pose2 pose = mcl.estimate().pose;
  std::printf("x = %.1f m, y = %.1f m, %s\n", pose.x, pose.y, mcl.ready() ? "ready" : "searching");
}
