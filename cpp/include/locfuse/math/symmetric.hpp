// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace locfuse {

/// Whether the halves of a covariance are the same but for 1e-9 of the two standard deviations, so
/// that a large variance hides nothing of the others, and no square is infinite. False where a
/// number that counts is none.
template <class Derived>
[[nodiscard]] bool is_symmetric(const Eigen::MatrixBase<Derived>& P) {
  for (Eigen::Index j = 0; j < P.cols(); ++j) {
    for (Eigen::Index i = 0; i < j; ++i) {
      const double scale = std::sqrt(std::abs(P(i, i))) * std::sqrt(std::abs(P(j, j)));
      if (!(std::abs(P(i, j) - P(j, i)) <= 1e-9 * scale)) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace locfuse
