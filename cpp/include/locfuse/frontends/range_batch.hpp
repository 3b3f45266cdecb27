// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "locfuse/frontends/multilateration.hpp"

namespace locfuse {

/// Solver of a batch.
enum class RangeSolver {
  kNewton,                ///< maximum likelihood by fit_ranges, from SR-LS: the fast path
  kSquaredRange,          ///< SR-LS alone
  kWeightedSquaredRange,  ///< SR-WLS alone
  kCeres,                 ///< maximum likelihood by Ceres, from SR-LS
};

/// Views of the caller's arrays for positions, one row per epoch. An epoch without a position has
/// NaN in its rows and a status that gives the reason.
template <int N>
struct PositionRows {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, N, Eigen::RowMajor>> position;        ///< [m]
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, N * N, Eigen::RowMajor>> covariance;  ///< [m^2]
  Eigen::Map<Eigen::VectorXd> cost;
  Eigen::Map<Eigen::Matrix<PositionStatus, Eigen::Dynamic, 1>> status;
};

/// Positions of many epochs: `ranges` has one row per epoch and one column per anchor [m], NaN
/// where none was received. All epochs use the anchors of `solver`, unless `anchors` gives each its
/// own table of the same shape, one below the other.
///
/// An epoch with a range that is zero, negative or infinite has the status kBadRange. Throws
/// std::invalid_argument, with the epoch, on anchors that are not finite, and on views of other
/// shapes.
template <int N>
void locate_batch(const Multilateration<N>& solver, RangeSolver method,
                  const std::optional<RowsView>& anchors, const RowsView& ranges,
                  PositionRows<N> out);

}  // namespace locfuse
