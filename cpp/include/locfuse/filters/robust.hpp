// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "locfuse/filters/kalman.hpp"
#include "locfuse/filters/noise_shape.hpp"

namespace locfuse {

namespace internal {

/// Throws std::invalid_argument if it has a long side and rows more than one.
void check_sides(const NoiseShape& shape, Eigen::Index rows);

/// `PHt` is of the whole belief, `C` is H P H'.
template <class Lin, class Cross, class R>
Outcome fuse_moment_matched(GaussianBelief& belief, const Lin& lin, Slots slots, const Gate& gate,
                            const NoiseShape& shape, const Cross& PHt, const R& C) {
  Cross K;
  const Outcome outcome = compare(lin, PHt, R(C + lin.noise), gate, K);
  if (outcome.verdict == Verdict::kGated) {
    return outcome;
  }
  constexpr int kMaxRows = R::MaxRowsAtCompileTime;
  constexpr int kRows = kMaxRows > 3 ? Eigen::Dynamic : kMaxRows == 2 ? 3 : kMaxRows;
  const auto matched = shape.moment_match<kRows>(lin.residual, C, lin.noise);
  Lin gaussian = lin;
  gaussian.residual = matched.residual;
  gaussian.noise = matched.noise;
  (void)update(belief, gaussian, slots, Gate());
  Cross moved = PHt;
  for (const int row : belief.considered_rows()) {
    moved.row(row).setZero();
  }
  // Eq. (6), as a sum of squares: a difference would have no digits left where P is nearly flat
  // along what is measured. The same above the diagonal.
  const Eigen::Matrix<double, Cross::RowsAtCompileTime, Eigen::Dynamic, Eigen::RowMajor,
                      Cross::MaxRowsAtCompileTime, decltype(matched.spread)::MaxColsAtCompileTime>
      widening = moved * matched.spread;
  bool few = false;
  for (Eigen::Index j = 0; j < belief.P.cols(); ++j) {
    const double before = belief.P(j, j);
    for (Eigen::Index i = 0; i <= j; ++i) {
      belief.P(i, j) += widening.row(i).dot(widening.row(j));
      belief.P(j, i) = belief.P(i, j);
    }
    few = few || belief.P(j, j) > GuardTuning::kMaxGrowth * before;
  }
  keep_in_bounds(belief, 0, belief.dimension(), few);
  return outcome;
}

/// Where the slots are part of the belief, or the sizes are known at run time only.
Outcome update_robust_part(GaussianBelief& belief,
                           const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin, Slots slots,
                           const Gate& gate, const NoiseShape& shape);

template <int M, int N, int MaxM>
Outcome update_robust(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin, Slots slots,
                      const Gate& gate, const NoiseShape& shape) {
  check_rows(lin);
  check_sides(shape, lin.residual.size());
  if constexpr (N != Eigen::Dynamic && MaxM != Eigen::Dynamic) {
    if (belief.is_whole(slots, N)) {
      using R = Eigen::Matrix<double, M, M, Eigen::ColMajor, MaxM, MaxM>;
      using Cross = Eigen::Matrix<double, N, M, Eigen::ColMajor, N, MaxM>;
      const Matrix<N, N> P = belief.P;
      const Cross PHt = P * lin.jacobian.transpose();
      return fuse_moment_matched(belief, lin, slots, gate, shape, PHt, R(lin.jacobian * PHt));
    }
  }
  return update_robust_part(belief, any_size(lin), slots, gate, shape);
}

}  // namespace internal

/// Fuses a measurement whose noise has a shape, or gates it: the gate, and the outcome's nis, take
/// the noise as Gaussian. Throws as the plain update does, and std::invalid_argument for one-sided
/// noise of several rows.
template <int M, int N, int MaxM>
Outcome update(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin, Slots slots,
               const Gate& gate, const NoiseShape& shape) {
  return shape.is_gaussian() ? update(belief, lin, slots, gate)
                             : internal::update_robust(belief, lin, slots, gate, shape);
}

// Compiled once, in robust_shapes.cpp, for the shapes that the estimators use.
extern template Outcome update(GaussianBelief&, const Linearization<1, 3>&, Slots, const Gate&,
                               const NoiseShape&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 2>&, Slots,
                               const Gate&, const NoiseShape&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 3>&, Slots,
                               const Gate&, const NoiseShape&);
extern template Outcome update(GaussianBelief&, const Linearization<1, 4>&, Slots, const Gate&,
                               const NoiseShape&);
extern template Outcome update(GaussianBelief&, const Linearization<1, 15>&, Slots, const Gate&,
                               const NoiseShape&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 15, 3>&, Slots,
                               const Gate&, const NoiseShape&);
extern template Outcome update(GaussianBelief&, const Linearization<1, Eigen::Dynamic>&, Slots,
                               const Gate&, const NoiseShape&);

}  // namespace locfuse
