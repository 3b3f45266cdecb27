// SPDX-License-Identifier: Apache-2.0
#include "filters/bin_index.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <stdexcept>
#include <string>

#include "filters/fast_math.hpp"
#include "locfuse/math/angle.hpp"

namespace locfuse {
namespace internal {

Binning::Binning(const ParticleBins& bins)
    : per_side_(1.0 / bins.side), headings_(static_cast<int>(bins.headings)) {
  if (!(bins.side > 0.0 && headings_ >= 1)) {
    throw std::invalid_argument("bins have a side of " + std::to_string(bins.side) + " cells and " +
                                std::to_string(headings_) +
                                " headings, expected more than 0, and 1 or more");
  }
}

std::int64_t Binning::bin(const ParticleBelief& belief, std::size_t k) const {
  const std::int64_t column = along(belief.x[k]);
  const std::int64_t row = along(belief.y[k]);
  const double turn = static_cast<double>(heading_of(belief.c[k], belief.s[k])) / (2.0 * kPi) + 0.5;
  const auto heading = static_cast<std::int64_t>(turn * headings_) % headings_;
  return number(heading, row + kShift, column + kShift);
}

/// Row or column. All that lies beyond the last one but one is in that, so that its neighbours
/// exist.
std::int64_t Binning::along(float cells) const {
  const double bin = static_cast<double>(cells) * per_side_;
  return static_cast<std::int64_t>(
      std::clamp(bin, 1.0 - static_cast<double>(kShift), static_cast<double>(kLast) - 1.0));
}

Occupied occupied(const ParticleBelief& belief, const Binning& binning) {
  // Most particles share few bins: the last ones seen are kept at hand.
  struct Seen {
    std::int64_t number = -1;
    std::int32_t index = 0;
  };
  std::array<Seen, 64> seen;
  Occupied result;
  result.of_particle.resize(static_cast<std::size_t>(belief.size));
  for (std::size_t k = 0; k < result.of_particle.size(); ++k) {
    const std::int64_t number = binning.bin(belief, k);
    Seen& slot = seen[static_cast<std::size_t>(number ^ (number >> 22) ^ (number >> 44)) % 64];
    if (slot.number != number) {
      const auto [found, is_new] =
          result.at.try_emplace(number, static_cast<std::int32_t>(result.numbers.size()));
      if (is_new) {
        result.numbers.push_back(number);
      }
      slot = {number, found->second};
    }
    result.of_particle[k] = slot.index;
  }
  return result;
}

}  // namespace internal

int occupied_bins(const ParticleBelief& belief, const ParticleBins& bins, double min_share) {
  const internal::Occupied in = internal::occupied(belief, internal::Binning(bins));
  std::vector<std::uint8_t> counts(in.numbers.size());
  for (std::size_t k = 0; k < in.of_particle.size(); ++k) {
    if (belief.weight[k] * static_cast<float>(belief.size) >= static_cast<float>(min_share)) {
      counts[static_cast<std::size_t>(in.of_particle[k])] = 1;
    }
  }
  return std::accumulate(counts.begin(), counts.end(), 0);
}

double kld_particles(int bins, double error, double quantile) {
  if (bins < 2) {
    return 1.0;
  }
  const double k = bins - 1;
  const double b = 2.0 / (9.0 * k);
  const double root = 1.0 - b + std::sqrt(b) * quantile;
  return k / (2.0 * error) * root * root * root;
}

}  // namespace locfuse
