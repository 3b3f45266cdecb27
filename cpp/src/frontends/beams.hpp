// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse::internal {

/// A scan in the body frame, in cells.
struct Beams {
  Vector<2> laser;             ///< where the beams begin
  std::vector<double> x, y;    ///< end points of the beams that came back
  std::vector<double> range;   ///< their length
  std::vector<double> silent;  ///< directions of the beams that did not
  double step;                 ///< between two beams [rad]
  double range_max;
};

/// Throws std::invalid_argument if the scan is not valid.
[[nodiscard]] Beams beams_of(const LaserScan& scan, double resolution);

/// A pose in the frame of a field whose cells are the unit, and back.
[[nodiscard]] Pose2 to_field(const Pose2& pose, const OccupancyGrid& grid, int margin_cells);
[[nodiscard]] Pose2 to_world(const Pose2& pose, const OccupancyGrid& grid, int margin_cells);

}  // namespace locfuse::internal
