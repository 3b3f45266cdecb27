// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace locfuse {

/// Nanoseconds on the log's clock. An integer, so that equality, order and replays are exact.
using Stamp = std::int64_t;

inline constexpr double kNanosecondsPerSecond = 1e9;

/// Seconds from `from` to `to`, negative if `to` is earlier.
[[nodiscard]] inline double seconds_between(Stamp from, Stamp to) {
  return static_cast<double>(to - from) / kNanosecondsPerSecond;
}

}  // namespace locfuse
