// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "locfuse/math/types.hpp"

namespace locfuse::internal {

/// Line through points by total least squares: the principal axis of their spread.
struct LineFit {
  double direction;  ///< of the axis, either way [rad]
  double along;      ///< variance of the points along it
  double across;     ///< and across it, which rounding may make negative

  [[nodiscard]] Vector<2> normal() const { return {-std::sin(direction), std::cos(direction)}; }
};

/// From the mean of d d' over the points, with d from their mean.
[[nodiscard]] inline LineFit fit_line(const Matrix<2, 2>& spread) {
  const double half = 0.5 * (spread(0, 0) - spread(1, 1));
  const double root = std::hypot(half, spread(0, 1));
  return {0.5 * std::atan2(spread(0, 1), half), 0.5 * spread.trace() + root,
          0.5 * spread.trace() - root};
}

}  // namespace locfuse::internal
