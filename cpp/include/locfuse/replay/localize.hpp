// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "locfuse/replay/live_mcl.hpp"
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
    std::optional<WatchReport> watched;  ///< where it watches poses
  };
  /// A pose after the turn of a scan, as a robot has it.
  struct Report {
    Stamp arrival;  ///< of the message that gave the scan its turn; kAtEnd if the log ended first
    PoseEstimate estimate;
    bool ready;
  };
  static constexpr Stamp kAtEnd = std::numeric_limits<Stamp>::max();
  std::vector<Outcome> outcomes;       ///< per message, in order of arrival
  std::vector<Outcome> scan_outcomes;  ///< per scan
  std::vector<Step> steps;      ///< at increasing stamps, as known then; none for stale scans
  std::vector<Report> reports;  ///< for each scan that is not stale, in order of turns
};

/// Receives the number of messages and scans that have had their turn and the results so far, of
/// which late messages may still change outcomes, and the next scan the last step.
using LocalizeProgress = std::function<void(std::size_t, const LocalizeRun&)>;

/// Feeds a log and scans to an Mcl in order of arrival, as they would come live: the same messages
/// give the same bits. At equal arrivals messages come before scans. `scan_arrivals` [ns] are those
/// of the scans, or none where they arrive at their stamps. `progress` is called after each scan
/// and may read the Mcl; outcomes still to come are default ones. Throws std::invalid_argument
/// unless there are as many arrivals as scans, or none.
[[nodiscard]] LocalizeRun localize(LiveMcl& mcl, const MessageLog& log,
                                   const std::vector<LaserScan>& scans,
                                   const std::vector<Stamp>& scan_arrivals = {},
                                   const LocalizeProgress& progress = {});

}  // namespace locfuse
