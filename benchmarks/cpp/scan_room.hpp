// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"
#include "locfuse/messages/messages.hpp"
#include "support/random.hpp"

namespace locfuse::testing {

/// A hall of 20 x 20 m in 400 x 400 cells with 25 solid boxes; a robot drives a circle of 5 m in
/// it. 360 beams up to 20 m with 2 cm of noise, guesses up to 20 cm and 5 degrees off.
struct ScanRoom {
  static constexpr int kCells = 400;
  static constexpr int kPoses = 51;

  std::shared_ptr<const OccupancyGrid> map;
  std::vector<Vector<2>> surface;  ///< 10,000 points on the boxes and walls, 5 mm off
  std::vector<Pose2> truth;
  std::vector<Pose2> guess;
  std::vector<LaserScan> scans;
};

/// Range at which a ray enters an occupied cell, by steps of 5 mm.
[[nodiscard]] inline double cast(const OccupancyGrid& map, const Pose2& eye, double angle) {
  const Vector<2> along(std::cos(eye.heading + angle), std::sin(eye.heading + angle));
  double range = 0.0;
  while (range < 20.0 && map.at(Vector<2>(eye.position() + range * along)) != Cell::kOccupied) {
    range += 0.005;
  }
  return range;
}

[[nodiscard]] inline std::vector<Cell> scan_room_cells(Rng& rng) {
  constexpr int n = ScanRoom::kCells;
  std::vector<Cell> cells(static_cast<std::size_t>(n * n), Cell::kFree);
  const auto fill = [&](int left, int bottom, int width, int height) {
    for (int row = bottom; row < bottom + height; ++row) {
      for (int column = left; column < left + width; ++column) {
        cells[static_cast<std::size_t>(row * n + column)] = Cell::kOccupied;
      }
    }
  };
  fill(0, 0, n, 2);
  fill(0, n - 2, n, 2);
  fill(0, 0, 2, n);
  fill(n - 2, 0, 2, n);
  for (int placed = 0; placed < 25;) {
    const int width = static_cast<int>(uniform(rng, 6.0, 31.0));
    const int height = static_cast<int>(uniform(rng, 6.0, 31.0));
    const int left = static_cast<int>(uniform(rng, 4.0, n - 36.0));
    const int bottom = static_cast<int>(uniform(rng, 4.0, n - 36.0));
    bool on_the_way = false;
    for (int row = bottom; row < bottom + height; ++row) {
      for (int column = left; column < left + width; ++column) {
        const double radius = 0.05 * std::hypot(column - n / 2, row - n / 2);
        on_the_way = on_the_way || std::abs(radius - 5.0) < 0.6;
      }
    }
    if (!on_the_way) {
      fill(left, bottom, width, height);
      ++placed;
    }
  }
  return cells;
}

[[nodiscard]] inline ScanRoom scan_room() {
  Rng rng(3);
  ScanRoom room;
  room.map = std::make_shared<const OccupancyGrid>(ScanRoom::kCells, ScanRoom::kCells, 0.05,
                                                   Pose2{-10.0, -10.0, 0.0}, scan_room_cells(rng));
  const auto geometry = std::make_shared<const LaserGeometry>(
      LaserGeometry{{}, -kPi, 2.0 * kPi / 360.0, 0.05, 19.999});
  for (int k = 0; k < ScanRoom::kPoses; ++k) {
    const double turned = 0.04 * k;
    const Pose2 pose{5.0 * std::cos(turned), 5.0 * std::sin(turned),
                     wrap_angle(turned + kPi / 2.0)};
    LaserScan scan{0, geometry, {}};
    for (int i = 0; i < 360; ++i) {
      const double angle = geometry->angle_min + i * geometry->angle_increment;
      scan.ranges.push_back(cast(*room.map, pose, angle) + normal(rng, 0.02));
    }
    room.truth.push_back(pose);
    room.guess.push_back(retract(pose, {uniform(rng, -0.2, 0.2), uniform(rng, -0.2, 0.2),
                                        uniform(rng, -5.0, 5.0) * kPi / 180.0}));
    room.scans.push_back(std::move(scan));
  }
  while (room.surface.size() < 10000) {  // where a ray from a free point ends
    const Pose2 from{uniform(rng, -9.8, 9.8), uniform(rng, -9.8, 9.8), 0.0};
    if (room.map->at(from.position()) == Cell::kFree) {
      const double angle = uniform(rng, -kPi, kPi);
      const double range = cast(*room.map, from, angle) + normal(rng, 0.005);
      room.surface.push_back(from.position() + range * Vector<2>(std::cos(angle), std::sin(angle)));
    }
  }
  return room;
}

}  // namespace locfuse::testing
