// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace locfuse {

/// Whether two entries of a covariance are symmetric: equal to 1e-9 of the two standard deviations,
/// so that a large variance does not mask errors of the others, and no square overflows. False on
/// NaN.
template <class Derived>
[[nodiscard]] bool is_symmetric(const Eigen::MatrixBase<Derived>& P, Eigen::Index i,
                                Eigen::Index j) {
  const double scale = std::sqrt(std::abs(P(i, i))) * std::sqrt(std::abs(P(j, j)));
  return std::abs(P(i, j) - P(j, i)) <= 1e-9 * scale;
}

/// Whether all entries are symmetric.
template <class Derived>
[[nodiscard]] bool is_symmetric(const Eigen::MatrixBase<Derived>& P) {
  for (Eigen::Index j = 0; j < P.cols(); ++j) {
    for (Eigen::Index i = 0; i < j; ++i) {
      if (!is_symmetric(P, i, j)) {
        return false;
      }
    }
  }
  return true;
}

/// Cholesky's factor L in place of the lower half of P = L L'. False, and P is overwritten in part,
/// where it is not positive definite. Compiled once, unlike P.llt(), which is compiled for each
/// size.
[[nodiscard]] bool factorize(Eigen::Ref<Eigen::MatrixXd> P);

/// Whether a matrix is finite, symmetric and positive definite.
template <class Derived>
[[nodiscard]] bool is_covariance(const Eigen::MatrixBase<Derived>& P) {
  typename Derived::PlainObject factor = P;
  return P.allFinite() && is_symmetric(P) && factorize(factor);
}

}  // namespace locfuse
