// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// What no robot and no sensor exceeds. A message beyond is valid, but nothing that can have
/// happened: wrong units, a bit that flipped, a counter that wrapped. Defaults are generous, since
/// what is merely unlikely is for the gates to judge.
struct Limits {
  double speed_mps = 100.0;       ///< of odometry [m/s]
  double turn_rate_radps = 50.0;  ///< of odometry [rad/s]: 8 turns in a second
  double range_m = 1e4;           ///< of ranges and of ranges to landmarks [m]
  double distance_m = 2e7;        ///< of positions from the world's origin: UTM's are up to 1e7 [m]
};

/// Throws std::invalid_argument unless all are > 0 and at most 1e12.
void validate(const Limits& limits);

/// Whether a valid message can have happened. Stamps jitter, so an increment may drive what the
/// limits allow in its time and 0.1 s more; one without duration is judged by the same.
[[nodiscard]] bool is_plausible(const Velocity& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const Increment& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const Range& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const PositionFix& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const PoseObservation& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const Altitude& message, const Limits& limits);
[[nodiscard]] bool is_plausible(const RangeBearing& message, const Limits& limits);

}  // namespace locfuse
