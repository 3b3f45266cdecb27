// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frontends/scan_refine.hpp"

namespace locfuse::internal {

/// Poses (field frame) at which few beams, coarsely, fit better than around them; best first.
[[nodiscard]] std::vector<Pose2> coarse_minima(const ScanMap& map, const Beams& beams,
                                               const Prior& prior, const Vector<2>& half_window);

/// Minus the log likelihood of a refined pose, docs/models/scan_matching.md eq. (8), with `sigma`
/// [cells] for all hypotheses. `explained` is the share of the returns it explains with nothing in
/// their way.
struct Score {
  double cost;
  double explained;
};
[[nodiscard]] Score score(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
                          const Fit& fit, double sigma);

}  // namespace locfuse::internal
