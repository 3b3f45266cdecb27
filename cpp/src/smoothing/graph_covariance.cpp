// SPDX-License-Identifier: Apache-2.0
#include "smoothing/graph_covariance.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/error.hpp"

namespace locfuse::internal {
namespace {

/// First row of a pose in the matrix, which the first pose is not part of.
Eigen::Index row_of(std::size_t pose) { return 3 * (static_cast<Eigen::Index>(pose) - 1); }

}  // namespace

MotionJacobians motion_jacobians(const Pose2& first, const Pose2& second) {
  const double c = std::cos(first.heading);
  const double s = std::sin(first.heading);
  const Vector<2> d = second.position() - first.position();
  MotionJacobians found;
  found.by_second << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
  found.by_first = -found.by_second;
  found.by_first(0, 2) = -s * d.x() + c * d.y();
  found.by_first(1, 2) = -c * d.x() - s * d.y();
  return found;
}

Matrix<3, 3> less_sure(const Matrix<3, 3>& information, const Matrix<3, 3>& covariance) {
  const Matrix<3, 3> both = information + covariance.llt().solve(Matrix<3, 3>::Identity());
  const Matrix<3, 3> found = information - information * both.llt().solve(information);
  return 0.5 * (found + found.transpose());
}

GraphCovariance::GraphCovariance(const std::vector<Pose2>& poses,
                                 const std::vector<PoseRelation>& relations,
                                 const std::vector<bool>& kept)
    : poses_(poses) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(27 * relations.size());
  const auto add = [&](std::size_t a, std::size_t b, const Matrix<3, 3>& block) {
    if (a == 0 || b == 0 || a < b) {  // the lower half
      return;
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        entries.emplace_back(row_of(a) + i, row_of(b) + j, block(i, j));
      }
    }
  };
  for (std::size_t k = 0; k < relations.size(); ++k) {
    const PoseRelation& relation = relations[k];
    if (!kept[k]) {
      continue;
    }
    const MotionJacobians by = motion_jacobians(poses[relation.from], poses[relation.to]);
    const Matrix<3, 3> first = relation.information * by.by_first;
    const Matrix<3, 3> second = relation.information * by.by_second;
    add(relation.from, relation.from, by.by_first.transpose() * first);
    add(relation.to, relation.to, by.by_second.transpose() * second);
    add(relation.to, relation.from, by.by_second.transpose() * first);
    add(relation.from, relation.to, by.by_first.transpose() * second);
  }
  const Eigen::Index size = row_of(poses.size());
  Eigen::SparseMatrix<double> H(size, size);
  H.setFromTriplets(entries.begin(), entries.end());
  factor_.compute(H);
  if (size > 0 && (factor_.info() != Eigen::Success || !(factor_.vectorD().minCoeff() > 0.0))) {
    throw NumericalError("a pose of the graph is not tied to the others");
  }
}

Matrix<3, 3> GraphCovariance::between(std::size_t from, std::size_t to) const {
  const MotionJacobians by = motion_jacobians(poses_[from], poses_[to]);
  Columns rows = Columns::Zero(row_of(poses_.size()), 3);
  if (from != 0) {
    rows.middleRows<3>(row_of(from)) += by.by_first.transpose();
  }
  if (to != 0) {
    rows.middleRows<3>(row_of(to)) += by.by_second.transpose();
  }
  return this->by(rows);
}

Matrix<3, 3> GraphCovariance::of(std::size_t pose) const {
  if (pose == 0) {
    return Matrix<3, 3>::Zero();
  }
  Columns rows = Columns::Zero(row_of(poses_.size()), 3);
  rows.middleRows<3>(row_of(pose)).setIdentity();
  return by(rows);
}

Matrix<3, 3> GraphCovariance::by(const Columns& rows) const {
  if (rows.rows() == 0) {
    return Matrix<3, 3>::Zero();
  }
  const Columns solved = factor_.solve(rows);
  const Matrix<3, 3> found = rows.transpose() * solved;
  return 0.5 * (found + found.transpose());
}

}  // namespace locfuse::internal
