// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "locfuse/estimators/mcl.hpp"
#include "locfuse/estimators/switching_mcl.hpp"
#include "locfuse/replay/message_log.hpp"

namespace locfuse {

/// Results of a localization on a map.
struct LocalizeRun {
  struct Step {             ///< after a scan
    PoseEstimate estimate;  ///< likeliest hypothesis
    double probability;     ///< of that hypothesis
    double explained;       ///< share of the scan's returns that a wall explains
    int particles;
    bool ready;
    double sigma;  ///< of all particles, largest half axis of their ellipse [m]
    HealthReport health;
  };
  std::vector<Outcome> outcomes;       ///< per message, in order of arrival
  std::vector<Outcome> scan_outcomes;  ///< per scan
  std::vector<Step> steps;             ///< at increasing stamps; none for stale scans
};

/// Receives the number of messages and scans done and the results so far, of which only the last
/// step may still change, if the next scan has the same stamp.
using LocalizeProgress = std::function<void(std::size_t, const LocalizeRun&)>;

/// Feeds a log and scans to an Mcl in order of effective stamps; at equal stamps messages come
/// before scans, each in order of arrival. So late messages are fused where they belong, however
/// late. `progress` is called after each scan and may read the Mcl; outcomes still to come are
/// default ones.
[[nodiscard]] LocalizeRun localize(Mcl& mcl, const MessageLog& log,
                                   const std::vector<LaserScan>& scans,
                                   const LocalizeProgress& progress = {});
/// The same; the estimator's `injections` show when UWB took over.
[[nodiscard]] LocalizeRun localize(SwitchingMcl& mcl, const MessageLog& log,
                                   const std::vector<LaserScan>& scans,
                                   const LocalizeProgress& progress = {});

}  // namespace locfuse
