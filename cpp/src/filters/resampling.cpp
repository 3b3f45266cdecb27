// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/resampling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "filters/bin_index.hpp"
#include "filters/fast_math.hpp"
#include "locfuse/math/counter_random.hpp"

namespace locfuse {
namespace {

constexpr double kMinBoxSide = 0.1;  // of a box that is more than a point [cells]

/// Spreads copies over the box that their original stood for; each stands for its part of it.
void share_box(ParticleBelief& belief, int begin, int end, std::uint64_t key) {
  const double side = static_cast<double>(belief.box[static_cast<std::size_t>(begin)]);
  const double part = side / std::cbrt(end - begin);
  const double sigma = std::sqrt((side * side - part * part) / 12.0);
  for (int i = begin; i < end; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Vector<3> off = Vector<3>(sigma, sigma, belief.turn_per_cell * sigma)
                              .cwiseProduct(random_normal3(key, static_cast<std::uint64_t>(i)));
    belief.put(k, retract(belief.pose(k), off));
    belief.box[k] = part < kMinBoxSide ? 0.0F : static_cast<float>(part);
  }
}

/// Puts `copies` of some particles, of `weight` together, to `to` and on: by one random number and
/// equal steps. `at` gives the index of each of the `count`.
template <class At>
void draw(const ParticleBelief& belief, int count, const At& at, double weight, int copies,
          double uniform, std::uint64_t key, ParticleBelief& drawn, int to) {
  const double step = weight / copies;
  const int all = to + copies;
  double next = uniform * step;
  double passed = 0.0;
  for (int from = 0; from < count && to < all; ++from) {
    const std::size_t k = at(from);
    passed += static_cast<double>(belief.weight[k]);
    const bool last = from + 1 == count;  // rounding may leave the last ones over
    const int first = to;
    for (; to < all && (next < passed || last); ++to, next += step) {
      drawn.put(static_cast<std::size_t>(to), belief, k);
    }
    if (to - first > 1 && belief.box[k] > 0.0F) {
      share_box(drawn, first, to, random_bits(key, 1));
    }
  }
}

}  // namespace

void resample(ParticleBelief& belief, int count, const FreshParticles& fresh, std::uint64_t key,
              ParticleBelief& scratch) {
  scratch.resize(count);
  scratch.stamp = belief.stamp;
  scratch.turn_per_cell = belief.turn_per_cell;
  const int kept = std::max(count - fresh.count, 1);
  draw(
      belief, belief.size, [](int k) { return static_cast<std::size_t>(k); },
      internal::sums_of(belief.weight, belief.size).first, kept, random_uniform(key, 0), key,
      scratch, 0);
  const double probability = kept < count ? fresh.probability : 0.0;
  const auto weights = scratch.weight.begin();
  std::fill(weights, weights + kept, static_cast<float>((1.0 - probability) / kept));
  std::fill(weights + kept, weights + count,
            static_cast<float>(probability / std::max(count - kept, 1)));
  for (int to = kept; to < count; ++to) {
    fresh.draw(scratch, to);
  }
  std::swap(belief, scratch);
}

void resample_by_bin(ParticleBelief& belief, int count, const ParticleBins& bins, double power,
                     double min_share, std::uint64_t key, ParticleBelief& scratch) {
  const internal::Occupied in = internal::occupied(belief, internal::Binning(bins));
  std::vector<double> weight(in.numbers.size(), 0.0);
  for (std::size_t k = 0; k < in.of_particle.size(); ++k) {
    weight[static_cast<std::size_t>(in.of_particle[k])] += static_cast<double>(belief.weight[k]);
  }
  // Those that are kept have one particle at least, and share the others out.
  const double total = std::accumulate(weight.begin(), weight.end(), 0.0);
  double shares = 0.0;
  int kept = 0;
  std::vector<double> share(weight.size(), 0.0);
  for (std::size_t b = 0; b < weight.size(); ++b) {
    if (weight[b] >= min_share * total) {
      share[b] = std::pow(weight[b] / total, power);
      shares += share[b];
      ++kept;
    }
  }
  if (kept > count) {
    resample(belief, count, {}, key, scratch);
    return;
  }
  std::vector<int> copies(weight.size(), 0);
  double passed = 0.0;
  int given = 0;
  for (std::size_t b = 0; b < weight.size(); ++b) {
    if (share[b] > 0.0) {
      passed += share[b] / shares * (count - kept);
      copies[b] = 1 + static_cast<int>(passed + 1e-9) - given;
      given += copies[b] - 1;
    }
  }
  // Particles of a bin together, in their order.
  std::vector<std::size_t> begin(weight.size(), 0);
  for (const std::int32_t b : in.of_particle) {
    ++begin[static_cast<std::size_t>(b)];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::size_t> order(in.of_particle.size());
  for (std::size_t k = in.of_particle.size(); k-- > 0;) {
    order[--begin[static_cast<std::size_t>(in.of_particle[k])]] = k;
  }
  scratch.resize(kept + given);
  scratch.stamp = belief.stamp;
  scratch.turn_per_cell = belief.turn_per_cell;
  int to = 0;
  for (std::size_t b = 0; b < weight.size(); ++b) {
    if (copies[b] == 0) {
      continue;
    }
    const std::size_t first = begin[b];
    const std::size_t last = b + 1 < weight.size() ? begin[b + 1] : order.size();
    draw(
        belief, static_cast<int>(last - first),
        [&](int i) { return order[first + static_cast<std::size_t>(i)]; }, weight[b], copies[b],
        random_uniform(key, b), key, scratch, to);
    std::fill_n(scratch.weight.begin() + to, copies[b],
                static_cast<float>(weight[b] / copies[b] / total));
    to += copies[b];
  }
  std::swap(belief, scratch);
}

}  // namespace locfuse
