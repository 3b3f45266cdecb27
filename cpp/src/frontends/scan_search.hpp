// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frontends/scan_refine.hpp"

namespace locfuse::internal {

/// Local minima of the coarse cost of a scan, as poses in the field frame, best first.
[[nodiscard]] std::vector<Pose2> coarse_minima(const ScanMap& map, const Beams& beams,
                                               const Prior& prior, const Vector<2>& half_window);

/// Negative log likelihood of a refined pose, docs/models/scans.md eq. (1.8), with one
/// `sigma` [cells] for all hypotheses. `explained` is the share of the returns that end at a wall
/// without passing through another one.
struct Score {
  double cost;
  double explained;
};
[[nodiscard]] Score score(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
                          const Fit& fit, double sigma);

}  // namespace locfuse::internal
