// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "locfuse/frontends/local_map.hpp"
#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse {

/// Draws the map that scans at known poses T_world_body show: docs/map.md eq. (1) and (2).
///
/// A cell is occupied where beams end in it often enough among those that pass through it, so that
/// what moves is left out; it is free where they pass, and unknown elsewhere. With a map `onto`, in
/// whose resolution and axes it is drawn then, cells that no beam reaches stay as they are there.
/// Throws std::invalid_argument on a scan or pose that is not valid, a resolution that is not 1 mm
/// to 10 m, and where no scan has a return and there is no map, or a map has more than 2^28 cells.
[[nodiscard]] OccupancyGrid draw_grid(const std::vector<PlacedScan>& scans, double resolution_m,
                                      const std::shared_ptr<const OccupancyGrid>& onto = nullptr);

}  // namespace locfuse
