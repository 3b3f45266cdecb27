// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace locfuse::internal {

/// Truncated least squares by graduated non-convexity (Yang et al., 2020): from a problem without
/// local minima to the one in which what is beyond its limit has no weight; docs/smoothing.md
/// eq. (4). `share_of(k)` is a squared residual over its limit, infinity where there is none;
/// `solve()` solves with the `weights`, of which those of `is_gated(k)` change.
template <class Gated, class Share, class Solve>
void reject_gradually(std::vector<double>& weights, const Gated& is_gated, const Share& share_of,
                      const Solve& solve) {
  constexpr double kGrowth = 4.0;
  constexpr int kMaxRounds = 60;
  double worst = 0.0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    worst = is_gated(k) ? std::max(worst, share_of(k)) : worst;
  }
  if (worst <= 1.0) {
    return;
  }
  double mu = 1.0 / std::max(2.0 * worst - 1.0, 1.0);
  for (int round = 0; round < kMaxRounds; ++round) {
    bool is_decided = true;
    for (std::size_t k = 0; k < weights.size(); ++k) {
      if (!is_gated(k)) {
        continue;
      }
      const double share = share_of(k);
      if (share <= mu / (mu + 1.0)) {
        weights[k] = 1.0;
      } else if (share >= (mu + 1.0) / mu) {
        weights[k] = 0.0;
      } else {
        weights[k] = std::sqrt(mu * (mu + 1.0) / share) - mu;
        is_decided = is_decided && (weights[k] < 1e-3 || weights[k] > 1.0 - 1e-3);
      }
    }
    solve();
    if (is_decided && mu >= 1.0) {
      return;
    }
    mu *= kGrowth;
  }
}

}  // namespace locfuse::internal
