// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/mcl_seen_surfaces.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "locfuse/math/counter_random.hpp"
#include "particles/mcl_tuning.hpp"

namespace locfuse::internal {
namespace {

struct Entry {
  std::size_t place;
  std::uint32_t signature;
};

Entry entry_of(std::int64_t column, std::int64_t row, int level) {
  const std::uint64_t bits =
      random_bits(static_cast<std::uint64_t>(column) * 64U + static_cast<std::uint64_t>(level),
                  static_cast<std::uint64_t>(row));
  return {bits % SeenSurfacesTuning::kEntries, static_cast<std::uint32_t>(bits >> 32U) | 1U};
}

}  // namespace

double SeenSurfaces::news(const EndPoints& points, const Pose2& here, double resolution) {
  using Tuning = SeenSurfacesTuning;
  seen_.resize(Tuning::kEntries, 0);
  std::size_t fresh = 0;
  for (std::size_t k = 0; k < points.x.size(); ++k) {
    const Vector<2> end{static_cast<double>(points.x[k]), static_cast<double>(points.y[k])};
    // Far away beams are far apart, so that the pieces which they can tell apart grow.
    const double range = std::max(end.norm() * resolution, Tuning::kNear);
    const int level = static_cast<int>(std::ceil(std::log2(range / Tuning::kNear)));
    const Vector<2> at = here.act(end) * (resolution / std::ldexp(Tuning::kSide, level));
    const auto column = static_cast<std::int64_t>(std::floor(at.x()));
    const auto row = static_cast<std::int64_t>(std::floor(at.y()));
    const Entry own = entry_of(column, row, level);
    fresh += seen_[own.place] == own.signature ? 0 : 1;
    seen_[own.place] = own.signature;
  }
  return static_cast<double>(fresh) / static_cast<double>(points.x.size());
}

}  // namespace locfuse::internal
