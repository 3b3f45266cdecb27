// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/messages/messages.hpp"

namespace locfuse::internal {

/// End of a beam and the line of the wall there; docs/models/scans.md eq. (1.10).
struct LinePoint {
  Vector<2> end;     ///< [m]
  Vector<2> foot;    ///< of the end on the line through it and its neighbours; or the end
  Vector<2> normal;  ///< of the line, towards the laser; zero without a line
  double variance;   ///< of the end across the line; of the range without a line [m^2]
  double spacing;    ///< of two beams at this range [m]
  double gap;        ///< to the nearer end of the two beams next to it [m]
};

/// End points of the returns, in body. Throws std::invalid_argument if the scan is not valid.
[[nodiscard]] std::vector<LinePoint> line_points(const LaserScan& scan, double sigma_range_m);

/// A point transformed by `pose`.
[[nodiscard]] LinePoint moved(const LinePoint& point, const Pose2& pose);

}  // namespace locfuse::internal
