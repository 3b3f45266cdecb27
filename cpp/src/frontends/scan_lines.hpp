// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/messages/messages.hpp"

namespace locfuse::internal {

/// Where a beam ended, and the wall there; docs/models/scan_matching.md eq. (10).
struct LinePoint {
  Vector<2> end;     ///< [m]
  Vector<2> foot;    ///< on the line through the ends of this beam and its neighbours; or the end
  Vector<2> normal;  ///< of the line, to the laser; zero where they are on no line
  double variance;   ///< of the end across the line; of the range where there is none [m^2]
  double spacing;    ///< of two beams at this range [m]
  double gap;        ///< to the nearer end of the two beams next to it [m]
};

/// The beams that came back, in body. Throws std::invalid_argument if the scan is not valid.
[[nodiscard]] std::vector<LinePoint> line_points(const LaserScan& scan, double sigma_range_m);

/// The same point seen from where `pose` leads.
[[nodiscard]] LinePoint moved(const LinePoint& point, const Pose2& pose);

}  // namespace locfuse::internal
