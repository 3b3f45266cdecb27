// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "frontends/scan_lanes.hpp"
#include "locfuse/maps/occupancy_grid.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse::internal {

/// End points as the lanes read them, filled up with copies of the last one.
struct BeamColumns {
  std::vector<float> x, y, used;
  std::vector<float> per_spacing;  ///< end points of a beam and the next, per cell of wall

  [[nodiscard]] LaneBeams view() const {
    return {static_cast<int>(x.size()), x.data(), y.data(), used.data()};
  }
};

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

/// Every `stride`-th of the beams that came back, of which there is one at least.
[[nodiscard]] BeamColumns columns_of(const Beams& beams, std::size_t stride = 1);

/// A pose in the frame of a field whose cells are the unit, and back.
[[nodiscard]] Pose2 to_field(const Pose2& pose, const OccupancyGrid& grid, int margin_cells);
[[nodiscard]] Pose2 to_world(const Pose2& pose, const OccupancyGrid& grid, int margin_cells);

}  // namespace locfuse::internal
