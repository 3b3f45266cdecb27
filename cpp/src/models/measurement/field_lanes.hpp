// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// Many poses at once; see math/lanes.hpp.
namespace locfuse::internal {

/// Costs of cells, row by row, with a rim that contains all end points of poses on the map.
struct CostTable {
  const std::uint8_t* cells;
  int width, height;  ///< with the rim
  int rim;
};

/// Poses in cells of the map: position, cosine and sine of the heading.
struct LanePoses {
  const float *x, *y, *c, *s;
};

/// Sums the costs of end points (in the body, in cells) seen from poses `begin` to `end`, whole
/// groups of eight. Poses off the map get `off_map`.
using SumCosts = void (*)(const CostTable&, const float* x, const float* y, int count,
                          const LanePoses&, int begin, int end, std::int32_t off_map,
                          std::int32_t* sums);

namespace portable {
void sum_costs(const CostTable& table, const float* x, const float* y, int count,
               const LanePoses& poses, int begin, int end, std::int32_t off_map,
               std::int32_t* sums);
}
#ifdef LOCFUSE_LANES_AVX2
namespace avx2 {
void sum_costs(const CostTable& table, const float* x, const float* y, int count,
               const LanePoses& poses, int begin, int end, std::int32_t off_map,
               std::int32_t* sums);
}
#endif

}  // namespace locfuse::internal
