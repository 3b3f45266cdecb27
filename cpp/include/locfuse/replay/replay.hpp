// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <limits>
#include <stdexcept>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/estimators/recovering_ekf.hpp"
#include "locfuse/replay/message_log.hpp"
#include "locfuse/replay/timeline.hpp"

namespace locfuse {

/// What a replay leaves behind, or has recorded so far.
struct RunLog {
  std::vector<Outcome> outcomes;        ///< per message in order of arrival, after the last rewind
  std::vector<PoseEstimate> estimates;  ///< per distinct stamp, as known when time moved on
  PoseEstimate last;                    ///< at the end of the log, or of what is done
  std::vector<CalibratedError> errors;  ///< learnt by then
  AdaptiveNoise adaptive{{}};           ///< factors of variances by then
  std::vector<HealthReport> health;     ///< of a RecoveringEkf, ten times a second
  std::vector<SourceStatus> sources;    ///< likewise, at the end of the log
  int alarms = 0;                       ///< likewise: how often it was lost
  int restarts = 0;                     ///< likewise: how often it then found another place
  std::size_t jumps = 0;       ///< of the clock; estimates and health are of after the last
  std::size_t fallen_out = 0;  ///< as of Timeline
};

/// A source is switched off or on before the messages that arrive from `arrival` on.
struct SourceSwitch {
  Stamp arrival = 0;
  Source source = Source::kOdometry;
  bool enabled = false;
};

struct ReplayOptions {
  Stamp history = 2'000'000'000;  ///< how late a message may be [ns]
  bool record = true;             ///< keep outcomes and estimates, or only `last`
  /// Called now and then with the number of messages done and what is recorded so far: outcomes of
  /// those messages, which late ones may still change, and estimates, which nothing changes but a
  /// jump of the clock.
  std::function<void(std::size_t, const RunLog&)> progress;
  /// Messages that take effect up to this stamp were used for the start.
  Stamp used_until = std::numeric_limits<Stamp>::min();
  TimelineOptions timeline = {};
  std::vector<SourceSwitch> switches = {};  ///< sorted by arrival
};

namespace internal {

inline const PoseEkf& tracker_of(const PoseEkf& ekf) { return ekf; }
inline const PoseEkf& tracker_of(const RecoveringEkf& ekf) {
  if (ekf.estimator() == nullptr) {
    throw std::invalid_argument("the RecoveringEkf has not started; replay needs start_at before");
  }
  return *ekf.estimator();
}

inline void keep_health(RunLog& /*run*/, const PoseEkf& /*ekf*/) {}
inline void keep_health(RunLog& run, const RecoveringEkf& ekf) {
  constexpr Stamp kEvery = 100'000'000;
  if (run.health.empty() || ekf.estimator()->belief().stamp - run.health.back().stamp >= kEvery) {
    run.health.push_back(ekf.health());
  }
}

inline void keep_sources(RunLog& /*run*/, const PoseEkf& /*ekf*/) {}
inline void keep_sources(RunLog& run, const RecoveringEkf& ekf) {
  run.sources = ekf.sources();
  run.alarms = ekf.alarms();
  run.restarts = ekf.restarts();
}

}  // namespace internal

/// Feeds a sorted log to an estimator through a Timeline. The same input gives the same bits.
/// Messages that were used for the start keep the verdict kIgnored.
template <class Estimator>
[[nodiscard]] RunLog replay(const Estimator& start, const MessageLog& log,
                            const ReplayOptions& options) {
  constexpr std::size_t kProgressEvery = 1U << 14U;
  RunLog run;
  Timeline<Estimator> timeline(start, options.history, options.timeline);
  auto switched = options.switches.begin();
  const std::vector<MessageLog::Arrival>& arrivals = log.arrivals();
  if (options.record) {
    run.outcomes.reserve(arrivals.size());
    run.estimates.reserve(arrivals.size() + 1);
  }
  const auto tracker = [&]() -> const PoseEkf& {
    return internal::tracker_of(timeline.estimator());
  };
  const auto keep = [&](const PoseEstimate& estimate) {
    if (run.estimates.empty() || estimate.stamp > run.estimates.back().stamp) {
      run.estimates.push_back(estimate);
    }
  };
  const auto take_stock = [&] {
    run.last = tracker().estimate();
    run.errors = tracker().errors();
    run.adaptive = tracker().adaptive();
    run.fallen_out = timeline.fallen_out();
    internal::keep_sources(run, timeline.estimator());
  };
  std::vector<std::size_t> delivered;  // its messages, as places among all
  delivered.reserve(options.record ? arrivals.size() : 0);
  const auto sink = [&](std::size_t index, const Outcome& outcome) {
    if (options.record) {
      run.outcomes[delivered[index]] = outcome;
    }
  };
  for (std::size_t i = 0; i < arrivals.size(); ++i) {
    const Message& message = arrivals[i].message;
    if (options.record) {
      run.outcomes.emplace_back();
    }
    if (effective_stamp(message) <= options.used_until) {
      continue;
    }
    if (options.record) {
      delivered.push_back(i);
      if (effective_stamp(message) > tracker().belief().stamp) {
        keep(tracker().current());
        internal::keep_health(run, timeline.estimator());
      }
    }
    for (; switched != options.switches.end() && switched->arrival <= arrivals[i].arrival;
         ++switched) {
      timeline.enable(switched->source, switched->enabled);
    }
    timeline.on(message, sink);
    if (timeline.jumps() > run.jumps) {
      run.jumps = timeline.jumps();
      run.estimates.clear();
      run.health.clear();
    }
    if (options.progress && (i + 1) % kProgressEvery == 0) {
      take_stock();
      options.progress(i + 1, run);
    }
  }
  take_stock();
  if (options.record) {
    keep(tracker().current());
    keep(run.last);
  }
  return run;
}

}  // namespace locfuse
