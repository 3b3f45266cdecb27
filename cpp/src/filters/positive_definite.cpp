// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/positive_definite.hpp"

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <vector>

namespace locfuse::internal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void put_back(GaussianBelief& belief, Index first, Index count, bool few) {
  const auto is_sound = few ? is_positive_definite : is_pose_positive_definite;
  const Index unsound = few ? belief.P.rows() : 3;  // where a motion changes no other rows
  bool widened = false;
  for (double share = GuardTuning::kMinNoiseShare; share < 0.5 && !is_sound(belief.P);
       share *= 10.0) {
    belief.P.diagonal().head(unsound) *= 1.0 + share;
    widened = true;
  }
  if (widened && !is_sound(belief.P)) {  // correlations cannot be saved
    const VectorXd variances = belief.P.diagonal().head(unsound);
    belief.P.topRows(unsound).setZero();
    belief.P.leftCols(unsound).setZero();
    belief.P.diagonal().head(unsound) = variances;
  }
  belief.interventions += widened ? 1 : 0;
  for (Index row = first; row < first + count; ++row) {
    const SigmaBounds& bounds = belief.variance_bounds()[static_cast<std::size_t>(row)];
    const double variance = belief.P(row, row);
    if (variance > bounds.max) {  // row and column too, or P would not stay positive definite
      const double scale = std::sqrt(bounds.max / variance);
      belief.P.row(row) *= scale;
      belief.P.col(row) *= scale;
      belief.P(row, row) = bounds.max;
      ++belief.interventions;
    } else if (variance < bounds.min) {
      belief.P(row, row) = bounds.min;
      ++belief.interventions;
    }
  }
}

}  // namespace

bool is_positive_definite(const Covariance& P) {
  constexpr Index kMaxRowsOnStack = 32;
  const auto has_factor = [&P](Eigen::Ref<MatrixXd> A) {
    A = P;
    A.diagonal() *= GuardTuning::kAfterRounding;
    return factorize(A);
  };
  const Index n = P.rows();
  if (n > kMaxRowsOnStack) {
    MatrixXd A(n, n);
    return has_factor(A);
  }
  std::array<double, kMaxRowsOnStack * kMaxRowsOnStack> memory;
  return has_factor(Eigen::Map<MatrixXd>(memory.data(), n, n));
}

void keep_in_bounds(GaussianBelief& belief, Index first, Index count, bool few) {
  const std::vector<SigmaBounds>& bounds = belief.variance_bounds();
  bool inside = true;
  for (Index row = first; row < first + count; ++row) {
    const double variance = belief.P(row, row);
    const SigmaBounds& of_row = bounds[static_cast<std::size_t>(row)];
    inside = inside && variance >= of_row.min && variance <= of_row.max;
  }
  if (!inside || !is_pose_positive_definite(belief.P) || (few && !is_positive_definite(belief.P))) {
    put_back(belief, first, count, few);
  }
}

}  // namespace locfuse::internal
