// SPDX-License-Identifier: Apache-2.0
#include "smoothing/range_unfolding.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <vector>

namespace locfuse::internal {
namespace {

constexpr Eigen::Index kFewestAnchors = 3;
constexpr Eigen::Index kFewestEpochs = 10;
constexpr int kRounds = 4;
constexpr double kBad = 3.0;       // times the middle misfit of an epoch
constexpr double kExact_m = 1e-3;  // below which none is bad
constexpr double kNarrow = 0.02;   // singular value beside the largest of what lies in a line

Eigen::MatrixXd chosen(const Eigen::MatrixXd& all, const std::vector<Eigen::Index>& columns) {
  Eigen::MatrixXd some(all.rows(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    some.col(static_cast<Eigen::Index>(k)) = all.col(columns[k]);
  }
  return some;
}

/// The factors of squared ranges, and how far each epoch misfits.
struct Solution {
  Unfolded unfolded;
  Eigen::VectorXd misfit;
};

std::optional<Solution> solve(const Eigen::MatrixXd& squared) {
  const Eigen::VectorXd of_anchor = squared.rowwise().mean();
  const Eigen::RowVectorXd of_epoch = squared.colwise().mean();
  const double mean = squared.mean();
  Eigen::MatrixXd centred = squared.colwise() - of_anchor;
  centred.rowwise() -= of_epoch;
  centred.array() += mean;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(centred, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::VectorXd& values = svd.singularValues();
  if (!(values(1) > kNarrow * values(0))) {
    return std::nullopt;
  }
  const Eigen::Matrix2d root = values.head<2>().cwiseSqrt().asDiagonal();
  const Eigen::Matrix<double, Eigen::Dynamic, 2> tags = svd.matrixV().leftCols<2>() * root;
  const Eigen::Matrix<double, Eigen::Dynamic, 2> anchors =
      -0.5 * svd.matrixU().leftCols<2>() * root;
  // |t|^2 of each epoch, less its mean: of G = C'C, g = C't_m and a constant.
  Eigen::MatrixXd rows(tags.rows(), 6);
  rows << tags.col(0).cwiseAbs2(), 2.0 * tags.col(0).cwiseProduct(tags.col(1)),
      tags.col(1).cwiseAbs2(), 2.0 * tags, Eigen::VectorXd::Ones(tags.rows());
  const Eigen::VectorXd found =
      rows.colPivHouseholderQr().solve((of_epoch.array() - mean).matrix().transpose());
  Eigen::Matrix2d G;
  G << found(0), found(1), found(1), found(2);
  const Eigen::LLT<Eigen::Matrix2d> factor(G);
  if (!found.allFinite() || factor.info() != Eigen::Success) {
    return std::nullopt;
  }
  const Eigen::Matrix2d C = factor.matrixU();
  Solution solution;
  const Eigen::Vector2d middle =
      C.transpose().triangularView<Eigen::Lower>().solve(Eigen::Vector2d(found(3), found(4)));
  solution.unfolded.tags = (tags * C.transpose()).rowwise() + middle.transpose();
  solution.unfolded.anchors =
      C.transpose().triangularView<Eigen::Lower>().solve(anchors.transpose()).transpose();
  Eigen::MatrixXd flat(squared.rows(), squared.cols());
  for (Eigen::Index j = 0; j < flat.rows(); ++j) {
    flat.row(j) = (solution.unfolded.tags.rowwise() - solution.unfolded.anchors.row(j))
                      .rowwise()
                      .squaredNorm()
                      .transpose();
  }
  solution.unfolded.climb_squared = (squared - flat).rowwise().mean();
  const Eigen::MatrixXd expected =
      (flat.colwise() + solution.unfolded.climb_squared).cwiseMax(0.0).cwiseSqrt();
  solution.misfit = (squared.cwiseSqrt() - expected).cwiseAbs().colwise().maxCoeff().transpose();
  return solution;
}

}  // namespace

std::optional<Unfolded> unfold(const Eigen::MatrixXd& ranges) {
  if (ranges.rows() < kFewestAnchors || ranges.cols() < kFewestEpochs) {
    return std::nullopt;
  }
  const Eigen::MatrixXd squared = ranges.cwiseAbs2();
  std::vector<Eigen::Index> kept(static_cast<std::size_t>(ranges.cols()));
  for (std::size_t k = 0; k < kept.size(); ++k) {
    kept[k] = static_cast<Eigen::Index>(k);
  }
  std::optional<Solution> solution;
  for (int round = 0; round < kRounds; ++round) {
    solution = solve(chosen(squared, kept));
    if (!solution) {
      return std::nullopt;
    }
    std::vector<double> sorted(solution->misfit.begin(), solution->misfit.end());
    const auto half = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), half, sorted.end());
    std::vector<Eigen::Index> good;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      if (solution->misfit(static_cast<Eigen::Index>(k)) <= kBad * std::max(*half, kExact_m)) {
        good.push_back(kept[k]);
      }
    }
    if (good.size() == kept.size() ||
        static_cast<Eigen::Index>(good.size()) < std::max(kFewestEpochs, ranges.cols() / 2)) {
      break;
    }
    kept = std::move(good);
  }
  return std::move(solution->unfolded);
}

}  // namespace locfuse::internal
