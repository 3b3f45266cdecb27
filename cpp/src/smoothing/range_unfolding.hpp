// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

namespace locfuse::internal {

/// Where anchors and a tag on its way are, from the ranges between them alone: in a frame of their
/// own, that is turned, shifted and mirrored anyhow.
struct Unfolded {
  Eigen::Matrix<double, Eigen::Dynamic, 2> anchors;  ///< [m]
  Eigen::Matrix<double, Eigen::Dynamic, 2> tags;     ///< at each epoch [m]
  Eigen::VectorXd climb_squared;  ///< of each anchor over the tag [m^2], which noise may make < 0
};

/// Unfolds ranges, one row an anchor and one column an epoch, all of them there [m]: the squares,
/// centred by rows and columns, are a product of rank two, and their means fix its factors;
/// docs/survey.md eq. (1) and (2). Epochs that fit badly are left out of the solution.
///
/// Empty with fewer than three anchors or ten epochs, and where the anchors or the way lie in a
/// line.
[[nodiscard]] std::optional<Unfolded> unfold(const Eigen::MatrixXd& ranges);

}  // namespace locfuse::internal
