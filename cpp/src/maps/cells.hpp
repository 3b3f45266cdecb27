// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace locfuse::internal {

/// Cell that holds a coordinate, or the outermost one on its side.
[[nodiscard]] inline int clamped_cell(double coordinate, int size) {
  return static_cast<int>(std::clamp(coordinate, 0.0, size - 1.0));
}

}  // namespace locfuse::internal
