// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "frontends/scan_lanes.hpp"
#include "locfuse/maps/occupancy_grid.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse::internal {

/// Every so many directions of beams are computed exactly, the others by rotation from the one
/// before: accurate to 1e-14 in a tenth of the time.
inline constexpr std::size_t kExactDirections = 64;

/// End points as columns for the lanes, padded with copies of the last one.
struct BeamColumns {
  std::vector<float> x, y, used;
  std::vector<float> per_spacing;  ///< beams per cell of wall at this range

  [[nodiscard]] LaneBeams view() const {
    return {static_cast<int>(x.size()), x.data(), y.data(), used.data()};
  }
};

/// A scan in the body frame, in cells.
struct Beams {
  Vector<2> laser;             ///< origin of the beams
  std::vector<double> x, y;    ///< end points of the returns
  std::vector<double> range;   ///< their length
  std::vector<double> silent;  ///< directions of the beams without return
  double step;                 ///< between two beams [rad]
  double range_max;
};

/// Throws std::invalid_argument if the scan is not valid.
[[nodiscard]] Beams beams_of(const LaserScan& scan, double resolution);

/// Every `stride`-th of the returns; there must be one.
[[nodiscard]] BeamColumns columns_of(const Beams& beams, std::size_t stride = 1);

/// Pose in the field frame, in cells, and back in world.
[[nodiscard]] Pose2 to_field(const Pose2& pose, const OccupancyGrid& grid, int margin_cells);
[[nodiscard]] Pose2 to_world(const Pose2& pose, const OccupancyGrid& grid, int margin_cells);

}  // namespace locfuse::internal
