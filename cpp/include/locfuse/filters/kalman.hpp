// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "locfuse/error.hpp"
#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/filters/positive_definite.hpp"
#include "locfuse/math/linearization.hpp"

/// The extended Kalman filter: the only code that changes a GaussianBelief. One algebra, templated
/// on sizes: without heap at fixed sizes where the local variables are the whole belief, at
/// run-time sizes otherwise. Derivation: docs/models/updates.md.
namespace locfuse {

/// Moves the pose in `slot`: mean to `step.moved`, P to F P F' + Q with its cross-covariances.
/// Throws NumericalError, belief untouched, if a result is not finite. Touches three rows and
/// columns.
void predict(GaussianBelief& belief, const Propagation<Pose2, 3>& step, Slot slot);

/// Moves the first variables of `slots`, as many as `step.moved` has, by a motion that depends on
/// all of them: its Jacobian has a row for each that moves, a column for each. Eq. (1.13) and
/// (1.14) of docs/models/updates.md.
///
/// Throws NumericalError, belief untouched, if a result is not finite or a variance not positive,
/// std::invalid_argument if sizes do not match. Touches as many rows and columns as move.
void predict(GaussianBelief& belief, const Propagation<Eigen::VectorXd, Eigen::Dynamic>& step,
             Slots slots);

/// The same at fixed sizes: where `slots` are the whole belief, in order, it allocates nothing.
template <int N>
void predict(GaussianBelief& belief, const Propagation<Vector<N>, N>& step, Slots slots);

/// Adds to the variance of a variable of one number, which wanders.
void diffuse(GaussianBelief& belief, Slot slot, double variance);

/// Fuses a measurement, or gates it; eq. (1.1) to (1.6) of docs/models/updates.md.
///
/// `slots` are the variables that the Jacobian's columns stand for, in order. The belief is updated
/// whole or not at all. Throws NumericalError if S is not positive definite or a result is not
/// finite, std::invalid_argument if the slots do not match the Jacobian or rows do not match.
template <int M, int N, int MaxM>
Outcome update(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin, Slots slots,
               const Gate& gate);

/// Turns the covariance of the pose in `slot` with its mean, which an update has moved away from
/// `before`: eq. (1.15) of docs/models/updates.md. Touches two rows and columns, or none where
/// rounding would leave a variance that is not positive.
void turn_with_mean(GaussianBelief& belief, Slot slot, const Vector<2>& before);

/// The same for a belief of a pose and of points that it has mapped, all of which an update has
/// moved from `before`: what is seen from the pose then never says where north is. The mean goes
/// on the arcs that the correction of the heading makes of its steps, so that the map keeps its
/// form.
void turn_map_with_mean(GaussianBelief& belief, const Eigen::VectorXd& before);

/// Adds a variable g(y, v) that is a function of those in `slots`, y, and of noise v: `mean` is g,
/// `jacobian` dg/dy, `noise` the covariance that v gives it. Eq. (1.11) and (1.12) of
/// docs/models/updates.md. The belief is changed whole or not at all.
///
/// Throws NumericalError if a number is not finite, or `noise` or the covariance of g not positive
/// definite, std::invalid_argument on a name that is taken or sizes that do not match.
Slot augment(GaussianBelief& belief, const std::string& name, SlotKind kind,
             const Eigen::Ref<const Eigen::VectorXd>& mean,
             const Eigen::Ref<const Eigen::MatrixXd>& jacobian,
             const Eigen::Ref<const Eigen::MatrixXd>& noise, Slots slots);

/// The error of the measurement that has placed the last variable, which those after it may be
/// correlated with: its noise, and G_v of eq. (1.11) in place of a Jacobian; eq. (1.24).
void keep_error_of_new(GaussianBelief& belief, const Linearization<2, 2>& placed, Slot slot);

namespace internal {

/// Y L'^-1 in place of Y, column by column: Eigen's own solver is made for larger L.
template <class L, class Cross>
void solve_forward(const L& factor, Cross& Y) {
  for (Eigen::Index i = 0; i < Y.cols(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      Y.col(i) -= factor(i, j) * Y.col(j);
    }
    Y.col(i) /= factor(i, i);
  }
}

/// K = C (L L')^-1.
template <class L, class Cross>
void solve_columns(const L& factor, const Cross& C, Cross& K) {
  const Eigen::Index m = C.cols();
  K = C;
  solve_forward(factor, K);
  for (Eigen::Index i = m - 1; i >= 0; --i) {
    for (Eigen::Index j = i + 1; j < m; ++j) {
      K.col(i) -= factor(j, i) * K.col(j);
    }
    K.col(i) /= factor(i, i);
  }
}

/// What one row says beside the belief, eq. (1.1) and (1.2) of docs/models/updates.md, from its
/// residual and S; the verdict is kFused if it passes the gate.
inline Outcome compare_row(double residual, double S, const Gate& gate) {
  if (!(S > 0.0)) {
    throw NumericalError("innovation covariance is not positive");
  }
  Outcome outcome;
  outcome.dof = 1;
  outcome.residual = residual;
  outcome.scale = S;
  outcome.nis = residual * residual * (1.0 / S);
  outcome.limit = gate.limit(1);
  outcome.verdict = outcome.nis > outcome.limit ? Verdict::kGated : Verdict::kFused;
  outcome.reason = outcome.nis > outcome.limit ? Reason::kUnlikely : Reason::kNone;
  return outcome;
}

/// The gain K and what a measurement says beside the belief, eq. (1.1) to (1.3) of
/// docs/models/updates.md; the verdict is kFused if it passes the gate.
template <class Lin, class Cross, class S>
Outcome compare(const Lin& lin, const Cross& PHt, const S& innovation, const Gate& gate, Cross& K) {
  if constexpr (S::RowsAtCompileTime == 1) {
    const Outcome outcome = compare_row(lin.residual(0), innovation(0, 0), gate);
    K = PHt * (1.0 / innovation(0, 0));
    return outcome;
  }
  Outcome outcome;
  outcome.dof = static_cast<int>(lin.residual.size());
  outcome.residual = lin.residual(0);
  const Eigen::LLT<S> factor(innovation);
  if (factor.info() != Eigen::Success) {
    throw NumericalError("innovation covariance is not positive definite");
  }
  outcome.scale = std::exp(2.0 * factor.matrixLLT().diagonal().array().log().mean());
  outcome.nis = factor.matrixL().solve(lin.residual).squaredNorm();
  if constexpr (Cross::RowsAtCompileTime == Eigen::Dynamic) {
    solve_columns(factor.matrixLLT(), PHt, K);
  } else {
    K = factor.solve(PHt.transpose()).transpose();
  }
  outcome.limit = gate.limit(outcome.dof);
  outcome.verdict = outcome.nis > outcome.limit ? Verdict::kGated : Verdict::kFused;
  outcome.reason = outcome.nis > outcome.limit ? Reason::kUnlikely : Reason::kNone;
  return outcome;
}

template <class X>
void wrap_angles(X& x, const std::vector<int>& angle_rows) {
  for (const int row : angle_rows) {
    if (std::abs(x(row)) >= kPi) {
      x(row) = wrap_angle(x(row));
    }
  }
}

[[noreturn]] void refuse_result();
[[noreturn]] void refuse_prediction();

/// What correlated errors do in an update by that gain, eq. (1.21) to (1.26); `rows` are those that
/// the Jacobian has columns for.
template <class Lin, class Cross, class S>
void take_correlated(GaussianBelief& belief, const Lin& lin, const Cross& gain, const S& innovation,
                     const int* rows) {
  if (belief.correlated.is_empty() && !(lin.correlation.time_s > 0.0)) {
    return;
  }
  const Cross transposed = lin.jacobian.transpose();
  belief.correlated.take(
      {gain, transposed, rows, lin.residual, lin.noise, innovation, lin.correlation.time_s,
       lin.correlation.kind, lin.correlation.sources.data()},
      belief.stamp);
}

/// 0, 1, 2 and so on.
template <int N>
inline constexpr auto kRowsOfWhole = [] {
  std::array<int, N> rows{};
  for (int i = 0; i < N; ++i) {
    rows[static_cast<std::size_t>(i)] = i;
  }
  return rows;
}();

/// One intervention more, if it was fused.
inline Outcome count_fused(GaussianBelief& belief, const Outcome& outcome) {
  belief.interventions += outcome.verdict == Verdict::kFused ? 1 : 0;
  return outcome;
}

/// The update of three variables by one row, the pose by a range: eq. (1.10) of
/// docs/models/updates.md, written out, as products of so few numbers cost more than what is in
/// them.
Outcome update_three(GaussianBelief& belief, const Linearization<1, 3>& lin, const Gate& gate);

/// The update where the local variables are the whole belief, in order: x += K r and
/// Joseph's form of (I - K H) P, eq. (1.4) to (1.6) of docs/models/updates.md, computed as
/// A - (A H' - K R) K' with A = P - K (P H')', which costs O(n^2) per measurement row.
template <int M, int N, int MaxM, class Reach>
Outcome update_whole(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin,
                     const Reach& reach, const Gate& gate) {
  using Noise = Eigen::Matrix<double, M, M, Eigen::ColMajor, MaxM, MaxM>;
  using Cross = Eigen::Matrix<double, N, M, Eigen::ColMajor, N, MaxM>;
  Eigen::Map<Vector<N>> x(belief.x.data());
  Eigen::Map<Matrix<N, N>> P(belief.P.data());
  const Cross PHt = P * lin.jacobian.transpose();
  const Noise S = lin.jacobian * PHt + lin.noise;
  Cross K;
  const Outcome outcome = compare(lin, PHt, S, gate, K);
  if (outcome.verdict == Verdict::kGated) {
    return outcome;
  }
  const Vector<N> x_new = x + K * lin.residual;
  const Matrix<N, N> half = P - K.lazyProduct(PHt.transpose());
  const Cross rest = Cross(half * lin.jacobian.transpose()) - K * lin.noise;
  const Matrix<N, N> A = half - rest.lazyProduct(K.transpose());
  if (!std::isfinite(x_new.sum() + A.sum()) || !(A.diagonal().minCoeff() > 0.0)) {
    refuse_result();
  }
  x = x_new;
  wrap_angles(x, belief.angle_rows());
  P = 0.5 * (A + A.transpose());
  take_correlated(belief, lin, K, S, kRowsOfWhole<N>.data());
  // Three rows are looked at always.
  keep_in_bounds(belief, 0, N, N != 3 && leaves_few_digits(lin.noise, S, reach));
  return outcome;
}

[[noreturn]] void refuse_rows(Eigen::Index residual, Eigen::Index jacobian, Eigen::Index noise,
                              Eigen::Index noise_columns);

/// The update where the slots are part of the belief, or the sizes are known at run time only: P is
/// read and written once, eq. (1.10) of docs/models/updates.md.
Outcome update_part(GaussianBelief& belief,
                    const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin, Slots slots,
                    const Gate& gate);

/// The same, of run-time sizes.
template <int M, int N, int MaxM>
Linearization<Eigen::Dynamic, Eigen::Dynamic> any_size(const Linearization<M, N, MaxM>& lin) {
  Linearization<Eigen::Dynamic, Eigen::Dynamic> any{lin.residual, lin.jacobian, lin.noise, {}};
  any.correlation.time_s = lin.residual.size() <= 3 ? lin.correlation.time_s : 0.0;
  any.correlation.kind = lin.correlation.kind;
  std::copy_n(lin.correlation.sources.begin(),
              std::min(any.correlation.sources.size(), lin.correlation.sources.size()),
              any.correlation.sources.begin());
  return any;
}

/// Throws std::invalid_argument unless the Jacobian has a column for each variable.
void check_columns(std::size_t variables, Eigen::Index columns);

/// Throws std::invalid_argument unless the parts have the same number of rows, at least one.
template <class Lin>
void check_rows(const Lin& lin) {
  const Eigen::Index rows = lin.residual.size();
  if (rows < 1 || lin.jacobian.rows() != rows || lin.noise.rows() != rows ||
      lin.noise.cols() != rows) {
    refuse_rows(rows, lin.jacobian.rows(), lin.noise.rows(), lin.noise.cols());
  }
}

}  // namespace internal

template <int N>
void predict(GaussianBelief& belief, const Propagation<Vector<N>, N>& step, Slots slots) {
  static_assert(N != Eigen::Dynamic);
  if (!belief.is_whole(slots, N) || belief.P.outerStride() != N) {
    predict(belief,
            Propagation<Eigen::VectorXd, Eigen::Dynamic>{step.moved, step.jacobian, step.noise},
            slots);
    return;
  }
  Eigen::Map<Matrix<N, N>> P(belief.P.data());
  const Matrix<N, N> FP = step.jacobian * P;
  Matrix<N, N> moved = step.noise;
  moved.noalias() += FP * step.jacobian.transpose();
  const std::uint64_t interventions = internal::keep_noise(
      moved, internal::reach_of(step.jacobian, P.diagonal()), P.diagonal(), step.noise.diagonal());
  if (!std::isfinite(moved.sum() + step.moved.sum()) || !(moved.diagonal().minCoeff() > 0.0)) {
    internal::refuse_prediction();
  }
  belief.interventions += interventions;
  P = 0.5 * (moved + moved.transpose());
  belief.correlated.move(step.jacobian, internal::kRowsOfWhole<N>.data());
  belief.x = step.moved;
  internal::wrap_angles(belief.x, belief.angle_rows());
  internal::keep_in_bounds(belief, 0, N, interventions > 0);
}

template <int M, int N, int MaxM>
Outcome update(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin, Slots slots,
               const Gate& gate) {
  if constexpr (M == Eigen::Dynamic) {
    internal::check_rows(lin);
  }
  if constexpr (N != Eigen::Dynamic && MaxM != Eigen::Dynamic) {
    if (belief.is_whole(slots, N) && belief.P.outerStride() == N &&
        belief.considered_rows().empty()) {
      if constexpr (M == 1 && N == 3) {
        return internal::update_three(belief, lin, gate);
      }
      const Eigen::Map<const Matrix<N, N>> P(belief.P.data());
      const auto reach = internal::reach_of(lin.jacobian, P.diagonal());
      if (internal::is_less_than(internal::GuardTuning::kMinNoiseShare, lin.noise, reach)) {
        return internal::count_fused(
            belief,
            internal::update_whole(belief, internal::with_noise_kept(lin, reach), reach, gate));
      }
      return internal::update_whole(belief, lin, reach, gate);
    }
  }
  return internal::update_part(belief, internal::any_size(lin), slots, gate);
}

// Compiled once for the shapes that the estimators use: src/filters/kalman_*.cpp.
extern template Outcome update(GaussianBelief&, const Linearization<1, 3>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<2, 3>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 2>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 3>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3, 32>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 3>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<1, 4>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<1, 1>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 4, 3>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 5, 2>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<1, 15>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 15, 3>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<1, 12>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<3, 12>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<6, 12>&, Slots, const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<Eigen::Dynamic, 12, 2>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&, const Linearization<1, Eigen::Dynamic>&, Slots,
                               const Gate&);
extern template Outcome update(GaussianBelief&,
                               const Linearization<Eigen::Dynamic, Eigen::Dynamic>&, Slots,
                               const Gate&);
}  // namespace locfuse
