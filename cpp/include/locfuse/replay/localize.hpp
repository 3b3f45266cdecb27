// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "locfuse/estimators/mcl.hpp"
#include "locfuse/estimators/switching_mcl.hpp"
#include "locfuse/replay/message_log.hpp"

namespace locfuse {

/// How a localization on a map went.
struct LocalizeRun {
  struct Step {             // after a scan
    PoseEstimate estimate;  ///< of the likeliest hypothesis
    double probability;     ///< of that hypothesis
    double explained;       ///< share of the scan's returns that end at a wall
    int particles;
    bool ready;
    double sigma;  ///< of all particles, in their worst direction [m]
    HealthReport health;
  };
  std::vector<Outcome> outcomes;       ///< per message, in order of arrival
  std::vector<Outcome> scan_outcomes;  ///< per scan
  std::vector<Step> steps;             ///< of distinct and increasing stamps; none of stale scans
};

/// Hears how many messages and scans are done, and what is recorded so far: of that only the last
/// step can still change, where the next scan falls on its stamp.
using LocalizeProgress = std::function<void(std::size_t, const LocalizeRun&)>;

/// Feeds a log and scans to an Mcl in order of the stamps at which they take effect; at equal
/// stamps messages come before scans, and both as they arrived. So a late message is used where it
/// belongs, however late. `progress` is called after each scan and may look at the Mcl; the outcome
/// of what is not done yet is a default one.
[[nodiscard]] LocalizeRun localize(Mcl& mcl, const MessageLog& log,
                                   const std::vector<LaserScan>& scans,
                                   const LocalizeProgress& progress = {});
/// Likewise; the estimator's `injections` tell when UWB took over.
[[nodiscard]] LocalizeRun localize(SwitchingMcl& mcl, const MessageLog& log,
                                   const std::vector<LaserScan>& scans,
                                   const LocalizeProgress& progress = {});

}  // namespace locfuse
