// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/covariance.hpp"
#include "locfuse/math/symmetric.hpp"

/// Guards of the Kalman filter against rounding: they keep P positive definite and its variances
/// between bounds. Derivation: docs/models/updates.md, section "Bounds".
namespace locfuse::internal {

/// Limits of the guards, all of them ratios of variances; eq. (1.19) and (1.20) of
/// docs/models/updates.md.
struct GuardTuning {
  /// Noise added to a variance is at least this share of it: less would be lost in its rounding,
  /// and with it what keeps P positive definite.
  static constexpr double kMinNoiseShare = 1e-13;
  /// Below this share what is left has few digits, and all of P is checked.
  static constexpr double kFewDigitsShare = 10.0 * kMinNoiseShare;
  /// Factor by which a variance may grow without noise before all of P is checked.
  static constexpr double kMaxGrowth = 100.0;
  /// Of a diagonal, what rounding leaves at least.
  static constexpr double kAfterRounding = 1.0 - 0.5 * kMinNoiseShare;
};

/// Whether the first three rows of P, the pose if there is one, are positive definite: elimination
/// without divisions.
[[nodiscard]] inline bool is_pose_positive_definite(const Covariance& P) {
  if (P.rows() < 3) {
    return true;
  }
  const double a = P(0, 0) * GuardTuning::kAfterRounding;
  const double b = a * (P(1, 1) * GuardTuning::kAfterRounding) - P(1, 0) * P(1, 0);
  const double c = a * (P(2, 2) * GuardTuning::kAfterRounding) - P(2, 0) * P(2, 0);
  const double shared = a * P(2, 1) - P(1, 0) * P(2, 0);
  return a > 0.0 && b > 0.0 && b * c > shared * shared;
}

/// Whether all of P is positive definite; O(n^3).
[[nodiscard]] bool is_positive_definite(const Covariance& P);

/// For each row of a Jacobian the sum of J_ij^2 P_jj: the scale of the terms that J P J' adds up.
template <class Jacobian, class Variances>
[[nodiscard]] auto reach_of(const Jacobian& jacobian, const Variances& variances) {
  return (jacobian.cwiseAbs2() * variances).eval();
}

/// Raises the variances of `moved`, predicted by a Jacobian of that reach from those `before`,
/// where `noise` is too small beside them. Returns how many it raised.
template <class P, class Reach, class Before, class Noise>
std::uint64_t keep_noise(P& moved, const Reach& reach, const Before& before, const Noise& noise) {
  std::uint64_t count = 0;
  for (Eigen::Index i = 0; i < noise.size(); ++i) {
    const double min_noise = GuardTuning::kMinNoiseShare * (reach(i) + noise(i) - before(i));
    if (noise(i) < min_noise) {
      moved(i, i) += min_noise;
      ++count;
    }
  }
  return count;
}

/// Whether noise is less than that share of itself and of that reach in any direction, that is,
/// R - share diag(R + reach) is not positive definite. A dominant diagonal shows that it is.
template <class Noise, class Reach>
[[nodiscard]] bool is_less_than(double share, const Noise& noise, const Reach& reach) {
  bool outweighs = true;
  for (Eigen::Index i = 0; i < reach.size(); ++i) {
    const double rest = noise.row(i).cwiseAbs().sum() - noise(i, i);
    outweighs = outweighs && noise(i, i) - rest >= share * (noise(i, i) + reach(i));
  }
  if (outweighs || reach.size() == 1) {
    return !outweighs;
  }
  auto more = noise.eval();
  more.diagonal() -= share * (noise.diagonal() + reach);
  return !factorize(more);
}

/// Whether an update may leave few digits of P along what is measured: of H P H', or of R.
template <class Noise, class S, class Reach>
[[nodiscard]] bool leaves_few_digits(const Noise& noise, const S& innovation, const Reach& reach) {
  bool few = false;
  for (Eigen::Index i = 0; i < reach.size(); ++i) {
    few = few || innovation(i, i) - noise(i, i) < GuardTuning::kFewDigitsShare * reach(i);
  }
  return few || is_less_than(GuardTuning::kFewDigitsShare, noise, reach);
}

/// The measurement with its noise raised above the rounding of that reach.
template <class Lin, class Reach>
[[nodiscard]] Lin with_noise_kept(Lin lin, const Reach& reach) {
  lin.noise.diagonal() += GuardTuning::kMinNoiseShare * (lin.noise.diagonal() + reach);
  return lin;
}

/// Keeps the variances of `count` rows from `first` on between their bounds, and the pose's part of
/// P positive definite, or all of P where it may have `few` digits left; eq. (1.17) and (1.18) of
/// docs/models/updates.md.
void keep_in_bounds(GaussianBelief& belief, Eigen::Index first, Eigen::Index count,
                    bool few = false);

}  // namespace locfuse::internal
