// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/kalman.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "filters/covariance_lanes.hpp"
#include "math/processor.hpp"

namespace locfuse {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Calls f(0) to f(N - 1), written out: loops of three steps cost more than what is in them.
template <class F, int... I>
void each(std::integer_sequence<int, I...> /*indices*/, const F& f) {
  (f(I), ...);
}
template <int N, class F>
void each(const F& f) {
  each(std::make_integer_sequence<int, N>{}, f);
}

/// n x M, or n x as many as there are where M is Eigen::Dynamic.
template <int M>
using Columns = Eigen::Matrix<double, Eigen::Dynamic, M>;

/// sum += column row', column by column: Eigen's own outer product goes entry by entry.
template <class Column, class Row, class Sum>
void add_outer(const Column& column, const Row& row, Sum& sum) {
  for (Index i = 0; i < row.size(); ++i) {
    sum.col(i) += row(i) * column;
  }
}

template <int M>
const internal::OuterKernel& kernel() {
#ifdef LOCFUSE_LANES_AVX2
  if (internal::has_avx2()) {
    return M == 1 ? internal::avx2::kOuter1 : internal::avx2::kOuter2;
  }
#endif
  return M == 1 ? internal::portable::kOuter1 : internal::portable::kOuter2;
}

/// P+ where a measurement has M = 1 or 2 rows and the gain of (1.3), from Y = P H', in place: eq.
/// (1.10) of docs/models/updates.md. False, and P as it was, if a variance would not be positive.
template <int M>
bool write_outer(Covariance& P, Columns<M> Y, const Eigen::Matrix<double, M, M>& S) {
  internal::solve_forward(S.llt().matrixLLT(), Y);
  const internal::OuterUpdate outer{P.data(), P.outerStride(), P.rows(), Y.data()};
  if (!kernel<M>().stays_positive(outer)) {
    return false;
  }
  kernel<M>().write(outer);
  return true;
}

/// For any number of rows and any gain, in two steps: eq. (1.6).
template <class Lin>
bool write_joseph(Covariance& P, const MatrixXd& K, const MatrixXd& PHt, const Lin& lin,
                  const std::vector<int>& rows) {
  MatrixXd A = P - K * PHt.transpose();
  const MatrixXd rest = A(Eigen::all, rows) * lin.jacobian.transpose() - K * lin.noise;
  A -= rest * K.transpose();
  if (!std::isfinite(A.sum()) || !(A.diagonal().minCoeff() > 0.0)) {
    return false;
  }
  P = 0.5 * (A + A.transpose());
  return true;
}

template <int M>
Outcome update_rows(GaussianBelief& belief,
                    const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin,
                    const std::vector<int>& rows, const VectorXd& reach, const Gate& gate) {
  const Index size = belief.dimension();
  const Index m = lin.residual.size();
  Columns<M> PHt = Columns<M>::Zero(size, m);
  Eigen::Matrix<double, M, M> S = lin.noise;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    add_outer(belief.P.col(rows[k]), lin.jacobian.col(static_cast<Index>(k)), PHt);
  }
  for (std::size_t k = 0; k < rows.size(); ++k) {
    S += lin.jacobian.col(static_cast<Index>(k)) * PHt.row(rows[k]);
  }
  Columns<M> K(size, m);
  const Outcome outcome = internal::compare(lin, PHt, S, gate, K);
  if (outcome.verdict == Verdict::kGated) {
    return outcome;
  }
  for (const int row : belief.considered_rows()) {
    K.row(row).setZero();  // eq. (1.16)
  }
  const bool few = internal::leaves_few_digits(lin.noise, S, reach);
  const VectorXd x_new = belief.x + K.lazyProduct(lin.residual);
  const auto write = [&] {
    if constexpr (M == Eigen::Dynamic) {
      return write_joseph(belief.P, K, PHt, lin, rows);
    } else {
      return write_outer<M>(belief.P, std::move(PHt), S);
    }
  };
  if (!std::isfinite(x_new.sum() + S.sum()) || !write()) {
    internal::refuse_result();
  }
  belief.x = x_new;
  internal::take_correlated(belief, lin, K, S, rows.data());
  internal::wrap_angles(belief.x, belief.angle_rows());
  internal::keep_in_bounds(belief, 0, size, few);
  return outcome;
}

