// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <array>
#include <cstdint>
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

  static constexpr std::size_t kMost = 28;  ///< Gaussians

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
  template <int MaxM>
  struct Softened {
    static constexpr int kRows = MaxM == 1 ? 1 : Eigen::Dynamic;
    using Residual = Eigen::Matrix<double, kRows, 1, Eigen::ColMajor, MaxM, 1>;
    using Noise = Eigen::Matrix<double, kRows, kRows, Eigen::ColMajor, MaxM, MaxM>;
    using Doubt = Eigen::Matrix<
        double, kRows, Eigen::Dynamic, kRows == 1 ? Eigen::RowMajor : Eigen::ColMajor, MaxM,
        MaxM == Eigen::Dynamic ? Eigen::Dynamic : static_cast<int>(NoiseShape::kMost)>;

    Residual residual;
    Noise noise;
    Doubt doubt;  ///< columns, whose outer products sum to it
  };

  /// Of up to MaxM rows, which is 1, 3 or Eigen::Dynamic; `C` is H P H'. Throws NumericalError
  /// unless C + R is positive definite.
  template <int MaxM>
  [[nodiscard]] Softened<MaxM> soften(const typename Softened<MaxM>::Residual& residual,
                                      const typename Softened<MaxM>::Noise& C,
                                      const typename Softened<MaxM>::Noise& noise) const;

 private:
  void add(double share, double mean, double variance);

  std::array<Part, kMost> parts_{};
  std::size_t count_ = 0;
  bool one_sided_ = false;
};

namespace internal {

/// Throws std::invalid_argument if it has a long side and rows more than one.
void check_sides(const NoiseShape& shape, Eigen::Index rows);

/// `PHt` is of the whole belief, `C` is H P H'.
template <class Lin, class Cross, class R>
Outcome fuse_softened(GaussianBelief& belief, const Lin& lin, Slots slots, const Gate& gate,
                      const NoiseShape& shape, const Cross& PHt, const R& C) {
  Cross K;
  const Outcome outcome = compare(lin, PHt, R(C + lin.noise), gate, K);
  if (outcome.verdict == Verdict::kGated) {
    return outcome;
  }
  constexpr int kMost = R::MaxRowsAtCompileTime;
  constexpr int kRows = kMost > 3 ? Eigen::Dynamic : kMost == 2 ? 3 : kMost;
  const auto softened = shape.soften<kRows>(lin.residual, C, lin.noise);
  Lin soft = lin;
  soft.residual = softened.residual;
  soft.noise = softened.noise;
  (void)update(belief, soft, slots, Gate());
  Cross moved = PHt;
  for (const int row : belief.considered_rows()) {
    moved.row(row).setZero();
  }
  // Eq. (6), as a sum of squares: a difference would have no digits left where P is nearly flat
  // along what is measured. The same above the diagonal.
  const Eigen::Matrix<double, Cross::RowsAtCompileTime, Eigen::Dynamic, Eigen::RowMajor,
                      Cross::MaxRowsAtCompileTime, decltype(softened.doubt)::MaxColsAtCompileTime>
      doubtful = moved * softened.doubt;
  bool few = false;
  for (Eigen::Index j = 0; j < belief.P.cols(); ++j) {
    const double before = belief.P(j, j);
    for (Eigen::Index i = 0; i <= j; ++i) {
      belief.P(i, j) += doubtful.row(i).dot(doubtful.row(j));
      belief.P(j, i) = belief.P(i, j);
    }
    few = few || belief.P(j, j) > kMuch * before;
  }
  keep_in_bounds(belief, 0, belief.dimension(), few);
  return outcome;
}

/// Where the slots are part of the belief, or the sizes are known at run time only.
Outcome update_softened_part(GaussianBelief& belief,
                             const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin, Slots slots,
                             const Gate& gate, const NoiseShape& shape);

template <int M, int N, int MaxM>
Outcome update_softened(GaussianBelief& belief, const Linearization<M, N, MaxM>& lin, Slots slots,
                        const Gate& gate, const NoiseShape& shape) {
  check_rows(lin);
  check_sides(shape, lin.residual.size());
  if constexpr (N != Eigen::Dynamic && MaxM != Eigen::Dynamic) {
    if (belief.is_whole(slots, N)) {
      using R = Eigen::Matrix<double, M, M, Eigen::ColMajor, MaxM, MaxM>;
      using Cross = Eigen::Matrix<double, N, M, Eigen::ColMajor, N, MaxM>;
      const Matrix<N, N> P = belief.P;
      const Cross PHt = P * lin.jacobian.transpose();
      return fuse_softened(belief, lin, slots, gate, shape, PHt, R(lin.jacobian * PHt));
    }
  }
  return update_softened_part(belief, {lin.residual, lin.jacobian, lin.noise}, slots, gate, shape);
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
