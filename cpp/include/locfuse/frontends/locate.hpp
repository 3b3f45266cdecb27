// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "locfuse/frontends/multilateration.hpp"
#include "locfuse/frontends/range_geometry.hpp"

namespace locfuse {

/// Prior of a position: a Gaussian per axis, with infinite sigma where nothing is known.
struct AxisPrior {
  Eigen::VectorXd mean;   ///< [m]
  Eigen::VectorXd sigma;  ///< [m]
};

/// Bounds of a position: low <= x <= high per axis [m].
struct PositionBox {
  Eigen::VectorXd low;
  Eigen::VectorXd high;
};

struct LocateOptions {
  RangeLoss loss;
  PositionRules rules;
  SquaredRangeWeights weights = SquaredRangeWeights::kEqual;  ///< of SR-LS
  RangeMl ml = RangeMl::kNewton;
  CeresOptions ceres;
  std::optional<AxisPrior> prior;
  std::optional<PositionBox> box;
};

/// A position that fits the ranges.
struct PositionHypothesis {
  Eigen::VectorXd position;        ///< [m]
  double cost = 0.0;               ///< eq. (2.14); chi-square without a loss
  Eigen::MatrixXd covariance;      ///< first order [m^2]; infinite diagonal if a direction is open
  Eigen::VectorXd weak_direction;  ///< unit vector of the largest uncertainty
  double weak_sigma = 0.0;         ///< sigma along it [m]
};

/// Comparison of SR-LS and maximum likelihood on the same ranges: eq. (2.18).
struct SolverComparison {
  Eigen::VectorXd squared_range_position;    ///< [m]
  Eigen::MatrixXd squared_range_covariance;  ///< of SR-LS, first order [m^2]
  Eigen::VectorXd difference;                ///< maximum likelihood minus SR-LS [m]
  double statistic = 0.0;                    ///< squared, in units of its predicted covariance
  int dof = 0;                               ///< 0 if nothing can be compared
  double limit = 0.0;                        ///< maximum statistic of good ranges
  [[nodiscard]] bool agree() const { return dof == 0 || statistic <= limit; }
};

/// How far apart the two solvers of maximum likelihood end: `RangeMl::kBoth`.
struct MlComparison {
  Eigen::VectorXd ceres_position;    ///< minimum of Ceres that is nearest to our best [m]
  Eigen::MatrixXd ceres_covariance;  ///< first order, at that minimum [m^2]
  double ceres_cost = 0.0;           ///< eq. (2.14)
  double distance = 0.0;             ///< between that and our best minimum [m]
  double sigmas = 0.0;  ///< the same in standard deviations of our covariance; NaN if that is open
};

/// Range whose removal improves a bad fit most: eq. (2.21).
struct RangeCulprit {
  int index = -1;           ///< index of the range
  double statistic = 0.0;   ///< decrease of the cost by its removal: chi-square of 1 dof
  bool explains = false;    ///< the remaining ranges fit
  Eigen::VectorXd without;  ///< position from the remaining ranges [m]
};

/// Result of `locate`. Hypotheses are sorted by cost.
struct PositionSolution {
  PositionStatus status = PositionStatus::kUnderdetermined;
  std::vector<PositionHypothesis> hypotheses;
  Eigen::VectorXd residuals;  ///< range minus distance from the best hypothesis [m]
  double fit_limit = 0.0;     ///< maximum cost of good ranges
  int fit_dof = 0;            ///< ranges and priors beyond the unknowns of a position
  bool fit_tested = false;    ///< the cost is a chi-square variable: no loss
  std::optional<SolverComparison> comparison;
  std::optional<MlComparison> ml_comparison;  ///< with kBoth, if both solvers found a minimum
  std::optional<RangeCulprit> culprit;
  std::optional<Dilution> dop;
  int iterations = 0;
  std::string termination;  ///< why the solver stopped
  std::string reason;       ///< the status in words; empty if unique

  [[nodiscard]] bool fits() const {
    return !fit_tested || hypotheses.empty() || hypotheses.front().cost <= fit_limit;
  }
};

/// Position from the ranges of one epoch, one per anchor: SR-LS and maximum likelihood side by
/// side, and every position that fits; docs/models/ranges.md.
///
/// Positions, costs and covariances are those of the solver that `LocateOptions::ml` names. The
/// leave-one-out search for a culprit is always by `fit_ranges`.
///
/// Throws std::invalid_argument if `validate` does, on a number of ranges other than that of the
/// anchors, ranges outside 1e-12 to 1e12 m, priors or boxes of other dimensions, and options out of
/// range.
[[nodiscard]] PositionSolution locate(const AnchorTable& anchors, const RangesView& ranges,
                                      const RangesView& sigma, const LocateOptions& options = {});

}  // namespace locfuse
