// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "support/rooms.hpp"

namespace locfuse::testing {

/// Mounts of lasers that face forwards and backwards.
constexpr Pose2 kFront{0.2, 0.0, 0.0};
constexpr Pose2 kRear{-0.2, 0.0, -kPi};

/// A scan of a laser that sees half of a circle, by 180 beams.
[[nodiscard]] inline LaserScan half_scan(const Walls& walls, const Pose2& body, Rng& rng,
                                         double sigma, const Pose2& mount) {
  const auto half = std::make_shared<const LaserGeometry>(
      LaserGeometry{mount, -0.5 * kPi, kPi / 180.0, 0.1, 12.0});
  return scan_from(walls, body, rng, sigma, half, 180);
}

}  // namespace locfuse::testing
