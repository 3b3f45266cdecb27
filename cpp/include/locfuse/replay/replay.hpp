// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <unordered_set>
#include <utility>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/message_log.hpp"
#include "locfuse/replay/timeline.hpp"

namespace locfuse {

/// Results of a replay, complete or so far.
struct RunLog {
  std::vector<Outcome> outcomes;        ///< per message in order of arrival, after the last rewind
  std::vector<PoseEstimate> estimates;  ///< per distinct stamp, as known when time moved on
  std::vector<AirEstimate> in_space;    ///< of an AirEkf: the same with heights, else empty
  PoseEstimate last;                    ///< at the end
  std::vector<CalibratedError> errors;  ///< calibrated errors of a PoseEkf, at the end
  AdaptiveNoise adaptive{{}};           ///< variance factors of a PoseEkf, at the end
  std::vector<LandmarkEstimate> landmarks;  ///< the map of a LandmarkEkf, at the end
  std::vector<HealthReport> health;         ///< of a RecoveringEkf, ten per second
  std::vector<WatchReport> watched;         ///< with each of those, where it watches poses
  std::vector<SourceStatus> sources;        ///< of a RecoveringEkf, at the end
  int alarms = 0;                           ///< how often a RecoveringEkf was lost
  int restarts = 0;                         ///< how often it then relocalized elsewhere
  std::size_t jumps = 0;             ///< of the clock; estimates and health are from the last on
  std::size_t dropped_messages = 0;  ///< see Timeline
};

/// Switches a source off or on before the messages that arrive from `arrival` [ns] on.
struct SourceSwitch {
  Stamp arrival = 0;
  Source source = Source::kOdometry;
  bool enabled = false;
};

struct ReplayOptions {
  Stamp history = 2'000'000'000;  ///< how late a message may be [ns]
  bool record = true;             ///< keep outcomes, estimates and health, or only the end
  /// Called every 16384 messages with the number of messages done and the results so far. Late
  /// messages may still change outcomes; only a clock jump changes estimates.
  std::function<void(std::size_t, const RunLog&)> progress;
  /// Messages that take effect up to this stamp were used for the start and stay kIgnored [ns].
  Stamp used_until = std::numeric_limits<Stamp>::min();
  TimelineOptions timeline = {};
  std::vector<SourceSwitch> switches = {};  ///< sorted by arrival
};

namespace internal {

inline void check_started(const PoseEkf& /*ekf*/) {}
inline void check_started(const RecoveringEkf& ekf) {
  if (!ekf.has_started()) {
    throw std::invalid_argument("the RecoveringEkf has not started; replay needs start_at before");
  }
}

/// The stamp of an estimator's `current`.
inline Stamp stamp_of_current(const PoseEkf& ekf) { return ekf.belief().stamp; }
inline Stamp stamp_of_current(const RecoveringEkf& ekf) { return ekf.stamp(); }

inline void keep_health(RunLog& /*run*/, const PoseEkf& /*ekf*/) {}
inline void keep_health(RunLog& run, const RecoveringEkf& ekf) {
  if (run.health.empty() || ekf.stamp() - run.health.back().stamp >= RecoveringEkf::kReportEvery) {
    run.health.push_back(ekf.health());
    if (const std::optional<WatchReport> watched = ekf.watched()) {
      run.watched.push_back(*watched);
    }
  }
}

/// The last word of a run that ends while nothing is fused.
inline void keep_last_health(RunLog& /*run*/, const PoseEkf& /*ekf*/) {}
inline void keep_last_health(RunLog& run, const RecoveringEkf& ekf) {
  if (ekf.stamp() > ekf.belief().stamp) {
    keep_health(run, ekf);
  }
}

inline void keep_learnt(RunLog& run, const PoseEkf& ekf) {
  run.errors = ekf.errors();
  run.adaptive = ekf.adaptive();
}
inline void keep_learnt(RunLog& run, const LandmarkEkf& ekf) { run.landmarks = ekf.landmarks(); }
inline void keep_learnt(RunLog& /*run*/, const TagTriangleEkf& /*ekf*/) {}
inline void keep_learnt(RunLog& /*run*/, const AirEkf& /*ekf*/) {}
inline void keep_learnt(RunLog& run, const RecoveringEkf& ekf) {
  std::visit([&](const auto& tracker) { keep_learnt(run, tracker); }, *ekf.tracker());
  run.sources = ekf.sources();
  run.alarms = ekf.alarms();
  run.restarts = ekf.restarts();
}

/// Whether an estimator may know a height.
template <class Estimator>
constexpr bool kMayBeInSpace = std::is_same_v<Estimator, RecoveringEkf>;

/// Whether both are sightings, of one stamp.
inline bool are_seen_together(const Message& message, const Message& next) {
  return std::holds_alternative<RangeBearing>(message) &&
         std::holds_alternative<RangeBearing>(next) && stamp_of(message) == stamp_of(next);
}

/// Records what a Timeline does with a log.
template <class Estimator>
class RunRecorder {
 public:
  RunRecorder(const Timeline<Estimator>& timeline, bool record, std::size_t messages)
      : timeline_(timeline), record_(record) {
    check_started(estimator());
    if (record) {
      run_.outcomes.reserve(messages);
      run_.estimates.reserve(messages + 1);
      positions_.reserve(messages);
    }
  }

