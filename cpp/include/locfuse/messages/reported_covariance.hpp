// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "locfuse/math/linearization.hpp"
#include "locfuse/math/types.hpp"

/// Conventions of drivers for covariances, in one place: values that stand for "unknown" are
/// resolved here and never enter an equation; docs/filter.md.
namespace locfuse {

/// An axis with this variance or more, infinity and DBL_MAX included, is not measured
/// [m^2 or rad^2].
constexpr double kNotMeasured = 1e6;

/// Whether a covariance was reported at all: first element -1 or all elements 0 mean that the
/// driver does not know it (ROS sensor_msgs: NavSatFix, Imu; geometry_msgs: a default-constructed
/// PoseWithCovariance).
template <int N>
[[nodiscard]] bool is_reported(const Matrix<N, N>& covariance) {
  return covariance(0, 0) != -1.0 && (covariance.array() != 0.0).any();
}

/// Axes of a measurement that are measured, and R of them.
template <int N>
struct ReportedNoise {
  Eigen::Index rows = 0;
  std::array<Eigen::Index, N> axes{};  ///< the first `rows`
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, N, N> noise;
};

/// Measurement noise from a reported covariance.
///
/// A covariance that is not reported is replaced by the standard deviations `unknown`; an axis with
/// 0 there is not measured. A standard deviation below `min_sigma` is raised to it by scaling its
/// row and column, which keeps correlations.
template <int N>
[[nodiscard]] ReportedNoise<N> reported_noise(const Matrix<N, N>& covariance,
                                              const Vector<N>& unknown,
                                              const Vector<N>& min_sigma) {
  const bool reported = is_reported(covariance);
  ReportedNoise<N> noise;
  Vector<N> scale;
  for (Eigen::Index i = 0; i < N; ++i) {
    const double variance = reported ? covariance(i, i) : unknown(i) * unknown(i);
    if (reported ? variance < kNotMeasured : variance > 0.0) {
      const double min_variance = min_sigma(i) * min_sigma(i);
      scale(noise.rows) = variance < min_variance ? min_sigma(i) / std::sqrt(variance) : 1.0;
      noise.axes[static_cast<std::size_t>(noise.rows++)] = i;
    }
  }
  noise.noise.setZero(noise.rows, noise.rows);
  for (Eigen::Index i = 0; i < noise.rows; ++i) {
    const Eigen::Index axis = noise.axes[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; reported && j <= i; ++j) {
      const Eigen::Index other = noise.axes[static_cast<std::size_t>(j)];
      noise.noise(i, j) = noise.noise(j, i) = scale(i) * covariance(axis, other) * scale(j);
    }
    if (!reported) {
      noise.noise(i, i) = scale(i) * scale(i) * unknown(axis) * unknown(axis);
    }
  }
  return noise;
}

/// Sigma for covariances that are not reported: throws std::invalid_argument unless it is 0 or
/// positive with a finite square.
void check_unknown_sigma(const char* name, double sigma);

/// Lower bound of a reported sigma: throws std::invalid_argument unless it is positive with a
/// finite square.
void check_min_sigma(const char* name, double sigma);

/// Rows of a linearization whose axes are measured; empty if there are none.
template <int M, int N>
[[nodiscard]] std::optional<Linearization<Eigen::Dynamic, N, M>> measured_rows(
    const Vector<M>& residual, const Matrix<M, N>& jacobian, const ReportedNoise<M>& noise) {
  if (noise.rows == 0) {
    return std::nullopt;
  }
  Linearization<Eigen::Dynamic, N, M> lin;
  lin.residual.resize(noise.rows);
  lin.jacobian.resize(noise.rows, N);
  for (Eigen::Index i = 0; i < noise.rows; ++i) {
    const Eigen::Index axis = noise.axes[static_cast<std::size_t>(i)];
    lin.residual(i) = residual(axis);
    lin.jacobian.row(i) = jacobian.row(axis);
  }
  lin.noise = noise.noise;
  return lin;
}

}  // namespace locfuse
