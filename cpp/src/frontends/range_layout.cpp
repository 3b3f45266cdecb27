// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/range_layout.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "frontends/flat_anchors.hpp"

namespace locfuse {

namespace {

void expect_coordinates(const AnchorTable& anchors) {
  for (int i = 0; i < anchors.size(); ++i) {
    for (int k = 0; k < anchors.columns(); ++k) {
      if (!(std::abs(anchors.rows(i, k)) <= kMaxLength)) {
        throw std::invalid_argument("anchor " + std::to_string(i) + " has a coordinate " +
                                    std::to_string(anchors.rows(i, k)) +
                                    ", expected finite numbers within 1e12");
      }
    }
  }
}

}  // namespace

void validate(const AnchorTable& anchors, const RangesView& sigma) {
  if (anchors.columns() != 2 && anchors.columns() != 3) {
    throw std::invalid_argument("anchors have " + std::to_string(anchors.columns()) +
                                " coordinates, expected 2 or 3");
  }
  if (anchors.rows.rows() > kMaxRanges) {
    throw std::invalid_argument(std::to_string(anchors.rows.rows()) + " ranges, expected at most " +
                                std::to_string(kMaxRanges) + " for one position");
  }
  if (anchors.height && (anchors.columns() != 3 || !(std::abs(*anchors.height) <= kMaxLength))) {
    throw std::invalid_argument("height is " + std::to_string(*anchors.height) +
                                " over anchors of " + std::to_string(anchors.columns()) +
                                " coordinates, expected a finite number and 3 coordinates");
  }
  expect_coordinates(anchors);
  if (sigma.size() != anchors.rows.rows()) {
    throw std::invalid_argument("sigma has " + std::to_string(sigma.size()) +
                                " numbers, expected " + std::to_string(anchors.size()) +
                                ", one per anchor");
  }
  for (int i = 0; i < anchors.size(); ++i) {
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
RangeLayout<N>::RangeLayout(const AnchorTable& anchors, const RangesView& sigmas)
    : RangeLayout(anchors, sigmas, RangeIndices::NullaryExpr(anchors.size(), [](Eigen::Index i) {
                    return static_cast<int>(i);
                  })) {}

template <int N>
RangeLayout<N>::RangeLayout(const AnchorTable& anchors, const RangesView& sigmas,
                            const RangeIndices& chosen)
    : size(static_cast<int>(chosen.size())), centre(Vector<N>::Zero()) {
  const auto position = [&](int i) -> Vector<N> {
    return anchors.rows.row(chosen(i)).template head<N>();
  };
  for (int i = 0; i < size; ++i) {
    centre += position(i) / size;
  }
  Matrix<N, N> moments = Matrix<N, N>::Zero();
  for (int i = 0; i < size; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const Vector<N> offset = position(i) - centre;
    for (std::size_t k = 0; k < N; ++k) {
      anchor[k][slot] = offset(static_cast<Eigen::Index>(k));
    }
    const double height = anchors.height ? *anchors.height - anchors.rows(chosen(i), 2) : 0.0;
    height_squared[slot] = height * height;
    sigma[slot] = sigmas(chosen(i));
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
  using internal::FlatAnchors;
  const double extent =
      std::max(spread(N - 1), centre.squaredNorm() * FlatAnchors::kSquaredRounding);
  return spread(N - 1 - directions) <= FlatAnchors::kShare * FlatAnchors::kShare * extent;
}

template struct RangeLayout<2>;
template struct RangeLayout<3>;

}  // namespace locfuse
