// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "locfuse/estimators/world.hpp"
#include "locfuse/maps/occupancy_grid.hpp"
#include "locfuse/messages/messages.hpp"
#include "support/random.hpp"

namespace locfuse::testing {

/// Walls without thickness, from point to point [m].
using Walls = std::vector<std::pair<Vector<2>, Vector<2>>>;

inline void add_box(Walls& walls, const Pose2& middle, double length, double width) {
  const Vector<2> corners[] = {
      middle.act({-length / 2, -width / 2}), middle.act({length / 2, -width / 2}),
      middle.act({length / 2, width / 2}), middle.act({-length / 2, width / 2})};
  for (int i = 0; i < 4; ++i) {
    walls.emplace_back(corners[i], corners[(i + 1) % 4]);
  }
}

/// Distance along a ray to the first wall, by intersecting lines; infinity if there is none.
[[nodiscard]] inline double cast(const Walls& walls, const Vector<2>& from, double angle) {
  const Vector<2> along(std::cos(angle), std::sin(angle));
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [a, b] : walls) {
    const Vector<2> wall = b - a;
    const double cross = along.x() * wall.y() - along.y() * wall.x();
    const Vector<2> to = a - from;
    const double distance = (to.x() * wall.y() - to.y() * wall.x()) / cross;
    const double share = (to.x() * along.y() - to.y() * along.x()) / cross;
    if (distance > 0.0 && distance < nearest && share >= 0.0 && share <= 1.0) {
      nearest = distance;
    }
  }
  return nearest;
}

/// Map of the walls: the cells they pass through are occupied, all others free.
/// A world with nothing but a map of walls.
[[nodiscard]] inline World on_map(std::shared_ptr<const OccupancyGrid> grid) {
  World world;
  world.grid = std::move(grid);
  return world;
}

[[nodiscard]] inline std::shared_ptr<const OccupancyGrid> map_of(const Walls& walls, int width,
                                                                 int height, double resolution,
                                                                 const Pose2& origin) {
  std::vector<Cell> cells(static_cast<std::size_t>(width * height), Cell::kFree);
  for (const auto& [a, b] : walls) {
    const int steps = 1 + static_cast<int>((b - a).norm() / (0.02 * resolution));
    for (int i = 0; i <= steps; ++i) {
      const Vector<2> p = inverse(origin).act(a + (b - a) * i / steps) / resolution;
      const int column = static_cast<int>(std::floor(p.x()));
      const int row = static_cast<int>(std::floor(p.y()));
      if (column >= 0 && column < width && row >= 0 && row < height) {
        cells[static_cast<std::size_t>(row * width + column)] = Cell::kOccupied;
      }
    }
  }
  return std::make_shared<const OccupancyGrid>(width, height, resolution, origin, cells);
}

/// A laser that turns once around, 5 cm behind the middle of the robot.
[[nodiscard]] inline std::shared_ptr<const LaserGeometry> laser(int beams = 360,
                                                                double range_max = 12.0) {
  return std::make_shared<const LaserGeometry>(
      LaserGeometry{{-0.05, 0.02, 0.1}, -kPi, 2.0 * kPi / beams, 0.1, range_max});
}

/// Scan from `body` with noise of `sigma` [m].
[[nodiscard]] inline LaserScan scan_from(const Walls& walls, const Pose2& body, Rng& rng,
                                         double sigma,
                                         std::shared_ptr<const LaserGeometry> geometry = laser(),
                                         int beams = 360) {
  LaserScan scan{0, geometry, {}};
  const Pose2 eye = body * geometry->pose_in_body;
  for (int i = 0; i < beams; ++i) {
    const double angle = eye.heading + geometry->angle_min + i * geometry->angle_increment;
    const double range = cast(walls, eye.position(), angle) + normal(rng, sigma);
    scan.ranges.push_back(range >= geometry->range_min && range <= geometry->range_max
                              ? range
                              : std::numeric_limits<double>::quiet_NaN());
  }
  return scan;
}

/// A room of 8 x 6 m with three boxes.
[[nodiscard]] inline Walls room_around(const Pose2& middle) {
  Walls walls;
  add_box(walls, middle, 8.0, 6.0);
  add_box(walls, middle * Pose2{2.6, 1.4, 0.3}, 1.2, 0.6);
  add_box(walls, middle * Pose2{-2.4, -1.8, -0.5}, 0.8, 0.8);
  add_box(walls, middle * Pose2{-3.2, 1.9, 0.0}, 0.5, 1.4);
  return walls;
}

/// The same, turned and shifted at random against its map of 5 cm cells.
struct Room {
  Walls walls;
  std::shared_ptr<const OccupancyGrid> map;
  Pose2 middle;
};

[[nodiscard]] inline Room random_room(Rng& rng) {
  Room room;
  room.middle = {uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), uniform(rng, -kPi, kPi)};
  room.walls = room_around(room.middle);
  const Pose2 origin = Pose2{0.0, 0.0, uniform(rng, -kPi, kPi)} * Pose2{-8.0, -8.0, 0.0};
  room.map = map_of(room.walls, 320, 320, 0.05, origin);
  return room;
}

}  // namespace locfuse::testing
