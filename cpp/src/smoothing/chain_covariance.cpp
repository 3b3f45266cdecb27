// SPDX-License-Identifier: Apache-2.0
#include "smoothing/chain_covariance.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "locfuse/error.hpp"

/// Equations are those of docs/smoothing.md.
namespace locfuse::internal {

/// What the rows on one side of a pose say, as far as their errors are more than H says: eq. (7).
class ChainInformation::Gathered {
 public:
  explicit Gathered(std::size_t processes) : with_(processes, Vector<3>::Zero()) {}

  /// Moves to the next pose; of errors that last a part is kept.
  void move(const Matrix<3, 3>& gain, const Eigen::ArrayXd& kept) {
    excess_ = gain * excess_ * gain.transpose();
    for (std::size_t p = 0; p < with_.size(); ++p) {
      with_[p] = kept(static_cast<Eigen::Index>(p)) * (gain * with_[p]);
    }
  }
  void add(const MeasuredRow& row) {
    excess_ += (row.variance - 1.0) * row.by_pose * row.by_pose.transpose();
    for (const MeasuredRow::Lasting& lasting : row.lasting) {
      if (lasting.process >= 0) {
        Vector<3>& with = with_[static_cast<std::size_t>(lasting.process)];
        const Matrix<3, 3> both = lasting.loading * row.by_pose * with.transpose();
        excess_ += both + both.transpose();
        with += lasting.loading * row.by_pose;
      }
    }
  }
  /// Of both sides, which go together by what each has of the errors that last.
  [[nodiscard]] Matrix<3, 3> and_of(const Gathered& other) const {
    Matrix<3, 3> sum = excess_ + other.excess_;
    for (std::size_t p = 0; p < with_.size(); ++p) {
      const Matrix<3, 3> both = with_[p] * other.with_[p].transpose();
      sum += both + both.transpose();
    }
    return sum;
  }

 private:
  Matrix<3, 3> excess_ = Matrix<3, 3>::Zero();
  std::vector<Vector<3>> with_;  // covariance with each error that lasts
};

ChainInformation::ChainInformation(std::vector<double> seconds, std::size_t globals)
    : seconds_(std::move(seconds)),
      poses_(seconds_.size(), Matrix<3, 3>::Zero()),
      next_(seconds_.size(), Matrix<3, 3>::Zero()),
      border_(seconds_.size(), Eigen::MatrixXd::Zero(3, static_cast<Eigen::Index>(globals))),
      globals_(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(globals),
                                     static_cast<Eigen::Index>(globals))) {}

void ChainInformation::add(const MeasuredRow& row) {
  poses_[row.pose] += row.by_pose * row.by_pose.transpose();
  for (std::size_t i = 0; i < row.shared.size() && row.shared[i] >= 0; ++i) {
    border_[row.pose].col(row.shared[i]) += row.by_shared[i] * row.by_pose;
    for (std::size_t j = 0; j < row.shared.size() && row.shared[j] >= 0; ++j) {
      globals_(row.shared[i], row.shared[j]) += row.by_shared[i] * row.by_shared[j];
    }
  }
  rows_.push_back(row);
}

/// Of each error that lasts, after so long.
Eigen::ArrayXd ChainInformation::kept(double seconds) const {
  Eigen::ArrayXd shares(static_cast<Eigen::Index>(lasts_.size()));
  std::transform(lasts_.begin(), lasts_.end(), shares.data(),
                 [&](double lasts) { return std::exp(-seconds / lasts); });
  return shares;
}

ChainCovariance ChainInformation::covariance() const {
  const std::size_t count = poses_.size();
  std::vector<Pivot> pivots;  // of what is before and at a pose
  pivots.reserve(count);
  std::vector<Gathered> before;
  before.reserve(count);
  std::vector<std::size_t> end(count, 0);  // of the rows of a pose
  std::size_t row = 0;
  for (std::size_t k = 0; k < count; ++k) {
    Matrix<3, 3> pivot = poses_[k];
    Gathered gathered(lasts_.size());
    if (k > 0) {
      const Matrix<3, 3> gain = pivots[k - 1].solve(next_[k - 1]).transpose();
      pivot -= gain * next_[k - 1];
      gathered = before.back();
      gathered.move(-gain, kept(seconds_[k] - seconds_[k - 1]));
    }
    for (; row < rows_.size() && rows_[row].pose == k; ++row) {
      gathered.add(rows_[row]);
    }
    end[k] = row;
    before.push_back(std::move(gathered));
    pivots.emplace_back(pivot);
    if (pivots.back().info() != Eigen::Success) {
      throw NumericalError("pose " + std::to_string(k) + " of the smoother is not determined");
    }
  }
  ChainCovariance found;
  found.poses.resize(count);
  Matrix<3, 3> of_next = Matrix<3, 3>::Zero();  // block of the inverse of the chain
  Matrix<3, 3> after = Matrix<3, 3>::Zero();    // information of what comes behind a pose
  Gathered behind(lasts_.size());
  for (std::size_t k = count; k-- > 0;) {
    Matrix<3, 3> P = pivots[k].solve(Matrix<3, 3>::Identity());
    if (k + 1 < count) {
      const Matrix<3, 3> gain = pivots[k].solve(next_[k]);
      P += gain * of_next * gain.transpose();
      for (std::size_t i = end[k]; i < end[k + 1]; ++i) {
        behind.add(rows_[i]);
      }
      const Matrix<3, 3> back =
          Pivot(poses_[k + 1] + after).solve(next_[k].transpose()).transpose();
      behind.move(-back, kept(seconds_[k + 1] - seconds_[k]));
      after = -back * next_[k].transpose();
    }
    of_next = P;
    found.poses[k] = P + P * before[k].and_of(behind) * P;
  }
  if (globals_.size() > 0) {
    add_globals(pivots, found);
  }
  return found;
}

