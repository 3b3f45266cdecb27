// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse {

/// Ranges of beams on a map: distance to the first occupied cell.
///
/// Exact: the distance from the start to where the beam enters the first occupied cell. Each
/// crossing is computed from the start, so errors do not accumulate. The range from an occupied
/// cell is 0. Beams pass free cells and the outside of the map, so they may start outside; unknown
/// cells pass or stop them. Rounding decides which cell a beam through a corner touches, but it
/// does not pass between two cells that stop it.
///
/// Takes one byte per cell beside the grid.
class RayCaster {
 public:
  /// Throws std::invalid_argument without a map.
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
  /// Number of rings around each cell, itself included, that stop no beam: at most 255; 0 if it
  /// stops them itself.
  std::vector<std::uint8_t> clear_;
};

}  // namespace locfuse
