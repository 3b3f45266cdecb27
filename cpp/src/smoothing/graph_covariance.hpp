// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/SparseCholesky>
#include <cstddef>
#include <vector>

#include "locfuse/smoothing/pose_graph.hpp"

namespace locfuse::internal {

/// J of the motion between two poses by both of them: docs/smoothing.md eq. (2).
struct MotionJacobians {
  Matrix<3, 3> by_first;
  Matrix<3, 3> by_second;
};
[[nodiscard]] MotionJacobians motion_jacobians(const Pose2& first, const Pose2& second);

/// Information of errors that have one of `covariance` beside them, which is positive definite.
[[nodiscard]] Matrix<3, 3> less_sure(const Matrix<3, 3>& information,
                                     const Matrix<3, 3>& covariance);

/// Covariances of the poses of a graph, whose first one is exact.
class GraphCovariance {
 public:
  /// Of the relations that are not marked as wrong. Throws NumericalError where a pose is not tied
  /// to the others.
  GraphCovariance(const std::vector<Pose2>& poses, const std::vector<PoseRelation>& relations,
                  const std::vector<bool>& kept);

  /// Of T_from_to, in the axes of `from`.
  [[nodiscard]] Matrix<3, 3> between(std::size_t from, std::size_t to) const;
  /// Of a pose, in the axes of the first.
  [[nodiscard]] Matrix<3, 3> of(std::size_t pose) const;

 private:
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  [[nodiscard]] Matrix<3, 3> by(const Columns& rows) const;

  const std::vector<Pose2>& poses_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

}  // namespace locfuse::internal
