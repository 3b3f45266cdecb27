// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/localize.hpp"

#include <algorithm>
#include <iterator>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

namespace locfuse {
namespace {

/// Indices of scans by arrival; those of one arrival keep their order.
std::vector<std::size_t> by_arrival(const std::vector<Stamp>& arrivals) {
  std::vector<std::size_t> order(arrivals.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return arrivals[a] < arrivals[b]; });
  return order;
}

std::vector<Stamp> arrivals_of(const std::vector<LaserScan>& scans,
                               const std::vector<Stamp>& scan_arrivals) {
  if (!scan_arrivals.empty() && scan_arrivals.size() != scans.size()) {
    throw std::invalid_argument("there are " + std::to_string(scan_arrivals.size()) +
                                " scan_arrivals, expected none or one for each of the " +
                                std::to_string(scans.size()) + " scans");
  }
  std::vector<Stamp> arrivals = scan_arrivals;
  if (arrivals.empty()) {
    std::transform(scans.begin(), scans.end(), std::back_inserter(arrivals),
                   [](const LaserScan& scan) { return scan.stamp; });
  }
  return arrivals;
}

LocalizeRun::Step step_of(const Mcl& mcl) {
  return {
      mcl.estimate(), mcl.hypotheses().front().probability,    mcl.explained(), mcl.belief().size,
      mcl.ready(),    mcl.overall_estimate().sigma_position(), mcl.health(),    mcl.watched()};
}

/// Replaces a step of the same stamp: where odometry is slower than scans, several are carried to
/// its end.
void keep(std::vector<LocalizeRun::Step>& steps, const LocalizeRun::Step& step) {
  while (!steps.empty() && steps.back().estimate.stamp >= step.estimate.stamp) {
    steps.pop_back();
  }
  steps.push_back(step);
}

}  // namespace

LocalizeRun localize(LiveMcl& mcl, const MessageLog& log, const std::vector<LaserScan>& scans,
                     const std::vector<Stamp>& scan_arrivals, const LocalizeProgress& progress) {
  const std::vector<MessageLog::Arrival>& messages = log.arrivals();
  const std::vector<Stamp> arrivals = arrivals_of(scans, scan_arrivals);
  LocalizeRun run;
  run.outcomes.resize(messages.size());
  run.scan_outcomes.resize(scans.size());
  const std::size_t first = mcl.arrivals();
  std::vector<Outcome*> outcomes;  // in order of arrival
  outcomes.reserve(messages.size() + scans.size());

  LiveMcl::Observer observer;
  observer.fused = [&](std::size_t index, const Outcome& outcome) {
    if (index >= first) {
      *outcomes[index - first] = outcome;
    }
  };
  observer.scanned = [&](const LaserScan& /*scan*/, const Outcome& outcome) {
    if (outcome.verdict != Verdict::kStale) {
      keep(run.steps, step_of(mcl.mcl()));
      run.reports.push_back({LocalizeRun::kAtEnd, run.steps.back().estimate, false});
    }
    if (progress) {
      progress(outcomes.size() - std::min(mcl.waiting(), outcomes.size()), run);
    }
  };
  std::size_t reported = 0;
  const auto arrived = [&](Stamp arrival) {
    for (; reported < run.reports.size(); ++reported) {
      run.reports[reported].arrival = arrival;
      run.reports[reported].ready = mcl.mcl().ready();
    }
  };
  std::size_t next = 0;
  const auto feed_until = [&](Stamp arrival) {
    while (next < messages.size() && messages[next].arrival <= arrival) {
      const std::vector<MadeMotion> made = log.motions_from(next);
      const std::size_t end = next + std::max<std::size_t>(1, made.size());
      for (std::size_t i = next; i < end; ++i) {
        outcomes.push_back(&run.outcomes[i]);
      }
      if (made.empty()) {
        mcl.on(messages[next].message, observer);
      } else {
        mcl.on(made, observer);
      }
      arrived(messages[next].arrival);
      next = end;
    }
  };
  for (const std::size_t i : by_arrival(arrivals)) {
    feed_until(arrivals[i]);
    outcomes.push_back(&run.scan_outcomes[i]);
    mcl.on(scans[i], observer);
    arrived(arrivals[i]);
  }
  feed_until(std::numeric_limits<Stamp>::max());
  mcl.finish(observer);
  arrived(LocalizeRun::kAtEnd);
  return run;
}

}  // namespace locfuse
