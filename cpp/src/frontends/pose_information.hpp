// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/geometry/pose2.hpp"

/// What a scan says of a pose (x, y, heading), in any unit of length; a radian counts as the
/// typical range. docs/models/scan_matching.md eq. (7).
namespace locfuse::internal {

/// What is known of a pose without the scan, in the frame and unit of the fit.
struct Prior {
  Pose2 mean;
  Matrix<3, 3> information = Matrix<3, 3>::Zero();
};

/// Normal equations of a pose without the directions that the scan does not see.
struct Observed {
  Matrix<3, 3> information;
  Vector<3> gradient;
  Vector<3> per_scale;            ///< to lengths, for each of (x, y, heading)
  std::optional<Vector<3>> weak;  ///< the least seen of those taken out
};

/// Takes out what rounding or noise alone would say; `range` is the typical one.
[[nodiscard]] Observed observed(const Matrix<3, 3>& information, const Vector<3>& gradient,
                                double range);

/// Newton's step from `pose` over the directions that scan or prior know, as lengths.
[[nodiscard]] Vector<3> newton_step(const Observed& scan, const Prior& prior, const Pose2& pose);

/// Empty if a direction has no information.
[[nodiscard]] std::optional<Matrix<3, 3>> covariance_of(const Matrix<3, 3>& information);

/// Throws std::invalid_argument unless it is symmetric and positive definite, with a finite
/// inverse.
void require_covariance(const Eigen::Ref<const Eigen::MatrixXd>& covariance);

}  // namespace locfuse::internal
