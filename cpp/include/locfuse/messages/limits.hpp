// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Physical limits of messages. A message beyond them is valid, but implausible: wrong units, a
/// flipped bit, a counter that wrapped. The defaults are generous, as gates judge what is merely
/// unlikely.
struct Limits {
  double speed_mps = 100.0;       ///< of odometry [m/s]
  double turn_rate_radps = 50.0;  ///< of odometry [rad/s]: 8 turns per second
  double range_m = 1e4;           ///< of ranges and of ranges to landmarks [m]
  double distance_m = 2e7;        ///< of positions from the world's origin; UTM reaches 1e7 [m]
};

/// Throws std::invalid_argument unless all are > 0 and at most 1e12.
void validate(const Limits& limits);

/// Whether a valid message is within the limits. As stamps jitter, an increment may have the motion
/// of its duration and 0.1 s more; one of no duration the motion of 0.1 s.
[[nodiscard]] bool is_plausible(const Velocity& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const Increment& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const Range& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const PositionFix& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const PoseObservation& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const Altitude& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const Heading& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const RangeBearing& message, const Limits& limits);

}  // namespace locfuse
