// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "locfuse/math/types.hpp"

namespace locfuse {

/// Most ranges that one position is computed from; their storage is of fixed size.
inline constexpr int kMaxRanges = 64;

/// Ranges and sigmas are from the shortest to the longest, and coordinates no longer: squares of
/// those, and of their squares, are numbers [m].
inline constexpr double kShortest = 1e-12;
inline constexpr double kLongest = 1e12;
[[nodiscard]] constexpr bool is_length(double value) {
  return value >= kShortest && value <= kLongest;
}

/// Anchors as a caller holds them: `size` rows of 2 or 3 coordinates [m], one after the other. Rows
/// of 3 and a `height` are for a tag that moves at this known height: a position in the plane.
struct AnchorTable {
  const double* rows = nullptr;
  int size = 0;
  int columns = 2;
  std::optional<double> height = {};  ///< of the tag [m]

  /// Dimensions of the positions that are sought: 2 or 3.
  [[nodiscard]] int dimensions() const { return height ? 2 : columns; }
};

/// Throws std::invalid_argument unless columns are 2 or 3 (3 with a height), every coordinate is
/// within kLongest, every sigma a length and there are no more than kMaxRanges rows.
void validate(const AnchorTable& anchors, const double* sigma);

/// d x / d r: how a position moves with each range, one column per range.
template <int N>
using RangeGain = Eigen::Matrix<double, N, Eigen::Dynamic, 0, N, kMaxRanges>;

/// Anchors of range-only positioning in N dimensions, relative to their centroid, with what SR-LS
/// needs of them: docs/models/multilateration.md eq. (5). A tag at known height over anchors in
/// space is the planar case with `height_squared`, eq. (2).
template <int N>
struct RangeLayout {
  using Numbers = std::array<double, kMaxRanges>;

  /// Prepares the rows that `heard` names (all, if null). The table must be valid.
  RangeLayout(const AnchorTable& anchors, const double* sigma, const int* heard = nullptr,
              int heard_size = 0);

  /// |x - a_i|^2 in space, for x relative to `centre`.
  [[nodiscard]] double squared_distance(const Vector<N>& x, int i) const {
    return (x - offset(i)).squaredNorm() + height_squared[static_cast<std::size_t>(i)];
  }
  /// a_i - centre.
  [[nodiscard]] Vector<N> offset(int i) const {
    return Vector<N>::NullaryExpr([&](Eigen::Index k) {
      return anchor[static_cast<std::size_t>(k)][static_cast<std::size_t>(i)];
    });
  }
  /// The anchors lie in one point, line or plane of `directions` dimensions (0, 1 or 2).
  [[nodiscard]] bool within(int directions) const;

  int size = 0;
  Vector<N> centre;               ///< centroid of the anchors [m]
  std::array<Numbers, N> anchor;  ///< relative to the centroid, one array per axis [m]
  Numbers height_squared;         ///< squared height of the tag over each anchor [m^2]
  Numbers sigma;                  ///< of each range [m]
  Numbers information;            ///< 1 / sigma^2
  Matrix<N, N> axes;              ///< directions of spread as columns, the least first
  Vector<N> spread;               ///< sum of squared offsets along each axis [m^2]
  double largest_sigma = 0.0;     ///< [m]
};

namespace internal {

/// Eigenvectors of a symmetric matrix as columns, that of the least eigenvalue first.
[[nodiscard]] Matrix<2, 2> principal_axes(const Matrix<2, 2>& moments);
[[nodiscard]] Matrix<3, 3> principal_axes(const Matrix<3, 3>& moments);

}  // namespace internal

}  // namespace locfuse
