// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "locfuse/math/linearization.hpp"
#include "locfuse/math/types.hpp"

/// What drivers mean by a covariance: the one place that knows their conventions. Numbers that
/// stand for "unknown" are mapped here and never enter an equation; docs/filter.md.
namespace locfuse {

/// From this variance on, infinity and DBL_MAX included, an axis is not measured [m^2 or rad^2].
constexpr double kNotMeasured = 1e6;

/// Whether a covariance is one at all: first element -1 or all elements 0 say that the driver does
/// not know it (ROS sensor_msgs: NavSatFix, Imu; geometry_msgs: PoseWithCovariance left as made).
template <int N>
[[nodiscard]] bool is_told(const Matrix<N, N>& covariance) {
  return covariance(0, 0) != -1.0 && (covariance.array() != 0.0).any();
}

/// The axes of a measurement that are measured, and R of them.
template <int N>
struct ToldNoise {
  Eigen::Index rows = 0;
  std::array<Eigen::Index, N> axes{};  ///< the first `rows`
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, N, N> noise;
};

/// What a covariance tells. One that is not known has the standard deviations `unknown`, 0 for an
/// axis that is then not measured; no axis has less than `least`: its row and column are widened,
/// so correlations stay.
template <int N>
[[nodiscard]] ToldNoise<N> told_noise(const Matrix<N, N>& covariance, const Vector<N>& unknown,
                                      const Vector<N>& least) {
  const bool told = is_told(covariance);
  ToldNoise<N> noise;
  Vector<N> widened;
  for (Eigen::Index i = 0; i < N; ++i) {
    const double variance = told ? covariance(i, i) : unknown(i) * unknown(i);
    if (told ? variance < kNotMeasured : variance > 0.0) {
      const double floor = least(i) * least(i);
      widened(noise.rows) = variance < floor ? least(i) / std::sqrt(variance) : 1.0;
      noise.axes[static_cast<std::size_t>(noise.rows++)] = i;
    }
  }
  noise.noise.setZero(noise.rows, noise.rows);
  for (Eigen::Index i = 0; i < noise.rows; ++i) {
    const Eigen::Index axis = noise.axes[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; told && j <= i; ++j) {
      const Eigen::Index other = noise.axes[static_cast<std::size_t>(j)];
      noise.noise(i, j) = noise.noise(j, i) = widened(i) * covariance(axis, other) * widened(j);
    }
    if (!told) {
      noise.noise(i, i) = widened(i) * widened(i) * unknown(axis) * unknown(axis);
    }
  }
  return noise;
}

/// Throw std::invalid_argument: the sigma of what is not known is 0 or a sensible one, that which
/// is the least is sensible.
void check_told_sigma(const char* name, double sigma);
void check_least_sigma(const char* name, double sigma);

/// The rows of a measurement whose axes are measured; empty if there are none.
template <int M, int N>
[[nodiscard]] std::optional<Linearization<Eigen::Dynamic, N, M>> measured_rows(
    const Vector<M>& residual, const Matrix<M, N>& jacobian, const ToldNoise<M>& noise) {
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
