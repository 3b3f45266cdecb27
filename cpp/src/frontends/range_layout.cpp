// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/range_layout.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

namespace locfuse {

namespace {

// Anchors are taken for collinear or coplanar if they deviate by no more than this share of their
// extent: beyond the rounding of coordinates of 1e7 m, below anything that can be surveyed.
constexpr double kFlat = 1e-9;

void expect_coordinates(const AnchorTable& anchors) {
  for (int i = 0; i < anchors.size * anchors.columns; ++i) {
    if (!(std::abs(anchors.rows[i]) <= kLongest)) {
      throw std::invalid_argument("anchor " + std::to_string(i / anchors.columns) +
                                  " has a coordinate " + std::to_string(anchors.rows[i]) +
                                  ", expected finite numbers within 1e12");
    }
  }
}

}  // namespace

void validate(const AnchorTable& anchors, const double* sigma) {
  if (anchors.columns != 2 && anchors.columns != 3) {
    throw std::invalid_argument("anchors have " + std::to_string(anchors.columns) +
                                " coordinates, expected 2 or 3");
  }
  if (anchors.size < 0 || anchors.size > kMaxRanges) {
    throw std::invalid_argument(std::to_string(anchors.size) + " ranges, expected at most " +
                                std::to_string(kMaxRanges) + " for one position");
  }
  if (anchors.height && (anchors.columns != 3 || !(std::abs(*anchors.height) <= kLongest))) {
    throw std::invalid_argument("height is " + std::to_string(*anchors.height) +
                                " over anchors of " + std::to_string(anchors.columns) +
                                " coordinates, expected a finite number and 3 coordinates");
  }
  expect_coordinates(anchors);
  for (int i = 0; i < anchors.size; ++i) {
    if (!is_length(sigma[i])) {
      throw std::invalid_argument("sigma of range " + std::to_string(i) + " is " +
                                  std::to_string(sigma[i]) +
                                  ", expected a positive number, 1e-12 to 1e12");
    }
  }
}

namespace internal {

Matrix<2, 2> principal_axes(const Matrix<2, 2>& moments) {
  const double angle = 0.5 * std::atan2(2.0 * moments(0, 1), moments(0, 0) - moments(1, 1));
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return (Matrix<2, 2>() << -s, c, c, s).finished();
}

Matrix<3, 3> principal_axes(const Matrix<3, 3>& moments) {
  return Eigen::SelfAdjointEigenSolver<Matrix<3, 3>>(moments).eigenvectors();
}

}  // namespace internal

template <int N>
RangeLayout<N>::RangeLayout(const AnchorTable& anchors, const double* sigmas, const int* heard,
                            int heard_size)
    : size(heard != nullptr ? heard_size : anchors.size), centre(Vector<N>::Zero()) {
  const auto row = [&](int i) {
    return anchors.rows +
           static_cast<std::ptrdiff_t>(heard != nullptr ? heard[i] : i) * anchors.columns;
  };
  for (int i = 0; i < size; ++i) {
    centre += Eigen::Map<const Vector<N>>(row(i)) / size;
  }
  Matrix<N, N> moments = Matrix<N, N>::Zero();
  for (int i = 0; i < size; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const Vector<N> offset = Eigen::Map<const Vector<N>>(row(i)) - centre;
    for (std::size_t k = 0; k < N; ++k) {
      anchor[k][slot] = offset(static_cast<Eigen::Index>(k));
    }
    const double height = anchors.height ? *anchors.height - row(i)[2] : 0.0;
    height_squared[slot] = height * height;
    sigma[slot] = sigmas[heard != nullptr ? heard[i] : i];
    information[slot] = 1.0 / (sigma[slot] * sigma[slot]);
    largest_sigma = std::max(largest_sigma, sigma[slot]);
    moments += offset * offset.transpose();
  }
  axes = internal::principal_axes(moments);
  // Sums of squares along the axes have no cancellation: zero where the anchors are flat.
  spread.setZero();
  for (int i = 0; i < size; ++i) {
    spread += (axes.transpose() * offset(i)).cwiseAbs2();
  }
}

template <int N>
bool RangeLayout<N>::within(int directions) const {
  if (directions >= N) {
    return true;
  }
  const double extent =
      std::max(spread(N - 1), centre.squaredNorm() * 1e-12);  // rounding of the coordinates
  return spread(N - 1 - directions) <= kFlat * kFlat * extent;
}

template struct RangeLayout<2>;
template struct RangeLayout<3>;

}  // namespace locfuse
