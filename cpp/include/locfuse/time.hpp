// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace locfuse {

/// Nanoseconds on the log's clock, as an integer: equality, order and replays are exact.
using Stamp = std::int64_t;

inline constexpr double kNanosecondsPerSecond = 1e9;

/// Stamps lie strictly between -kStampLimit and kStampLimit [ns], 146 years: differences do not
/// overflow.
inline constexpr Stamp kStampLimit = Stamp{1} << 62;

/// Throws std::invalid_argument unless the stamp lies within the limit.
inline void check_stamp(Stamp stamp) {
  if (stamp <= -kStampLimit || stamp >= kStampLimit) {
    throw std::invalid_argument("stamp is " + std::to_string(stamp) +
                                " ns, expected less than 2^62 ns from 0");
  }
}

/// Seconds from `from` to `to`, negative if `to` is earlier.
[[nodiscard]] inline double seconds_between(Stamp from, Stamp to) {
  return static_cast<double>(to - from) / kNanosecondsPerSecond;
}

}  // namespace locfuse
