// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

/// Many epochs at once, one per lane of a vector register. Compiled once for every processor and
/// once for those with AVX2; nothing that is compiled twice may be shared, so only plain arrays
/// appear here.
namespace locfuse::internal {

/// Layout as the lanes read it; see RangeLayout.
struct LaneLayout {
  int size = 0;
  const double* anchor[3] = {};            ///< per axis, relative to the centroid [m]
  const double* height_squared = nullptr;  ///< [m^2]
  const double* information = nullptr;     ///< 1 / sigma^2
  double axes[3][3] = {};                  ///< [row][column]
  double stiffness[3] = {};                ///< 4 mu [m^2]
  double strong_below = 0.0;               ///< larger costs are left to the scalar code
};

/// Results of one group of epochs; `solved[l]` is false where the scalar code has to solve.
struct LaneResult {
  static constexpr int kMaxLanes = 8;
  double position[3][kMaxLanes];    ///< relative to the centroid [m]
  double covariance[6][kMaxLanes];  ///< lower triangle, row by row [m^2]
  double cost[kMaxLanes];
  bool solved[kMaxLanes];
};

/// Solves `lanes()` epochs of `layout.size` ranges each, N = 2 or 3: SR-LS, then three Newton steps
/// on the cost, without a loss.
struct LaneSolver {
  int lanes;
  void (*solve2)(const LaneLayout&, const double* ranges, LaneResult&);
  void (*solve3)(const LaneLayout&, const double* ranges, LaneResult&);
};

namespace portable {
[[nodiscard]] LaneSolver range_lanes();
}
#ifdef LOCFUSE_LANES_AVX2
namespace avx2 {
[[nodiscard]] LaneSolver range_lanes();
}
#endif

}  // namespace locfuse::internal
