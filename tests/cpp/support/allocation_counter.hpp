// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace locfuse::testing {

/// Heap allocations since the program started, by operator new and by malloc, which Eigen calls.
/// Link with support/allocation_counter.cpp and the linker's --wrap options.
[[nodiscard]] std::size_t allocations();

}  // namespace locfuse::testing
