// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/estimators/pose_estimate.hpp"

/// The Gaussian sum of an Initializer: weighted pose filters. Derivation: docs/start.md.
namespace locfuse::internal {

/// How far measurements were from what a filter expected.
struct Scatter {
  double nis = 0.0;  ///< sum
  int rows = 0;      ///< that it is of
};

/// One Gaussian of the sum, a filter of its own.
struct GaussianComponent {
  PoseEkf ekf;
  double log_weight;
  Scatter ranges = {};     ///< of those that decided between components
  Scatter positions = {};  ///< of position fixes
  Scatter all = {};        ///< of both, and of ranges that decided nothing
};

/// Components that agree, moment-matched.
struct GaussianCluster {
  PoseEstimate estimate;
  double log_weight;
};

/// Whether the squared Mahalanobis distance of two estimates is below a limit: that of the whole
/// pose, or of the position alone.
[[nodiscard]] bool are_within(double limit, const PoseEstimate& a, const PoseEstimate& b,
                              bool with_heading);

/// Sorts the components by weight, scales the weights so that the largest is 1, drops those that
/// are negligible, and merges those that are nearly the same: `filter_at` makes the filter of a
/// merged one. Returns the log weight that all were divided by.
double reduce(std::vector<GaussianComponent>& components,
              const std::function<PoseEkf(const PoseEstimate&)>& filter_at);

/// Clusters of components that are near each other by their whole pose, or by position alone; the
/// heaviest first.
[[nodiscard]] std::vector<GaussianCluster> clusters(
    const std::vector<GaussianComponent>& components, bool by_heading);

}  // namespace locfuse::internal
