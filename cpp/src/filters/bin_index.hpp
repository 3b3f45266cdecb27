// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/particles.hpp"

namespace locfuse::internal {

/// Numbers the bins: heading, row and column in one integer.
class Binning {
 public:
  /// Throws std::invalid_argument unless the side is > 0 and there is at least one heading.
  explicit Binning(const ParticleBins& bins);

  [[nodiscard]] std::int64_t bin(const ParticleBelief& belief, std::size_t k) const;

  /// Calls `each` with the bin and its 26 neighbours.
  template <class Each>
  void around(std::int64_t bin, const Each& each) const {
    const std::int64_t heading = bin >> 48;
    const std::int64_t row = (bin >> 24) & 0xFFFFFF;
    const std::int64_t column = bin & 0xFFFFFF;
    for (int h = -1; h <= 1; ++h) {
      for (int r = -1; r <= 1; ++r) {
        for (int c = -1; c <= 1; ++c) {
          each(number((heading + h + headings_) % headings_, row + r, column + c));
        }
      }
    }
  }

 private:
  static constexpr std::int64_t kShift = 1 << 20;                // so that none is negative
  static constexpr std::int64_t kLast = (1 << 24) - 1 - kShift;  // that 24 bits hold
  [[nodiscard]] std::int64_t along(float cells) const;
  static std::int64_t number(std::int64_t heading, std::int64_t row, std::int64_t column) {
    return heading << 48 | row << 24 | column;
  }
  double per_side_;
  int headings_;
};

/// Which bins are occupied, and by which particles.
struct Occupied {
  std::vector<std::int64_t> numbers;      ///< of each bin, in order of the first particle in it
  std::vector<std::int32_t> of_particle;  ///< index into `numbers`
  std::unordered_map<std::int64_t, std::int32_t> at;
};

[[nodiscard]] Occupied occupied(const ParticleBelief& belief, const Binning& binning);

}  // namespace locfuse::internal
