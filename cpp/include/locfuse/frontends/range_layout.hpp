// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "locfuse/math/types.hpp"

namespace locfuse {

/// Maximum number of ranges for one position; their storage is of fixed size.
inline constexpr int kMaxRanges = 64;

/// Bounds of ranges and sigmas, and of the magnitude of coordinates [m]: their fourth powers are
/// finite and not 0.
inline constexpr double kMinLength = 1e-12;
inline constexpr double kMaxLength = 1e12;
[[nodiscard]] constexpr bool is_length(double value) {
  return value >= kMinLength && value <= kMaxLength;
}

/// View of the caller's numbers, one per anchor: ranges or their sigmas [m].
using RangesView = Eigen::Ref<const Eigen::VectorXd>;

/// View of the caller's rows of numbers.
using RowsView =
    Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

/// Ranges, and numbers of rows, in storage of fixed size.
using Ranges = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxRanges, 1>;
using RangeIndices = Eigen::Matrix<int, Eigen::Dynamic, 1, 0, kMaxRanges, 1>;

/// View of the caller's anchors: one row of 2 or 3 coordinates each [m]. Rows of 3 with a `height`
/// are for a tag that moves at this known height: its position is sought in the plane.
struct AnchorTable {
  RowsView rows;
  std::optional<double> height = {};  ///< of the tag [m]

  [[nodiscard]] int size() const { return static_cast<int>(rows.rows()); }
  [[nodiscard]] int columns() const { return static_cast<int>(rows.cols()); }
  /// Dimensions of the positions that are sought: 2 or 3.
  [[nodiscard]] int dimensions() const { return height ? 2 : columns(); }
};

/// Throws std::invalid_argument unless columns are 2 or 3 (3 with a height), coordinates are within
/// kMaxLength, there are at most kMaxRanges rows, and one sigma per row that is a length.
void validate(const AnchorTable& anchors, const RangesView& sigma);

/// d x / d r: how a position moves with each range, one column per range.
template <int N>
using RangeGain = Eigen::Matrix<double, N, Eigen::Dynamic, 0, N, kMaxRanges>;

/// Anchors of range-only positioning in N dimensions, relative to their centroid and prepared for
/// SR-LS: docs/models/ranges.md eq. (2.5). A tag at known height over anchors in
/// space is the planar case with `height_squared`, eq. (2.2).
template <int N>
struct RangeLayout {
  using Numbers = std::array<double, kMaxRanges>;

  /// Prepares all rows. Table and sigmas must be valid.
  RangeLayout(const AnchorTable& anchors, const RangesView& sigma);
  /// Prepares the rows with the indices `chosen`.
  RangeLayout(const AnchorTable& anchors, const RangesView& sigma, const RangeIndices& chosen);

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
  /// Whether the anchors lie in one point, line or plane: `directions` is 0, 1 or 2.
  [[nodiscard]] bool within(int directions) const;

  int size = 0;
  Vector<N> centre;               ///< centroid of the anchors [m]
  std::array<Numbers, N> anchor;  ///< relative to the centroid, one array per axis [m]
  Numbers height_squared;         ///< squared height of the tag over each anchor [m^2]
  Numbers sigma;                  ///< of each range [m]
  Numbers information;            ///< 1 / sigma^2
  Matrix<N, N> axes;              ///< directions of spread as columns, in ascending order
  Vector<N> spread;               ///< sum of squared offsets along each axis [m^2]
  double largest_sigma = 0.0;     ///< [m]
};

namespace internal {

/// Eigenvectors of a symmetric matrix as columns, eigenvalues ascending.
[[nodiscard]] Matrix<2, 2> principal_axes(const Matrix<2, 2>& moments);
[[nodiscard]] Matrix<3, 3> principal_axes(const Matrix<3, 3>& moments);

}  // namespace internal

}  // namespace locfuse
