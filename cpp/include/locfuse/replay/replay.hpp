// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/replay/message_log.hpp"
#include "locfuse/replay/timeline.hpp"

namespace locfuse {

/// What a replay leaves behind.
struct RunLog {
  std::vector<Outcome> outcomes;        ///< per message in order of arrival, after the last rewind
  std::vector<PoseEstimate> estimates;  ///< per distinct stamp, as known when time moved on
  PoseEstimate last;                    ///< at the end of the log
  std::vector<CalibratedError> errors;  ///< learnt by then
};

struct ReplayOptions {
  Stamp history = 2'000'000'000;              ///< how late a message may be [ns]
  bool record = true;                         ///< keep outcomes and estimates, or only `last`
  std::function<void(std::size_t)> progress;  ///< called with the number of messages done
  std::size_t first = 0;                      ///< messages before it were used for the start
};

/// Feeds a sorted log to an estimator through a Timeline. The same input gives the same bits.
/// Messages before `options.first` keep the verdict kIgnored.
template <class Estimator>
[[nodiscard]] RunLog replay(const Estimator& start, const MessageLog& log,
                            const ReplayOptions& options) {
  constexpr std::size_t kProgressEvery = 1U << 14U;
  RunLog run;
  Timeline<Estimator> timeline(start, options.history);
  const std::vector<MessageLog::Arrival>& arrivals = log.arrivals();
  if (options.record) {
    run.outcomes.resize(arrivals.size());
    run.estimates.reserve(arrivals.size() + 1);
  }
  const auto keep = [&](const PoseEstimate& estimate) {
    if (run.estimates.empty() || estimate.stamp > run.estimates.back().stamp) {
      run.estimates.push_back(estimate);
    }
  };
  const auto sink = [&](std::size_t index, const Outcome& outcome) {
    if (options.record) {
      run.outcomes[options.first + index] = outcome;
    }
  };
  for (std::size_t i = options.first; i < arrivals.size(); ++i) {
    const Message& message = arrivals[i].message;
    if (options.record && effective_stamp(message) > timeline.estimator().belief().stamp) {
      keep(timeline.estimator().current());
    }
    timeline.on(message, sink);
    if (options.progress && (i + 1) % kProgressEvery == 0) {
      options.progress(i + 1);
    }
  }
  run.last = timeline.estimator().estimate();
  run.errors = timeline.estimator().errors();
  if (options.record) {
    keep(timeline.estimator().current());
    keep(run.last);
  }
  return run;
}

}  // namespace locfuse
