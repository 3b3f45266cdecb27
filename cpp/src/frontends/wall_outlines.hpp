// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse::internal {

/// Ways along the boundary between free and occupied cells, free ones on the left: corners of
/// cells, in world. A way ends where unknown cells begin; a closed one begins and ends at one of
/// its bends.
[[nodiscard]] std::vector<std::vector<Vector<2>>> wall_outlines(const OccupancyGrid& grid);

}  // namespace locfuse::internal
