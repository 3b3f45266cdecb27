// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "locfuse/geometry/pose2.hpp"

namespace locfuse {

/// Straight piece of a wall, seen from its free side: x cos(alpha) + y sin(alpha) = r.
struct Line2 {
  double r = 0.0;      ///< distance of the line from the origin along its normal [m]
  double alpha = 0.0;  ///< direction of the normal, from the free side into the wall [rad]
  Vector<2> middle = Vector<2>::Zero();  ///< of the piece [m]
  double half_length = 0.0;              ///< of the piece [m]

  [[nodiscard]] Vector<2> normal() const { return {std::cos(alpha), std::sin(alpha)}; }
  /// Along the line, with the free side to its left.
  [[nodiscard]] Vector<2> direction() const { return {-std::sin(alpha), std::cos(alpha)}; }
};

}  // namespace locfuse
