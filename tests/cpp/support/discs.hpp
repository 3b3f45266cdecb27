// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "support/rooms.hpp"

namespace locfuse::testing {

/// A disc in the plane [m].
struct Disc {
  Vector<2> centre = Vector<2>::Zero();
  double radius = 0.0;
};

/// Distance along a ray to the first disc; infinity if there is none.
[[nodiscard]] inline double cast(const std::vector<Disc>& discs, const Vector<2>& from,
                                 double angle) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Disc& disc : discs) {
    const double dx = disc.centre.x() - from.x();
    const double dy = disc.centre.y() - from.y();
    const double ahead = dx * std::cos(angle) + dy * std::sin(angle);
    const double left = dy * std::cos(angle) - dx * std::sin(angle);
    const double half = disc.radius * disc.radius - left * left;
    if (half > 0.0 && ahead > 0.0) {
      nearest = std::min(nearest, ahead - std::sqrt(half));
    }
  }
  return nearest;
}

/// A laser in the middle of the body that turns once around.
[[nodiscard]] inline std::shared_ptr<const LaserGeometry> turning_laser(int beams = 360,
                                                                        double range_max = 12.0) {
  return std::make_shared<const LaserGeometry>(
      LaserGeometry{{}, -kPi, 2.0 * kPi / beams, 0.05, range_max});
}

/// Scan of discs and walls from `eye` with noise of `sigma` [m]; NaN beyond the maximum range.
[[nodiscard]] inline LaserScan scan_of(const std::vector<Disc>& discs, const Walls& walls,
                                       const Pose2& eye, Rng& rng, double sigma,
                                       std::shared_ptr<const LaserGeometry> geometry,
                                       int beams = 360) {
  LaserScan scan{0, geometry, {}};
  for (int i = 0; i < beams; ++i) {
    const double angle = eye.heading + geometry->angle_min + i * geometry->angle_increment;
    const double range =
        std::min(cast(discs, eye.position(), angle), cast(walls, eye.position(), angle)) +
        normal(rng, sigma);
    scan.ranges.push_back(range >= geometry->range_min && range < geometry->range_max
                              ? range
                              : std::numeric_limits<double>::quiet_NaN());
  }
  return scan;
}

/// wells: four cylinders of radius 1 m at (+-2, +-2).
[[nodiscard]] inline std::vector<Disc> cylinders_of_wells() {
  return {{{2.0, 2.0}, 1.0}, {{-2.0, 2.0}, 1.0}, {{-2.0, -2.0}, 1.0}, {{2.0, -2.0}, 1.0}};
}

}  // namespace locfuse::testing
