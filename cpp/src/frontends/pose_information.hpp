// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/geometry/pose2.hpp"

/// Information of a scan on a pose (x, y, heading), in any unit of length; a radian counts as the
/// typical range. docs/models/scans.md eq. (1.7).
namespace locfuse::internal {

/// Prior of a pose, in the frame and unit of the fit.
struct Prior {
  Pose2 mean;
  Matrix<3, 3> information = Matrix<3, 3>::Zero();
};

/// Normal equations of a pose without the directions that the scan does not observe.
struct Observed {
  Matrix<3, 3> information;
  Vector<3> gradient;
  Vector<3> per_scale;            ///< of (x, y, heading), from lengths
  std::optional<Vector<3>> weak;  ///< the weakest of the removed directions
};

/// Removes directions whose information may be rounding or noise; `range` is the typical one.
[[nodiscard]] Observed observed(const Matrix<3, 3>& information, const Vector<3>& gradient,
                                double range);

/// Newton's step from `pose` over the directions that scan or prior observe, as lengths.
[[nodiscard]] Vector<3> newton_step(const Observed& scan, const Prior& prior, const Pose2& pose);

/// Inverse of an information; empty if a direction has none.
[[nodiscard]] std::optional<Matrix<3, 3>> covariance_of(const Matrix<3, 3>& information);

/// Throws std::invalid_argument unless it is symmetric and positive definite, with a finite
/// inverse.
void require_covariance(const Eigen::Ref<const Eigen::MatrixXd>& covariance);

}  // namespace locfuse::internal
