// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "locfuse/frontends/multilateration.hpp"
#include "locfuse/frontends/range_geometry.hpp"

namespace locfuse {

/// What is known of a position before: a Gaussian per axis, infinite sigma where nothing is.
struct AxisPrior {
  Eigen::VectorXd mean;   ///< [m]
  Eigen::VectorXd sigma;  ///< [m]
};

/// The position is inside: low <= x <= high per axis [m].
struct PositionBox {
  Eigen::VectorXd low;
  Eigen::VectorXd high;
};

struct LocateOptions {
  RangeLoss loss;
  PositionRules rules;
  SquaredRangeWeights weights = SquaredRangeWeights::kEqual;  ///< of SR-LS
  bool use_ceres = true;  ///< maximum likelihood by Ceres; else by fit_ranges
  CeresOptions ceres;
  std::optional<AxisPrior> prior;
  std::optional<PositionBox> box;
};

/// A position that fits.
struct PositionHypothesis {
  Eigen::VectorXd position;        ///< [m]
  double cost = 0.0;               ///< eq. (14); chi-square without a loss
  Eigen::MatrixXd covariance;      ///< first order [m^2]; infinite diagonal if a direction is open
  Eigen::VectorXd weak_direction;  ///< unit vector along which it is least certain
  double weak_sigma = 0.0;         ///< along it [m]
};

/// SR-LS beside maximum likelihood on the same ranges: eq. (18).
struct SolverComparison {
  Eigen::VectorXd squared_range_position;    ///< [m]
  Eigen::MatrixXd squared_range_covariance;  ///< its own, first order [m^2]
  Eigen::VectorXd difference;                ///< maximum likelihood minus SR-LS [m]
  double statistic = 0.0;                    ///< squared, in units of its predicted covariance
  int dof = 0;                               ///< 0 if there is nothing to compare with
  double limit = 0.0;                        ///< largest statistic of good ranges
  [[nodiscard]] bool agree() const { return dof == 0 || statistic <= limit; }
};

/// The range whose removal explains a bad fit best: eq. (21).
struct RangeCulprit {
  int index = -1;           ///< of the range
  double statistic = 0.0;   ///< by how much its removal lowers the cost: chi-square of 1 dof
  bool explains = false;    ///< the other ranges fit
  Eigen::VectorXd without;  ///< position from the others [m]
};

/// All that one set of ranges says. Hypotheses are sorted by cost.
struct PositionSolution {
  PositionStatus status = PositionStatus::kUnderdetermined;
  std::vector<PositionHypothesis> hypotheses;
  Eigen::VectorXd residuals;  ///< range minus distance from the best hypothesis [m]
  double fit_limit = 0.0;     ///< largest cost of good ranges
  int fit_dof = 0;            ///< ranges (and priors) beyond what a position needs
  bool fit_tested = false;    ///< the cost is a chi-square variable: no loss
  std::optional<SolverComparison> comparison;
  std::optional<RangeCulprit> culprit;
  std::optional<Dilution> dop;
  int iterations = 0;
  std::string termination;  ///< why the solver stopped
  std::string reason;       ///< the status in words; empty if unique

  [[nodiscard]] bool fits() const {
    return !fit_tested || hypotheses.empty() || hypotheses.front().cost <= fit_limit;
  }
};

/// Both solvers on the ranges of one moment, and everything that fits:
/// docs/models/multilateration.md. Throws std::invalid_argument on what `validate` refuses, ranges
/// that are not 1e-12 to 1e12 m, priors or boxes of other dimensions, options out of range.
[[nodiscard]] PositionSolution locate(const AnchorTable& anchors, const double* ranges,
                                      const double* sigma, const LocateOptions& options = {});

}  // namespace locfuse
