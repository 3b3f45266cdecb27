// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/geometry/line2.hpp"
#include "locfuse/maps/occupancy_grid.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

struct LineFeaturesConfig {
  double tolerance_m = 0.06;   ///< maximum distance of a return from its line
  double max_gap_m = 0.3;      ///< between neighbouring returns of a line
  int min_points = 6;          ///< on a line
  double min_length_m = 0.5;   ///< of a line
  double min_sigma_m = 0.001;  ///< minimum noise of a point across its line
};

/// A line and how well it is known.
struct LineFeature {
  Line2 line;
  Matrix<2, 2> covariance = Matrix<2, 2>::Zero();  ///< of (r, alpha)
  int first = 0;  ///< beam of the scan where it begins, below `last`; 0 for one of a map
  int last = 0;   ///< beam where it ends
};

/// Lines of a scan, in body, by split and merge with total least squares, the longest first;
/// docs/models/scans.md. The noise of the returns is estimated from the fits. Throws
/// std::invalid_argument if the scan is not valid or on a setting out of bounds.
[[nodiscard]] std::vector<LineFeature> scan_line_features(const LaserScan& scan,
                                                          const LineFeaturesConfig& config = {});

/// Lines of the boundary between free and occupied cells, in world, by the same code, the longest
/// first. A corner of a cell is at most half of the cell's width across the wall off its line.
/// Throws std::invalid_argument on a setting out of bounds.
[[nodiscard]] std::vector<LineFeature> map_line_features(const OccupancyGrid& grid,
                                                         const LineFeaturesConfig& config = {});

}  // namespace locfuse
