// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "locfuse/frontends/range_layout.hpp"

namespace locfuse {

/// Weights of squared-range least squares; docs/models/ranges.md.
enum class SquaredRangeWeights {
  kEqual,     ///< SR-LS, the problem of Beck, Stoica and Li
  kVariance,  ///< SR-WLS: 1 / variance of the squared range, eq. (2.11)
};

/// Global minimizers of squared-range least squares.
template <int N>
struct SquaredRangePosition {
  int count = 0;  ///< 2 in the hard case (mirror images); 0 if a whole curve or surface fits
  std::array<Vector<N>, 2> position;  ///< relative to the layout's centre [m]
  double multiplier = 0.0;            ///< alpha of eq. (2.7) [m^2 times weight]
};

/// Position from ranges by squared-range least squares, exactly: the global minimum of
/// sum w_i (|x - a_i|^2 - r_i^2)^2, eq. (2.3), by the secular equation (2.8).
///
/// `ranges` holds one positive number [m] per anchor of the layout. N is 2 or 3.
template <int N>
[[nodiscard]] SquaredRangePosition<N> solve_squared_ranges(
    const RangeLayout<N>& layout, const RangesView& ranges,
    SquaredRangeWeights weights = SquaredRangeWeights::kEqual);

/// Gain of the SR-LS position: columns of d x / d r, eq. (2.12). False if the
/// anchors do not fix a direction at `x`.
template <int N>
[[nodiscard]] bool squared_range_gain(const RangeLayout<N>& layout, const Vector<N>& x,
                                      const RangesView& ranges, SquaredRangeWeights weights,
                                      RangeGain<N>& gain);

/// First-order covariance gain R gain', eq. (2.13).
template <int N>
[[nodiscard]] Matrix<N, N> covariance_of(const RangeLayout<N>& layout, const RangeGain<N>& gain);

}  // namespace locfuse
