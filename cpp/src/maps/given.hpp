// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <stdexcept>
#include <string>

#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse::internal {

/// The map that `user` requires. Throws std::invalid_argument if it is null.
inline const std::shared_ptr<const OccupancyGrid>& given(
    const std::shared_ptr<const OccupancyGrid>& grid, const char* user) {
  if (!grid) {
    throw std::invalid_argument(std::string(user) + " has no map, expected an OccupancyGrid");
  }
  return grid;
}

}  // namespace locfuse::internal
