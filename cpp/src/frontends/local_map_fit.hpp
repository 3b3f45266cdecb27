// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "frontends/line_cloud.hpp"
#include "frontends/pose_information.hpp"
#include "locfuse/frontends/local_map.hpp"

namespace locfuse::internal {

/// Gauss-Newton from `start`; docs/models/scans.md eq. (1.11) to (1.13). The pose is the start
/// unless `converged`.
[[nodiscard]] ScanMatch fit_lines(const LineCloud& cloud, const LocalMapConfig& config,
                                  const std::vector<LinePoint>& beams, const Pose2& start,
                                  const Prior& prior);

}  // namespace locfuse::internal
