// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <limits>

namespace locfuse::internal {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Cell of a coordinate, clamped to the grid; 0 for NaN, by the order of the arguments.
[[nodiscard]] inline int clamped_cell(double coordinate, int size) {
  return static_cast<int>(std::min(std::max(0.0, coordinate), size - 1.0));
}

}  // namespace locfuse::internal