  /// The next messages of the log: kIgnored until an outcome is set.
  void add_messages(std::size_t count) {
    if (record_) {
      run_.outcomes.resize(run_.outcomes.size() + count);
    }
  }
  /// The timeline receives the message of that place in the log next: the estimate so far is final
  /// if time moves on.
  void before(const Message& message, std::size_t place) {
    if (record_) {
      positions_.push_back(place);
      if (!internal::watches(estimator(), message) &&
          effective_stamp(message) > stamp_of_current(estimator())) {
        keep_current();
        keep_health(run_, estimator());
      }
    }
  }
  /// The outcome of a message, by its place among those that the timeline received.
  void set_outcome(std::size_t index, const Outcome& outcome) {
    if (record_) {
      run_.outcomes[positions_[index]] = outcome;
    }
  }
  /// After a clock jump what was recorded before has stamps of another time.
  void after() {
    if (timeline_.jumps() > run_.jumps) {
      run_.jumps = timeline_.jumps();
      run_.estimates.clear();
      run_.in_space.clear();
      run_.health.clear();
      run_.watched.clear();
    }
  }
  /// The results so far.
  const RunLog& update() {
    run_.last = estimator().estimate();
    run_.dropped_messages = timeline_.dropped_messages();
    keep_learnt(run_, estimator());
    return run_;
  }
  [[nodiscard]] RunLog finish() {
    update();
    if (record_) {
      keep_current();
      keep_last_health(run_, estimator());
      if (keep(run_.last)) {
        if constexpr (kMayBeInSpace<Estimator>) {
          keep_in_space(estimator().estimate_in_space());
        }
      }
    }
    return std::move(run_);
  }

 private:
  [[nodiscard]] const Estimator& estimator() const { return timeline_.estimator(); }
  void keep_current() {
    if (keep(estimator().current())) {
      if constexpr (kMayBeInSpace<Estimator>) {
        keep_in_space(estimator().current_in_space());
      }
    }
  }
  bool keep(const PoseEstimate& estimate) {
    const bool is_new = run_.estimates.empty() || estimate.stamp > run_.estimates.back().stamp;
    if (is_new) {
      run_.estimates.push_back(estimate);
    }
    return is_new;
  }
  void keep_in_space(const std::optional<AirEstimate>& estimate) {
    if (estimate) {
      run_.in_space.push_back(*estimate);
    }
  }

  const Timeline<Estimator>& timeline_;
  bool record_;
  RunLog run_;
  std::vector<std::size_t> positions_;  // in the log, of the messages that the timeline received
};

/// The made motions that were used for a start, up to a stamp.
class UsedMotions {
 public:
  explicit UsedMotions(Stamp until) : until_(until) {}

