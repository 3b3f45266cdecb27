// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace locfuse::internal {

/// When anchors count as collinear or coplanar; shared by RangeLayout and SR-LS.
struct FlatAnchors {
  /// Deviation from the line or plane as a share of the extent: above the rounding of coordinates
  /// of 1e7 m, below what can be surveyed.
  static constexpr double kShare = 1e-9;
  /// Lower bound of the squared extent as a share of the squared distance from the origin: rounding
  /// of the coordinates.
  static constexpr double kSquaredRounding = 1e-12;
};

}  // namespace locfuse::internal
