// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/start.hpp"

namespace locfuse {
namespace {

/// Odometry alone never makes a start ready, and asking costs time.
bool may_decide(const Message& message) {
  return !std::holds_alternative<Velocity>(message) && !std::holds_alternative<Increment>(message);
}

}  // namespace

StartRun find_start(Initializer& initializer, const MessageLog& log,
                    const std::vector<LaserScan>& scans) {
  const std::vector<MessageLog::Arrival>& arrivals = log.arrivals();
  StartRun run;
  const auto is_ready = [&](Stamp stamp) {
    const Initializer::State state = initializer.state();
    if (run.steps.empty() || run.steps.back().state.status != state.status ||
        run.steps.back().state.hypotheses.size() != state.hypotheses.size()) {
      run.steps.push_back({stamp, state});
    }
    return state.status == StartStatus::kReady;
  };
  std::size_t scan = 0;
  while (run.consumed < arrivals.size() || scan < scans.size()) {
    const bool takes_message =
        scan == scans.size() ||
        (run.consumed < arrivals.size() && arrivals[run.consumed].arrival <= scans[scan].stamp);
    if (!takes_message) {
      initializer.on(scans[scan]);
      if (is_ready(scans[scan++].stamp)) {
        break;
      }
      continue;
    }
    const MessageLog::Arrival& now = arrivals[run.consumed++];
    initializer.on(now.message);
    // What arrives at one instant belongs together: decide when all of it has been heard.
    const bool is_last =
        run.consumed == arrivals.size() || arrivals[run.consumed].arrival != now.arrival;
    if (is_last && may_decide(now.message) && is_ready(now.arrival)) {
      break;
    }
  }
  return run;
}

}  // namespace locfuse
