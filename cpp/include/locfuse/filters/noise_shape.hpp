// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "locfuse/math/noise_kind.hpp"

namespace locfuse {

/// Noise as a mixture of Gaussians that are shifted and wider than R. A measurement with such noise
/// is fused by the moments of what it leaves of the belief, so one that fits badly moves it little,
/// and the covariance knows: docs/models/updates.md.
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

  static constexpr std::size_t kMaxParts = 28;  ///< Gaussians

  /// One Gaussian of the mixture; of R = 1.
  struct Part {
    double log_share = 0.0;
    double mean = 0.0;
    double variance = 1.0;
  };
  [[nodiscard]] const Part* begin() const { return parts_.data(); }
  [[nodiscard]] const Part* end() const { return parts_.data() + count_; }

  /// A residual and its noise as a Gaussian filter should take them, eq. (2.5), and by how much, in
  /// the space of the measurement, it knows less than that, eq. (2.4).
  template <int MaxM>
  struct MomentMatched {
    static constexpr int kRows = MaxM == 1 ? 1 : Eigen::Dynamic;
    using Residual = Eigen::Matrix<double, kRows, 1, Eigen::ColMajor, MaxM, 1>;
    using Noise = Eigen::Matrix<double, kRows, kRows, Eigen::ColMajor, MaxM, MaxM>;
    using Spread = Eigen::Matrix<
        double, kRows, Eigen::Dynamic, kRows == 1 ? Eigen::RowMajor : Eigen::ColMajor, MaxM,
        MaxM == Eigen::Dynamic ? Eigen::Dynamic : static_cast<int>(NoiseShape::kMaxParts)>;

    Residual residual;
    Noise noise;
    Spread spread;  ///< columns, whose outer products sum to it
  };

  /// Of up to MaxM rows, which is 1, 3 or Eigen::Dynamic; `C` is H P H'. Throws NumericalError
  /// unless C + R is positive definite.
  template <int MaxM>
  [[nodiscard]] MomentMatched<MaxM> moment_match(
      const typename MomentMatched<MaxM>::Residual& residual,
      const typename MomentMatched<MaxM>::Noise& C,
      const typename MomentMatched<MaxM>::Noise& noise) const;

 private:
  void add(double share, double mean, double variance);

  std::array<Part, kMaxParts> parts_{};
  std::size_t count_ = 0;
  bool one_sided_ = false;
};

}  // namespace locfuse
