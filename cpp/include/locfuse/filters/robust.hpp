// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "locfuse/filters/kalman.hpp"

namespace locfuse {

/// What noise looks like beyond its sigma.
enum class NoiseKind : std::uint8_t {
  kGaussian,  ///< as its sigma says
  kOneSided,  ///< a share of the measurements is too long, by anything; of one row only
  kStudentT,  ///< with tails of some degrees of freedom, to both sides
  kCauchy,    ///< the same with one degree of freedom
};

/// Noise as a mixture of Gaussians that are shifted and wider than R. A measurement with such noise
/// is fused by the moments of what it leaves of the belief, so one that fits badly moves it little,
/// and the covariance knows: docs/models/robust.md.
class NoiseShape {
 public:
  struct Config {
    NoiseKind kind = NoiseKind::kGaussian;
    double dof = 4.0;          ///< degrees of freedom of kStudentT
    double late_share = 0.05;  ///< of the measurements that are too long, by kOneSided
  };

  NoiseShape() = default;

  /// Throws std::invalid_argument on less than one degree of freedom or a share outside (0, 1).
  explicit NoiseShape(const Config& config);

  [[nodiscard]] bool is_gaussian() const { return count_ == 0; }
  [[nodiscard]] bool is_one_sided() const { return one_sided_; }

  /// One Gaussian of the mixture; of R = 1.
  struct Part {
    double log_share = 0.0;
    double mean = 0.0;
    double variance = 1.0;
  };
  [[nodiscard]] const Part* begin() const { return parts_.data(); }
  [[nodiscard]] const Part* end() const { return parts_.data() + count_; }

  /// A residual and its noise as a Gaussian filter should take them, eq. (5), and by how much, in
  /// the space of the measurement, it knows less than that, eq. (4).
  template <class Residual, class R>
  struct Softened {
    Residual residual;
    R noise;
    R doubt;
  };

  /// `C` is H P H'. Throws NumericalError unless C + R is positive definite.
  template <class Residual, class R>
  [[nodiscard]] Softened<Residual, R> soften(const Residual& residual, const R& C,
                                             const R& noise) const;

  static constexpr std::size_t kMost = 28;

 private:
  void add(double share, double mean, double variance);

  std::array<Part, kMost> parts_{};
  std::size_t count_ = 0;
  bool one_sided_ = false;
};

template <class Residual, class R>
NoiseShape::Softened<Residual, R> NoiseShape::soften(const Residual& residual, const R& C,
                                                     const R& noise) const {
  const Eigen::Index rows = residual.size();
  const R zero = R::Zero(rows, rows);
  if (one_sided_ && !(residual(0) > 0.0)) {
    return {residual, noise, zero};
  }
  std::array<double, kMost> log_weights;
  double largest = -std::numeric_limits<double>::infinity();
  const auto innovation_of = [&](const Part& part) {
    Eigen::LLT<R> factor(C + part.variance * noise);
    if (factor.info() != Eigen::Success) {
      throw NumericalError("innovation covariance is not positive definite");
    }
    return factor;
  };
  const double shift = one_sided_ ? std::sqrt(noise(0, 0)) : 0.0;
  const auto off = [&](const Part& part) {
    Residual d = residual;
    d(0) -= part.mean * shift;
    return d;
  };
  for (std::size_t k = 0; k < count_; ++k) {
    const Eigen::LLT<R> factor = innovation_of(parts_[k]);
    log_weights[k] = parts_[k].log_share - factor.matrixLLT().diagonal().array().log().sum() -
                     0.5 * factor.matrixL().solve(off(parts_[k])).squaredNorm();
    largest = std::max(largest, log_weights[k]);
  }
  double sum = 0.0;
  Residual score = Residual::Zero(rows);
  R information = zero;
  R wide = zero;
  R spread = zero;
  for (std::size_t k = 0; k < count_; ++k) {
    const double weight = std::exp(log_weights[k] - largest);
    if (weight < 1e-12) {
      continue;
    }
    const Eigen::LLT<R> factor = innovation_of(parts_[k]);
    const Residual own = factor.solve(off(parts_[k]));
    const R inverse = factor.solve(R::Identity(rows, rows));
    sum += weight;
    score += weight * own;
    information += weight * inverse;
    wide += weight * parts_[k].variance * inverse;
    spread += weight * own * own.transpose();
  }
  score /= sum;
  const Eigen::LLT<R> factor(information / sum);
  const R softened = factor.solve(R(wide / sum * noise));
  return {factor.solve(score), 0.5 * (softened + softened.transpose()),
          spread / sum - score * score.transpose()};
}

namespace internal {

[[noreturn]] void refuse_one_sided(Eigen::Index rows);

template <class Lin, class Cross, class R>
Outcome fuse_softened(GaussianBelief& belief, const Lin& lin, Slots slots, const Gate& gate,
                      const NoiseShape& shape, const Cross& PHt, const R& C) {
  Cross K;
  const Outcome outcome = compare(lin, PHt, R(C + lin.noise), gate, K);
  if (outcome.verdict == Verdict::kGated) {
    return outcome;
  }
  const auto softened = shape.soften(lin.residual, C, lin.noise);
  Lin soft = lin;
  soft.residual = softened.residual;
  soft.noise = softened.noise;
  (void)update(belief, soft, slots, Gate());
  Cross moved = PHt;
  for (const int row : belief.considered_rows()) {
    moved.row(row).setZero();
  }
  const Cross doubtful = moved * softened.doubt;
  for (Eigen::Index j = 0; j < belief.P.cols(); ++j) {  // eq. (6), the same above the diagonal
    for (Eigen::Index i = 0; i <= j; ++i) {
      belief.P(i, j) += doubtful.row(i).dot(moved.row(j));
      belief.P(j, i) = belief.P(i, j);
    }
  }
  return outcome;
}

template <int M, int N, int MaxM>
Outcome update_softened(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin, Slots slots,
                        const Gate& gate, const NoiseShape& shape) {
  check_rows(lin);
  if (shape.is_one_sided() && lin.residual.size() != 1) {
    refuse_one_sided(lin.residual.size());
  }
  using R = Eigen::Matrix<double, M, M, Eigen::ColMajor, MaxM, MaxM>;
  if constexpr (N != Eigen::Dynamic && MaxM != Eigen::Dynamic) {
    if (belief.is_whole(slots, N)) {
      using Cross = Eigen::Matrix<double, N, M, Eigen::ColMajor, N, MaxM>;
      const Matrix<N, N> P = belief.P;
      const Cross PHt = P * lin.jacobian.transpose();
      return fuse_softened(belief, lin, slots, gate, shape, PHt, R(lin.jacobian * PHt));
    }
  }
  const std::vector<int> rows = belief.rows(slots);
  check_columns(rows.size(), lin.jacobian.cols());
  using Cross = Eigen::Matrix<double, Eigen::Dynamic, M>;
  const Cross PHt = belief.P(Eigen::all, rows) * lin.jacobian.transpose();
  const R C = lin.jacobian * PHt(rows, Eigen::all);
  return fuse_softened(belief, lin, slots, gate, shape, PHt, C);
}

}  // namespace internal

/// Fuses a measurement whose noise has a shape, or gates it: the gate, and the outcome's nis, take
/// the noise as Gaussian. Throws as the plain update does, and std::invalid_argument for one-sided
/// noise of several rows.
template <int M, int N, int MaxM>
Outcome update(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin, Slots slots,
               const Gate& gate, const NoiseShape& shape) {
  return shape.is_gaussian() ? update(belief, lin, slots, gate)
                             : internal::update_softened(belief, lin, slots, gate, shape);
}

}  // namespace locfuse
