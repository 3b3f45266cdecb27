// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "locfuse/frontends/multilateration.hpp"

namespace locfuse {

/// What computes the positions of a batch.
enum class RangeSolver {
  kMaximumLikelihood,     ///< SR-LS, then fit_ranges: the fast path
  kSquaredRange,          ///< SR-LS alone
  kWeightedSquaredRange,  ///< SR-WLS alone
  kCeres,                 ///< SR-LS, then Ceres
};

/// Where the positions of many epochs go: arrays of the caller, one row per epoch. NaN in the rows
/// of an epoch without a position, whose status says why.
struct PositionRows {
  double* position = nullptr;    ///< N numbers per epoch [m]
  double* covariance = nullptr;  ///< N x N numbers per epoch [m^2]
  double* cost = nullptr;
  PositionStatus* status = nullptr;
};

/// Positions of `epochs` rows of ranges, one per anchor [m], NaN where not heard. All epochs see
/// the anchors of `solver`, or, if `anchors` is given, each its own table of the same shape.
///
/// An epoch with a range that is zero, negative or infinite has the status kBadRange. Throws
/// std::invalid_argument on anchors that are not finite, with the epoch.
template <int N>
void locate_batch(const Multilateration<N>& solver, RangeSolver method, const double* anchors,
                  const double* ranges, std::size_t epochs, const PositionRows& out);

}  // namespace locfuse
