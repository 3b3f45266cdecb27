// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse {

/// How far beams go on a map until they enter an occupied cell.
///
/// Exact: the first such cell on a beam's way, and the distance from the beam's start to where it
/// enters the cell; each crossing is computed from the start, so that no error adds up. A beam that
/// starts in an occupied cell has gone 0. Free cells and the outside of the map let beams pass, so
/// one may start outside; unknown cells pass or stop them. Of the cells beside a corner that a beam
/// goes through, rounding decides which one it touches; it does not slip between two that stop it.
///
/// Takes a byte a cell beside the grid.
class RayCaster {
 public:
  /// Throws std::invalid_argument if there is no map.
  explicit RayCaster(const std::shared_ptr<const OccupancyGrid>& grid, bool unknown_stops = false);

  [[nodiscard]] const OccupancyGrid& grid() const { return *grid_; }

  /// Whether a point in world is less than 1e9 cells from the map: a beam may start there.
  [[nodiscard]] bool reaches(const Vector<2>& p_world) const;

  /// Range [m] of the beam from a point in a direction [rad] of the world; infinite if it enters no
  /// such cell within `max_range` [m].
  ///
  /// Throws std::invalid_argument on numbers that are not finite, a start that is 1e9 cells or more
  /// from the map, and a `max_range` that is negative; it may be infinite.
  [[nodiscard]] double cast(const Vector<2>& p_world, double heading, double max_range) const;

  /// Ranges [m] of `count` beams at angle_min + i * angle_increment [rad] in the laser's frame.
  ///
  /// Throws as cast() does, and unless `count` is 0 to 1,000,000.
  [[nodiscard]] std::vector<double> scan(const Pose2& T_world_laser, double angle_min,
                                         double angle_increment, int count, double max_range) const;

 private:
  [[nodiscard]] Vector<2> start_of(const Vector<2>& p_world, double max_range) const;
  [[nodiscard]] double range_from(const Vector<2>& start, double heading, double max_range) const;
  [[nodiscard]] double cells_to_hit(const Vector<2>& start, const Vector<2>& along,
                                    double reach) const;

  std::shared_ptr<const OccupancyGrid> grid_;
  /// Rings of cells around each that stop no beam, itself included, 255 at most; 0 if it stops
  /// them.
  std::vector<std::uint8_t> clear_;
};

}  // namespace locfuse