Outcome update_any(GaussianBelief& belief, const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin,
                   const std::vector<int>& rows, const VectorXd& reach, const Gate& gate) {
  switch (belief.considered_rows().empty() ? lin.residual.size() : Eigen::Dynamic) {
    case 1:
      return update_rows<1>(belief, lin, rows, reach, gate);
    case 2:
      return update_rows<2>(belief, lin, rows, reach, gate);
    default:
      return update_rows<Eigen::Dynamic>(belief, lin, rows, reach, gate);
  }
}

}  // namespace

Outcome internal::update_part(GaussianBelief& belief,
                              const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin, Slots slots,
                              const Gate& gate) {
  const std::vector<int> rows = belief.rows(slots);
  check_columns(rows.size(), lin.jacobian.cols());
  const VectorXd reach = reach_of(lin.jacobian, belief.P.diagonal()(rows));
  if (is_less_than(GuardTuning::kMinNoiseShare, lin.noise, reach)) {
    return count_fused(belief, update_any(belief, with_noise_kept(lin, reach), rows, reach, gate));
  }
  return update_any(belief, lin, rows, reach, gate);
}

void internal::check_columns(std::size_t variables, Index columns) {
  if (static_cast<Index>(variables) != columns || columns < 1) {
    throw std::invalid_argument("the Jacobian has " + std::to_string(columns) +
                                " columns, the slots hold " + std::to_string(variables) +
                                " variables, expected as many of both, at least 1");
  }
}

void internal::refuse_result() {
  throw NumericalError("update would leave a belief that is not finite and positive");
}

void internal::refuse_prediction() {
  throw NumericalError("prediction would leave a belief that is not finite and positive");
}

void internal::refuse_rows(Eigen::Index residual, Eigen::Index jacobian, Eigen::Index noise,
                           Eigen::Index noise_columns) {
  throw std::invalid_argument(
      "a measurement has a residual of " + std::to_string(residual) + " rows, a Jacobian of " +
      std::to_string(jacobian) + " rows and noise of " + std::to_string(noise) + " x " +
      std::to_string(noise_columns) + ", expected one number of rows, at least 1");
}

void predict(GaussianBelief& belief, const Propagation<Pose2, 3>& step, Slot slot) {
  const Vector<3> moved(step.moved.x, step.moved.y, wrap_angle(step.moved.heading));
  (void)belief.pose(slot);  // throws unless it is one
  const int row = belief.offset(slot);
  const Matrix<3, 3> P = belief.P.block<3, 3>(row, row);
  Matrix<3, 3> FP;
  each<3>([&](int j) {
    each<3>([&](int i) {
      FP(i, j) = step.jacobian(i, 0) * P(0, j) + step.jacobian(i, 1) * P(1, j) +
                 step.jacobian(i, 2) * P(2, j);
    });
  });
  Matrix<3, 3> P_new;
  each<3>([&](int j) {
    each<3>([&](int i) {
      if (i >= j) {
        P_new(i, j) = P_new(j, i) = step.noise(i, j) + FP(i, 0) * step.jacobian(j, 0) +
                                    FP(i, 1) * step.jacobian(j, 1) + FP(i, 2) * step.jacobian(j, 2);
      }
    });
  });
  const std::uint64_t interventions = internal::keep_noise(
      P_new, internal::reach_of(step.jacobian, P.diagonal()), P.diagonal(), step.noise.diagonal());
  if (!std::isfinite(P_new.sum() + moved.sum()) || !(P_new.diagonal().minCoeff() > 0.0)) {
    internal::refuse_prediction();
  }
  const Index size = belief.dimension();
  for (Index other = 0; size > 3 && other < size; ++other) {
    const Vector<3> cross = step.jacobian * belief.P.block<3, 1>(row, other);
    belief.P.block<3, 1>(row, other) = cross;
    belief.P.block<1, 3>(other, row) = cross.transpose();
  }
  belief.interventions += interventions;
  belief.P.block<3, 3>(row, row) = P_new;
  belief.x.segment<3>(row) = moved;
  const std::array<int, 3> rows{row, row + 1, row + 2};
  belief.correlated.move(step.jacobian, rows.data());
  internal::keep_in_bounds(belief, row, 3);
}

