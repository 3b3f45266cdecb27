// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/localize.hpp"

#include <algorithm>
#include <numeric>

namespace locfuse {
namespace {

/// Indices 0 to count - 1 by stamp; those of one stamp keep their order.
template <class StampOf>
std::vector<std::size_t> by_stamp(std::size_t count, const StampOf& stamp_of) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return stamp_of(a) < stamp_of(b); });
  return order;
}

LocalizeRun::Step step_of(const Mcl& mcl) {
  return {
      mcl.estimate(), mcl.hypotheses().front().probability,    mcl.explained(), mcl.belief().size,
      mcl.ready(),    mcl.overall_estimate().sigma_position(), mcl.health()};
}

LocalizeRun::Step step_of(const SwitchingMcl& switching) { return step_of(switching.mcl()); }

/// Replaces a step of the same stamp: where odometry is slower than scans, several are carried to
/// its end.
void keep(std::vector<LocalizeRun::Step>& steps, const LocalizeRun::Step& step) {
  while (!steps.empty() && steps.back().estimate.stamp >= step.estimate.stamp) {
    steps.pop_back();
  }
  steps.push_back(step);
}

template <class Estimator>
LocalizeRun run_through(Estimator& mcl, const MessageLog& log, const std::vector<LaserScan>& scans,
                        const LocalizeProgress& progress) {
  const std::vector<MessageLog::Arrival>& arrivals = log.arrivals();
  const auto effective = [&](std::size_t i) { return effective_stamp(arrivals[i].message); };
  const std::vector<std::size_t> messages = by_stamp(arrivals.size(), effective);
  LocalizeRun run;
  run.outcomes.resize(arrivals.size());
  run.scan_outcomes.resize(scans.size());
  std::size_t next = 0;
  const auto feed_until = [&](const auto& is_due) {
    for (; next < messages.size() && is_due(effective(messages[next])); ++next) {
      run.outcomes[messages[next]] = std::visit(
          [&](const auto& message) { return mcl.on(message); }, arrivals[messages[next]].message);
    }
  };
  std::size_t scans_done = 0;
  for (const std::size_t i :
       by_stamp(scans.size(), [&](std::size_t k) { return scans[k].stamp; })) {
    feed_until([&](Stamp stamp) { return stamp <= scans[i].stamp; });
    run.scan_outcomes[i] = mcl.on(scans[i]);
    if (run.scan_outcomes[i].verdict != Verdict::kStale) {
      keep(run.steps, step_of(mcl));
    }
    ++scans_done;
    if (progress) {
      progress(next + scans_done, run);
    }
  }
  feed_until([](Stamp) { return true; });
  return run;
}

}  // namespace

LocalizeRun localize(Mcl& mcl, const MessageLog& log, const std::vector<LaserScan>& scans,
                     const LocalizeProgress& progress) {
  return run_through(mcl, log, scans, progress);
}

LocalizeRun localize(SwitchingMcl& mcl, const MessageLog& log, const std::vector<LaserScan>& scans,
                     const LocalizeProgress& progress) {
  return run_through(mcl, log, scans, progress);
}

}  // namespace locfuse