  /// Leaves out those that take effect up to the stamp, and their places in the log. One that is
  /// made again and begins later, in place of one that was left out, is a motion of its own.
  void leave_out(std::vector<MadeMotion>& motions, std::vector<std::size_t>& places) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < motions.size(); ++k) {
      MadeMotion& motion = motions[k];
      motion.again = motion.again && origins_.count(motion.origin) == 0;
      if (motion.increment.begin <= until_) {
        origins_.insert(motion.origin);
      } else {
        origins_.erase(motion.origin);
        motions[kept] = motion;
        places[kept++] = places[k];
      }
    }
    if (!motions.empty()) {
      motions.resize(kept);
      places.resize(kept);
    }
  }

 private:
  Stamp until_;
  std::unordered_set<std::size_t> origins_;
};

/// Those of the messages of a log from `begin` on that arrive together and take effect together, in
/// the order of `precedes`, which a Timeline would otherwise put them in one by one. Where they are
/// more than it puts in order they stay as they are.
template <class Estimator>
void take_together(const std::vector<MessageLog::Arrival>& arrivals, std::size_t begin,
                   std::vector<std::size_t>& together) {
  const auto& first = arrivals[begin];
  const Stamp effective = effective_stamp(first.message);
  together.assign(1, begin);
  for (std::size_t i = begin + 1; i < arrivals.size() && arrivals[i].arrival == first.arrival &&
                                  origin_of(arrivals[i].message) == Increment::kNoOrigin &&
                                  effective_stamp(arrivals[i].message) == effective;
       ++i) {
    together.push_back(i);
  }
  if (together.size() > MessageHistory<Estimator>::kMaxOfInstant) {
    return;
  }
  const auto before = [&](std::size_t a, std::size_t b) {
    return precedes(arrivals[a].message, arrivals[b].message);
  };
  for (auto next = together.begin() + 1; next != together.end(); ++next) {  // allocates nothing
    if (before(*next, *(next - 1))) {
      std::rotate(std::upper_bound(together.begin(), next, *next, before), next, next + 1);
    }
  }
}

}  // namespace internal

/// Feeds a log, sorted by arrival, to an estimator through a Timeline; what arrives together and is
/// of one stamp in the order of `precedes`. The same input gives the same bits.
template <class Estimator>
[[nodiscard]] RunLog replay(const Estimator& start, const MessageLog& log,
                            const ReplayOptions& options) {
  constexpr std::size_t kProgressEvery = 1U << 14U;
  const std::vector<MessageLog::Arrival>& arrivals = log.arrivals();
  Timeline<Estimator> timeline(start, options.history, options.timeline);
  internal::RunRecorder<Estimator> recorder(timeline, options.record, arrivals.size());
  const auto sink = [&](std::size_t index, const Outcome& outcome) {
    recorder.set_outcome(index, outcome);
  };
  auto next_switch = options.switches.begin();
  std::vector<std::size_t> together;
  internal::UsedMotions used(options.used_until);
  for (std::size_t begin = 0, done = 0; begin < arrivals.size(); begin = done) {
    std::vector<MadeMotion> made = log.motions_from(begin);
    const bool is_made = !made.empty();
    if (is_made) {
      together.resize(made.size());
      std::iota(together.begin(), together.end(), begin);
    } else {
      internal::take_together<Estimator>(arrivals, begin, together);
    }
    recorder.add_messages(together.size());
    done += together.size();
    used.leave_out(made, together);
    if (is_made ? made.empty() : effective_stamp(arrivals[begin].message) <= options.used_until) {
      continue;
    }
    for (; next_switch != options.switches.end() && next_switch->arrival <= arrivals[begin].arrival;
         ++next_switch) {
      timeline.enable(next_switch->source, next_switch->enabled);
    }
    for (std::size_t k = 0; k < made.size(); ++k) {
      recorder.before(made[k].increment, together[k]);
    }
    if (is_made) {
      timeline.on(made, sink);
      recorder.after();
    }
    for (std::size_t k = 0; k < together.size() && !is_made; ++k) {
      const Message& message = arrivals[together[k]].message;
      recorder.before(message, together[k]);
      const bool may_wait = k + 1 < together.size() &&
                            internal::are_seen_together(message, arrivals[together[k + 1]].message);
      timeline.on(message, sink, may_wait);
      recorder.after();
    }
    if (options.progress && done / kProgressEvery > begin / kProgressEvery) {
      options.progress(done, recorder.update());
    }
  }
  return recorder.finish();
}

}  // namespace locfuse
