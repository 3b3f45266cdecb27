// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "locfuse/math/types.hpp"
#include "smoothing/pose_chain.hpp"

namespace locfuse::internal {

/// Marginal covariances of a chain of poses, and of the variables that all of them share.
struct ChainCovariance {
  std::vector<Matrix<3, 3>> poses;
  Eigen::MatrixXd globals;
};

/// One row of what measures a pose, in sigmas of its stated noise, and what is known of its error:
/// its variance, and which errors that last are in it.
struct MeasuredRow {
  std::size_t pose;
  Vector<3> by_pose;
  SharedPlaces shared = kNothingShared;  ///< the shared variables that add to it
  std::array<double, kMaxShared> by_shared = {};
  double variance = 1.0;  ///< of its error, over the stated one
  struct Lasting {
    int process = -1;      ///< as of add_process, or none
    double loading = 0.0;  ///< what the row has of it, which has a variance of 1
  };
  std::array<Lasting, 3> lasting = {};
};

/// H = J'J of a chain of poses, each tied to the next, and of variables that all may be tied to:
/// block tridiagonal with a border. Derivation: docs/smoothing.md eq. (5) to (9).
class ChainInformation {
 public:
  /// Poses at `seconds`.
  ChainInformation(std::vector<double> seconds, std::size_t globals);

  /// An error of variance 1 that lasts so long; returns its number.
  [[nodiscard]] int add_process(double lasts_s) {
    lasts_.push_back(lasts_s);
    return static_cast<int>(lasts_.size()) - 1;
  }

  /// Of what is as sure as it says: the start, motions, priors.
  void add(std::size_t pose, const Matrix<3, 3>& information) { poses_[pose] += information; }
  /// Of a pose and the next.
  void add_next(std::size_t pose, const Matrix<3, 3>& information) { next_[pose] += information; }
  void add_global(std::size_t global, double information) {
    const auto place = static_cast<Eigen::Index>(global);
    globals_(place, place) += information;
  }
  /// In order of poses.
  void add(const MeasuredRow& row);

  /// Blocks of the diagonal of H^-1 J'CJ H^-1, with C the covariance of all errors. Throws
  /// NumericalError unless H is positive definite.
  [[nodiscard]] ChainCovariance covariance() const;

 private:
  using Pivot = Eigen::LLT<Matrix<3, 3>>;
  using Border = std::vector<Eigen::MatrixXd>;
  class Gathered;

  [[nodiscard]] Eigen::ArrayXd kept(double seconds) const;
  [[nodiscard]] Border solve(const std::vector<Pivot>& pivots, Border columns) const;
  [[nodiscard]] Eigen::MatrixXd excess_of(const Eigen::MatrixXd& of) const;
  void add_globals(const std::vector<Pivot>& pivots, ChainCovariance& found) const;

  std::vector<double> seconds_;
  std::vector<Matrix<3, 3>> poses_;
  std::vector<Matrix<3, 3>> next_;  // of each pose and the next
  Border border_;                   // of each pose and the shared variables
  Eigen::MatrixXd globals_;
  std::vector<MeasuredRow> rows_;
  std::vector<double> lasts_;  // by process [s]
};

}  // namespace locfuse::internal
