// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "locfuse/frontends/range_layout.hpp"

namespace locfuse {

/// Dilution of precision at one point: position sigma per sigma of the ranges. Infinite where the
/// anchors leave a direction open.
struct Dilution {
  double position = 0.0;    ///< sqrt(trace), 2D or 3D
  double horizontal = 0.0;  ///< x and y
  double vertical = 0.0;    ///< z; 0 in the plane
};

/// Dilution of precision, eq. (2.22) of docs/models/ranges.md. `point` has as many
/// coordinates as positions have.
[[nodiscard]] Dilution dilution(const AnchorTable& anchors, const Eigen::VectorXd& point);

/// Cramer-Rao bound (J' R^-1 J)^-1 of a position from ranges at each point, eq. (2.22): lower bound
/// of the covariance of unbiased estimators [m^2]. Infinite on the diagonal where the ranges leave
/// a direction open. `points` has one row per point.
///
/// Throws std::invalid_argument on what `validate` refuses or points of other dimensions.
[[nodiscard]] std::vector<Eigen::MatrixXd> cramer_rao(const AnchorTable& anchors,
                                                      const RangesView& sigma,
                                                      const Eigen::MatrixXd& points);

}  // namespace locfuse
