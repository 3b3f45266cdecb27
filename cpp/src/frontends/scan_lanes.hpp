// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// Many beams at once, one per lane of a vector register, in single precision: accurate to 1e-3
/// cells on the largest maps. Compiled once for every processor and once for those with AVX2;
/// nothing that is compiled twice may be shared, so only plain arrays appear here. Lengths are in
/// cells.
namespace locfuse::internal {

/// Arrays of beams are padded to a multiple of this.
constexpr int kBeamGroup = 8;

/// Residual of a beam without a wall.
constexpr float kFar = 1e6F;

/// End points in body; `used` is 1, or 0 for padding.
struct LaneBeams {
  int count = 0;
  const float* x = nullptr;
  const float* y = nullptr;
  const float* used = nullptr;
};

/// A pose of the body in a field.
struct LanePose {
  float c, s, x, y;
};

/// See DistanceField: the field row by row, then its surroundings.
struct DistanceTable {
  const float* cells;
  int width, height;
  int far_width, far_height;
  float far_cells;  ///< side of a far cell
};

/// Wall line matched with each end point, and the beams per length of wall.
struct LaneWalls {
  const float *x, *y, *nx, *ny, *run, *per_spacing;
};

/// Weighting of residuals; docs/models/scans.md eq. (1.4) to (1.6).
struct LaneWeights {
  float laser_x, laser_y;  ///< from the body, in the field's axes
  float reach_squared;     ///< walls farther away than this do not match
  float kernel_squared;
  float map_variance;
  float beam_variance;
  float offset;
  bool hard;  ///< full weight within the kernel, instead of a smooth kernel
};

/// Weighted sums of products of (nx, ny, turn, 1, residual), as accumulate() fills them.
struct LaneSums {
  double xx, xy, xt, x, yy, yt, y, tt, t, w, xe, ye, te, e, lever, matches;
};

struct ScanLanes {
  /// Sum of the distances at the end points; negative if one is too far off for the table.
  double (*sum_distances)(const DistanceTable&, const LaneBeams&, const LanePose&);
  /// Nearest target of each end point; off the field that of its edge.
  void (*find_targets)(const std::int32_t* nearest, int width, int height, const LaneBeams&,
                       const LanePose&, std::int32_t* targets);
  /// Residuals (kFar without a wall), the number of beams that share an error, and the sums.
  void (*accumulate)(const LaneBeams&, const LanePose&, const LaneWalls&, const LaneWeights&,
                     float* residuals, float* correlated, LaneSums&);
};

namespace portable {
[[nodiscard]] ScanLanes scan_lanes();
}
#ifdef LOCFUSE_LANES_AVX2
namespace avx2 {
[[nodiscard]] ScanLanes scan_lanes();
}
#endif

/// Fastest kernels that this processor supports.
[[nodiscard]] ScanLanes scan_lanes();

}  // namespace locfuse::internal