void turn_with_mean(GaussianBelief& belief, Slot slot, const Vector<2>& before) {
  const Vector<2> shift = belief.pose(slot).position() - before;
  const Vector<2> turn(-shift.y(), shift.x());  // of the position, per radian
  const int row = belief.offset(slot);
  const Vector<2> cross = belief.P.block<2, 1>(row, row + 2);
  const double heading = belief.P(row + 2, row + 2);
  Matrix<2, 2> own = belief.P.block<2, 2>(row, row);
  const Vector<2> variances = own.diagonal();
  own += turn * cross.transpose() + cross * turn.transpose();
  own += heading * turn * turn.transpose();
  if (!std::isfinite(own.sum()) || !(own.diagonal().minCoeff() > 0.0)) {
    return;
  }
  for (Index other = 0; other < belief.dimension(); ++other) {
    const Vector<2> moved = turn * belief.P(row + 2, other);
    belief.P.block<2, 1>(row, other) += moved;
    belief.P.block<1, 2>(other, row) = belief.P.block<2, 1>(row, other).transpose();
  }
  belief.P.block<2, 2>(row, row) = 0.5 * (own + own.transpose());
  Matrix<3, 3> turned = Matrix<3, 3>::Identity();
  turned.block<2, 1>(0, 2) = turn;
  const std::array<int, 3> rows{row, row + 1, row + 2};
  belief.correlated.move(turned, rows.data());
  const bool few =
      (own.diagonal().array() > internal::GuardTuning::kMaxGrowth * variances.array()).any();
  internal::keep_in_bounds(belief, row, 2, few);
}

void turn_map_with_mean(GaussianBelief& belief, const VectorXd& before) {
  constexpr int kHeading = 2;
  constexpr double kStraight = 1e-8;  // [rad], below which an arc is a line
  const double turned = wrap_angle(belief.x(kHeading) - before(kHeading));
  const bool straight = std::abs(turned) < kStraight;
  const double along = straight ? 1.0 : std::sin(turned) / turned;
  const double across = straight ? 0.5 * turned : (1.0 - std::cos(turned)) / turned;
  VectorXd mean = belief.x;
  VectorXd turn = VectorXd::Zero(mean.size());  // of each position, per radian
  for (Index row = 0; row < mean.size(); row += row == 0 ? 3 : 2) {
    const Vector<2> from = before.segment<2>(row);
    const Vector<2> step = mean.segment<2>(row) - from;
    const Vector<2> shift(along * step.x() - across * step.y(),
                          across * step.x() + along * step.y());
    mean.segment<2>(row) = from + shift;
    turn.segment<2>(row) << -shift.y(), shift.x();
  }
  const VectorXd half = belief.P.col(kHeading) + 0.5 * belief.P(kHeading, kHeading) * turn;
  const VectorXd variances = belief.P.diagonal();
  const VectorXd own = variances + 2.0 * turn.cwiseProduct(half);
  if (!std::isfinite(own.sum() + mean.sum()) || !(own.minCoeff() > 0.0)) {
    return;
  }
  belief.x = mean;
  for (Index column = 0; column < mean.size(); ++column) {
    belief.P.col(column) += turn * half(column) + half * turn(column);
  }
  belief.correlated.turn(turn, kHeading);
  const bool few = (own.array() > internal::GuardTuning::kMaxGrowth * variances.array()).any();
  internal::keep_in_bounds(belief, 0, belief.dimension(), few);
}

void diffuse(GaussianBelief& belief, Slot slot, double variance) {
  const int row = belief.offset(slot);
  belief.P(row, row) += variance;
  internal::keep_in_bounds(belief, row, 1);
}

