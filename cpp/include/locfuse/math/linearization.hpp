// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "locfuse/error.hpp"
#include "locfuse/math/angle.hpp"
#include "locfuse/math/types.hpp"

namespace locfuse {

/// Kinds of measurements, for each of which it is learnt how correlated its errors are.
inline constexpr std::size_t kErrorKinds = 8;

/// The name of a source ends with its id, and that with the number of the row of what it measures.
inline constexpr unsigned kBitsOfId = 32;
inline constexpr unsigned kBitsOfRow = 2;

/// Of whose errors those of a measurement of so many rows are the next.
template <int Rows>
struct ErrorCorrelation {
  double time_s = 0.0;   ///< correlation time; 0: its errors have nothing to do with any others
  std::size_t kind = 0;  ///< below kErrorKinds
  std::array<std::uint64_t, Rows> sources = {};  ///< for each row
};

/// Rows that have a source, of so many at most.
[[nodiscard]] constexpr int rows_with_source(int most) {
  constexpr int kOfPose = 3;
  return most > 0 ? most : kOfPose;
}

/// Linearized measurement of the variables that its physics depends on: the only interface between
/// models, which make it, and filters, gates, association, particle weights and smoothers.
///
/// M rows of measurement, N local variables; MaxM bounds a run-time M, which then needs no heap.
template <int M, int N, int MaxM = M>
struct Linearization {
  static constexpr int kVariables = N;
  static constexpr int kJacobianStorage =
      (M == 1 && N != 1) ? int(Eigen::RowMajor) : int(Eigen::ColMajor);
  static constexpr int kSources = rows_with_source(MaxM);

  Eigen::Matrix<double, M, 1, Eigen::ColMajor, MaxM, 1> residual;  ///< z minus h(x), angles wrapped
  Eigen::Matrix<double, M, N, kJacobianStorage, MaxM, N> jacobian;  ///< d h / d(error state)
  Eigen::Matrix<double, M, M, Eigen::ColMajor, MaxM, MaxM> noise;   ///< R, positive definite
  ErrorCorrelation<kSources> correlation = {};
};

/// One step of a motion model of `Local`.
template <class Local, int N>
struct Propagation {
  Local moved;            ///< f(x, u)
  Matrix<N, N> jacobian;  ///< F = d f / d(error state); of run-time size it may have more columns
  Matrix<N, N> noise;     ///< Q of this step
};

/// r' S^-1 r. Throws NumericalError unless S is positive definite.
template <class Residual, class S>
[[nodiscard]] double squared_mahalanobis(const Residual& residual, const S& covariance) {
  const Eigen::LLT<typename S::PlainObject> factor(covariance);
  if (factor.info() != Eigen::Success) {
    throw NumericalError("innovation covariance is not positive definite");
  }
  return factor.matrixL().solve(residual).squaredNorm();
}

/// Log likelihood of the measurement at the point of linearization: a particle's weight. Throws
/// NumericalError unless R is positive definite.
template <int M, int N, int MaxM>
[[nodiscard]] double log_likelihood(const Linearization<M, N, MaxM>& lin) {
  const auto factor = lin.noise.llt();
  if (factor.info() != Eigen::Success) {
    throw NumericalError("noise of a measurement is not positive definite");
  }
  const double mahalanobis_squared = factor.matrixL().solve(lin.residual).squaredNorm();
  const double log_det = 2.0 * factor.matrixLLT().diagonal().array().log().sum();
  const double rows = static_cast<double>(lin.residual.size());
  return -0.5 * (mahalanobis_squared + log_det + rows * std::log(2.0 * kPi));
}

}  // namespace locfuse
