// SPDX-License-Identifier: Apache-2.0
#include "models/measurement/field_lanes.hpp"

#include "math/lanes.hpp"
#ifdef __SSE2__
#include <immintrin.h>
#endif

namespace locfuse::internal::LOCFUSE_LANES {

namespace {

static_assert(8 % kLanes == 0);

#if defined(__AVX2__)
using Sums = Indices;
#else
struct Sums {  // in scalar registers: packing bytes into lanes takes longer
  std::int32_t of[kLanes];
};
#endif

/// Adds the cost of a cell for each lane. With kNarrow, rows and columns are below 2^15.
template <bool kNarrow>
inline void add_costs(const CostTable& table, const Indices& column, const Indices& row,
                      Sums& sums) {
#if defined(__AVX2__)
  const __m256i at = reinterpret_cast<__m256i>(Indices(row * table.width + column));
  // Gathers four bytes, of which the first is used; the table is padded by three.
  const __m256i four = _mm256_i32gather_epi32(reinterpret_cast<const int*>(table.cells), at, 1);
  sums += reinterpret_cast<Indices>(_mm256_and_si256(four, _mm256_set1_epi32(0xFF)));
#else
  Indices cell{};
#if defined(__SSE2__)
  if constexpr (kNarrow) {  // SSE2 has no 32-bit product, but sums products of 16-bit halves
    const __m128i both = reinterpret_cast<__m128i>(Indices(row | (column << 16)));
    cell = reinterpret_cast<Indices>(_mm_madd_epi16(both, _mm_set1_epi32(table.width | (1 << 16))));
  } else {
    cell = row * table.width + column;
  }
#else
  cell = row * table.width + column;
#endif
  for (int l = 0; l < kLanes; ++l) {
    sums.of[l] += table.cells[cell[l]];
  }
#endif
}

template <bool kNarrow>
void sum_of(const CostTable& table, const float* x, const float* y, int count,
            const LanePoses& poses, int begin, int end, std::int32_t off_map, std::int32_t* sums) {
  const auto rim = static_cast<float>(table.rim);
  const Lanes right = all(static_cast<float>(table.width) - 2.0F * rim);
  const Lanes top = all(static_cast<float>(table.height) - 2.0F * rim);
  for (int i = begin; i < end; i += kLanes) {
    const Lanes px = load(poses.x + i);
    const Lanes py = load(poses.y + i);
    const Indices on_map = (px >= 0.0F) & (px < right) & (py >= 0.0F) & (py < top);
    const Lanes x0 = on_map ? px + rim : all(rim);
    const Lanes y0 = on_map ? py + rim : all(rim);
    const Lanes c = load(poses.c + i);
    const Lanes s = load(poses.s + i);
    Sums costs{};
    for (int k = 0; k < count; ++k) {
      add_costs<kNarrow>(table, whole(x0 + c * x[k] - s * y[k]), whole(y0 + s * x[k] + c * y[k]),
                         costs);
    }
    Indices total;
    __builtin_memcpy(&total, &costs, sizeof total);
    total = on_map ? total : Indices{} + off_map;
    __builtin_memcpy(sums + i, &total, sizeof total);
  }
}

}  // namespace

void sum_costs(const CostTable& table, const float* x, const float* y, int count,
               const LanePoses& poses, int begin, int end, std::int32_t off_map,
               std::int32_t* sums) {
  if (table.width < (1 << 15) && table.height < (1 << 15)) {
    sum_of<true>(table, x, y, count, poses, begin, end, off_map, sums);
  } else {
    sum_of<false>(table, x, y, count, poses, begin, end, off_map, sums);
  }
}

}  // namespace locfuse::internal::LOCFUSE_LANES
