// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/covariance_intersection.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "locfuse/error.hpp"

namespace locfuse {

double intersection_weight(const Matrix<3, 3>& A, const Matrix<3, 3>& B) {
  const Eigen::LLT<Matrix<3, 3>> factor(B);
  if (factor.info() != Eigen::Success || !A.allFinite()) {
    throw NumericalError("a covariance is not positive definite");
  }
  const Matrix<3, 3> half = factor.matrixL().solve(A);
  const Matrix<3, 3> relative = factor.matrixL().solve(half.transpose());
  const Vector<3> ratios =
      Eigen::SelfAdjointEigenSolver<Matrix<3, 3>>(relative, Eigen::EigenvaluesOnly).eigenvalues();
  if (!(ratios.minCoeff() > 0.0)) {
    throw NumericalError("a covariance is not positive definite");
  }
  const Eigen::Array3d gain = 1.0 / ratios.array() - 1.0;  // of information, from B to A
  double low = 1e-3;
  double high = 1.0 - low;
  constexpr int kHalvings = 40;
  for (int i = 0; i < kHalvings; ++i) {  // the log of the determinant is concave
    const double middle = 0.5 * (low + high);
    const double slope = (gain / (1.0 + middle * gain)).sum();
    (slope > 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace locfuse