/// T^-1 of some columns, T being the chain alone.
ChainInformation::Border ChainInformation::solve(const std::vector<Pivot>& pivots,
                                                 Border columns) const {
  for (std::size_t k = 1; k < columns.size(); ++k) {
    columns[k] -= next_[k - 1].transpose() * pivots[k - 1].solve(columns[k - 1]);
  }
  for (std::size_t k = columns.size(); k-- > 0;) {
    if (k + 1 < columns.size()) {
      columns[k] -= next_[k] * columns[k + 1];
    }
    columns[k] = pivots[k].solve(columns[k]).eval();
  }
  return columns;
}

/// (C - I) times a matrix with a row for each of rows_.
Eigen::MatrixXd ChainInformation::excess_of(const Eigen::MatrixXd& of) const {
  Eigen::MatrixXd sum = of;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    sum.row(static_cast<Eigen::Index>(i)) *= rows_[i].variance - 1.0;
  }
  const auto pass = [&](bool forth) {
    Eigen::MatrixXd with =
        Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(lasts_.size()), of.cols());
    std::size_t last = forth ? 0 : seconds_.size() - 1;
    for (std::size_t n = 0; n < rows_.size(); ++n) {
      const std::size_t i = forth ? n : rows_.size() - 1 - n;
      const auto place = static_cast<Eigen::Index>(i);
      if (rows_[i].pose != last) {
        with.array().colwise() *= kept(std::abs(seconds_[rows_[i].pose] - seconds_[last]));
      }
      last = rows_[i].pose;
      for (const MeasuredRow::Lasting& lasting : rows_[i].lasting) {
        if (lasting.process >= 0) {
          sum.row(place) += lasting.loading * with.row(lasting.process);
          with.row(lasting.process) += lasting.loading * of.row(place);
        }
      }
    }
  };
  pass(true);
  pass(false);
  return sum;
}

/// What the shared variables add: eq. (9).
void ChainInformation::add_globals(const std::vector<Pivot>& pivots, ChainCovariance& found) const {
  const Border W = solve(pivots, border_);
  Eigen::MatrixXd schur = globals_;
  for (std::size_t k = 0; k < W.size(); ++k) {
    schur -= border_[k].transpose() * W[k];
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(schur);
  if (factor.info() != Eigen::Success) {
    throw NumericalError("what all poses share is not determined: offsets or places");
  }
  const Eigen::MatrixXd S = factor.solve(Eigen::MatrixXd::Identity(schur.rows(), schur.cols()));
  // Of each row: how it moves the shared variables, before S.
  Eigen::MatrixXd g(static_cast<Eigen::Index>(rows_.size()), schur.cols());
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const auto place = static_cast<Eigen::Index>(i);
    g.row(place) = -rows_[i].by_pose.transpose() * W[rows_[i].pose];
    for (std::size_t j = 0; j < rows_[i].shared.size() && rows_[i].shared[j] >= 0; ++j) {
      g(place, rows_[i].shared[j]) += rows_[i].by_shared[j];
    }
  }
  const Eigen::MatrixXd excess = excess_of(g);
  Border moved(W.size(), Eigen::MatrixXd::Zero(3, schur.cols()));
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    moved[rows_[i].pose] -= rows_[i].by_pose * excess.row(static_cast<Eigen::Index>(i));
  }
  const Border Y = solve(pivots, std::move(moved));
  found.globals = S + S * (g.transpose() * excess) * S;
  for (std::size_t k = 0; k < W.size(); ++k) {
    const Matrix<3, 3> cross = Y[k] * S * W[k].transpose();
    found.poses[k] += W[k] * found.globals * W[k].transpose() + cross + cross.transpose();
  }
}

}  // namespace locfuse::internal