void predict(GaussianBelief& belief, const Propagation<VectorXd, Eigen::Dynamic>& step,
             Slots slots) {
  const std::vector<int> rows = belief.rows(slots);
  const Index moving = step.moved.size();
  if (step.jacobian.rows() != moving || step.noise.rows() != moving ||
      step.noise.cols() != moving || step.jacobian.cols() != static_cast<Index>(rows.size()) ||
      moving > step.jacobian.cols() || moving < 1) {
    throw std::invalid_argument(
        "a motion of " + std::to_string(moving) + " out of " + std::to_string(rows.size()) +
        " variables got a Jacobian of " + std::to_string(step.jacobian.rows()) + " x " +
        std::to_string(step.jacobian.cols()) + " and noise of " +
        std::to_string(step.noise.rows()) + " x " + std::to_string(step.noise.cols()));
  }
  MatrixXd across = MatrixXd::Zero(moving, belief.dimension());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    across.noalias() +=
        step.jacobian.col(static_cast<Index>(k)) * belief.P.col(rows[k]).transpose();
  }
  MatrixXd own = step.noise;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    own.noalias() += across.col(rows[k]) * step.jacobian.col(static_cast<Index>(k)).transpose();
  }
  const VectorXd before = belief.P.diagonal()(rows);
  const std::uint64_t interventions = internal::keep_noise(
      own, internal::reach_of(step.jacobian, before), before, step.noise.diagonal());
  if (!std::isfinite(across.sum() + own.sum() + step.moved.sum()) ||
      !(own.diagonal().minCoeff() > 0.0)) {
    internal::refuse_prediction();
  }
  belief.interventions += interventions;
  for (Index i = 0; i < moving; ++i) {
    belief.P.row(rows[static_cast<std::size_t>(i)]) = across.row(i);
    belief.P.col(rows[static_cast<std::size_t>(i)]) = across.row(i).transpose();
  }
  for (Index i = 0; i < moving; ++i) {
    for (Index j = 0; j < moving; ++j) {
      belief.P(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(j)]) =
          0.5 * (own(i, j) + own(j, i));
    }
    belief.x(rows[static_cast<std::size_t>(i)]) = step.moved(i);
  }
  belief.correlated.move(step.jacobian, rows.data());
  internal::wrap_angles(belief.x, belief.angle_rows());
  for (Index i = 0; i < moving; ++i) {
    internal::keep_in_bounds(belief, rows[static_cast<std::size_t>(i)], 1);
  }
}

Slot augment(GaussianBelief& belief, const std::string& name, SlotKind kind,
             const Eigen::Ref<const VectorXd>& mean, const Eigen::Ref<const MatrixXd>& jacobian,
             const Eigen::Ref<const MatrixXd>& noise, Slots slots) {
  const std::vector<int> rows = belief.rows(slots);
  const Index size = dimension_of(kind);
  if (static_cast<Index>(rows.size()) != jacobian.cols() || jacobian.rows() != size ||
      noise.rows() != size || noise.cols() != size) {
    throw std::invalid_argument(
        "slot '" + name + "' of " + std::to_string(size) + " variables after " +
        std::to_string(rows.size()) + " got a Jacobian of " + std::to_string(jacobian.rows()) +
        " x " + std::to_string(jacobian.cols()) + " and noise of " + std::to_string(noise.rows()) +
        " x " + std::to_string(noise.cols()));
  }
  MatrixXd cross = MatrixXd::Zero(size, belief.dimension());
  MatrixXd own = noise;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    cross.noalias() += jacobian.col(static_cast<Index>(k)) * belief.P.col(rows[k]).transpose();
  }
  for (std::size_t k = 0; k < rows.size(); ++k) {
    own.noalias() += cross.col(rows[k]) * jacobian.col(static_cast<Index>(k)).transpose();
  }
  const VectorXd reach = internal::reach_of(jacobian, belief.P.diagonal()(rows));
  const bool positive =
      noise.allFinite() &&
      !internal::is_less_than(internal::GuardTuning::kMinNoiseShare, noise, reach);
  if (!positive || !mean.allFinite() || !cross.allFinite() || !own.allFinite()) {
    throw NumericalError("slot '" + name + "' would not be finite with positive noise");
  }
  CorrelatedErrors correlated = belief.correlated;
  correlated.grow(size, jacobian, rows);
  const Slot added = belief.add(name, kind, mean, 0.5 * own + 0.5 * own.transpose());
  belief.correlated = std::move(correlated);
  belief.P.bottomLeftCorner(size, cross.cols()) = cross;
  belief.P.topRightCorner(cross.cols(), size) = cross.transpose();
  internal::keep_in_bounds(
      belief, cross.cols(), size,
      internal::is_less_than(internal::GuardTuning::kFewDigitsShare, noise, reach));
  return added;
}

void keep_error_of_new(GaussianBelief& belief, const Linearization<2, 2>& placed, Slot slot) {
  if (!(placed.correlation.time_s > 0.0)) {
    return;
  }
  MatrixXd gain = MatrixXd::Zero(belief.dimension(), 2);
  gain.middleRows<2>(belief.offset(slot)) = placed.jacobian;
  const MatrixXd nothing_seen(0, 2);
  belief.correlated.take(
      {gain, nothing_seen, nullptr, placed.residual, placed.noise, MatrixXd(),
       placed.correlation.time_s, placed.correlation.kind, placed.correlation.sources.data()},
      belief.stamp);
}

}  // namespace locfuse
