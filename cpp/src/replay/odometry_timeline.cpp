// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/odometry_timeline.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace locfuse {
namespace {

constexpr std::size_t kMinForgotten = 256;   // motions that are forgotten at a time
constexpr std::size_t kMaxWaiting = 10'000;  // of what only helps
constexpr Stamp kFarAhead = internal::ClockJumpDetector::kFarAhead;
constexpr Stamp kMaxSampleAhead = 2'000'000'000;  // of the newest motion [ns]

TimelineOptions anew_after_a_jump(TimelineOptions options) {
  if (options.clock_jump == ClockJump::kContinue) {
    options.clock_jump = ClockJump::kReset;
  }
  return options;
}

bool are_same(const Increment& a, const Increment& b) {
  return a.begin == b.begin && a.stamp == b.stamp && a.motion.x == b.motion.x &&
         a.motion.y == b.motion.y && a.motion.heading == b.motion.heading &&
         a.variance == b.variance;
}

}  // namespace

OdometryTimeline::OdometryTimeline(const Odometer& odometer, Stamp history, TimelineOptions options)
    : timeline_(odometer, history, anew_after_a_jump(options)), history_(history) {}

const std::vector<MadeMotion>& OdometryTimeline::on(const Message& message) {
  changed_.clear();
  outcome_ = {};
  const Entry entry{stamp_of(message), arrivals_++, message};
  const Stamp newest = timeline_.newest();
  const bool is_first = newest == std::numeric_limits<Stamp>::min();
  if (timeline_.estimator().leads(message)) {
    if (is_first || entry.stamp <= newest + kFarAhead || do_wheels_reach(entry.stamp)) {
      take_helpers(entry.stamp);
    }
    feed(entry);
  } else if (is_first || entry.stamp > newest) {
    help(entry);
  } else if (entry.stamp < newest - history_) {
    outcome_ = {Verdict::kStale, Reason::kTooLate};
  } else {
    feed(entry);
  }
  forget_old();
  return changed_;
}

/// Keeps what only helps until its turn; no sample of a gyro that is far ahead of all motions.
void OdometryTimeline::help(const Entry& entry) {
  validate_in_space(entry.message);
  const Source source = source_of(entry.message);
  const bool has_motions = timeline_.newest() != std::numeric_limits<Stamp>::min();
  if (source != Source::kImu && source != Source::kOdometry) {
    outcome_ = {Verdict::kIgnored, Reason::kNotUsed};
  } else if (source == Source::kImu && has_motions &&
             entry.stamp > timeline_.newest() + kMaxSampleAhead) {
    outcome_ = {Verdict::kIgnored, Reason::kTooFarAhead};
  } else {
    outcome_ = {Verdict::kIgnored, Reason::kWaits};
    std::vector<Entry>& waiting = source == Source::kImu ? samples_ : wheels_;
    if (waiting.size() >= kMaxWaiting) {
      waiting.erase(waiting.begin(), waiting.begin() + kMaxWaiting / 4);
    }
    const auto earlier = [](const Entry& a, const Entry& b) { return a.stamp < b.stamp; };
    waiting.insert(std::upper_bound(waiting.begin(), waiting.end(), entry, earlier), entry);
  }
}

/// Whether wheels that wait have come as far as a scan: then nobody's clock is wrong.
bool OdometryTimeline::do_wheels_reach(Stamp stamp) const {
  return std::any_of(wheels_.rbegin(), wheels_.rend(), [&](const Entry& e) {
    return e.stamp <= stamp && e.stamp >= stamp - kFarAhead;
  });
}

/// Gives those that wait their turn, up to a stamp; those from long before are of another clock.
void OdometryTimeline::take_helpers(Stamp until) {
  const Stamp newest = timeline_.newest();
  const Stamp oldest =
      newest == std::numeric_limits<Stamp>::min() ? until - kFarAhead : newest - history_;
  const auto end_of = [&](const std::vector<Entry>& waiting) {
    return std::find_if(waiting.begin(), waiting.end(),
                        [&](const Entry& e) { return e.stamp > until; });
  };
  const auto samples = end_of(samples_);
  const auto wheels = end_of(wheels_);
  auto sample = samples_.cbegin();
  auto wheel = wheels_.cbegin();
  while (sample != samples || wheel != wheels) {
    const bool is_sample = wheel == wheels || (sample != samples && sample->stamp <= wheel->stamp);
    const Entry& next = is_sample ? *sample++ : *wheel++;
    if (next.stamp < oldest) {
      continue;
    }
    try {
      feed(next);
    } catch (const std::invalid_argument&) {  // skipped: its caller has returned
    }
  }
  samples_.erase(samples_.cbegin(), samples);
  wheels_.erase(wheels_.cbegin(), wheels);
}

void OdometryTimeline::feed(const Entry& entry) {
  timeline_.on(entry.index, entry.message, [&](std::size_t index, const Outcome& outcome) {
    if (index + 1 == arrivals_) {
      outcome_ = outcome;
    }
    if (outcome.verdict == Verdict::kFused) {
      note(index);
    }
  });
}

/// Notes the motion that the odometer has just made, unless it is what it was. One that it makes no
/// more becomes one of no duration.
void OdometryTimeline::note(std::size_t origin) {
  if (timeline_.jumps() > jumps_) {
    jumps_ = timeline_.jumps();
    made_.clear();
    samples_.clear();
    wheels_.clear();
  }
  const auto place = std::lower_bound(
      made_.begin(), made_.end(), origin,
      [](const MadeMotion& before, std::size_t number) { return before.origin < number; });
  const bool is_known = place != made_.end() && place->origin == origin;
  MadeMotion made;
  made.origin = origin;
  if (const auto& motion = timeline_.estimator().made()) {
    made.slipped = motion->verdict == GyroOdometry::Verdict::kSlipped;
    made.increment = motion->increment;
  } else if (is_known) {
    made.increment.begin = made.increment.stamp = place->increment.stamp;
  } else {
    return;
  }
  if (!is_known) {
    made_.insert(place, made);
    changed_.push_back(made);
  } else if (!are_same(place->increment, made.increment) || place->slipped != made.slipped) {
    *place = made;
    change(made);
  }
}

/// Says that a motion was made again, once.
void OdometryTimeline::change(const MadeMotion& made) {
  const auto said = std::find_if(changed_.begin(), changed_.end(),
                                 [&](const MadeMotion& m) { return m.origin == made.origin; });
  if (said == changed_.end()) {
    changed_.push_back(made);
    changed_.back().again = true;
    return;
  }
  said->increment = made.increment;
  said->slipped = made.slipped;
}

/// Forgets what no message in the history can change any more.
void OdometryTimeline::forget_old() {
  if (made_.size() < 2 * kMinForgotten) {
    return;
  }
  const Stamp horizon = timeline_.newest() - history_;
  const auto first = std::find_if(made_.begin(), made_.end(), [&](const MadeMotion& made) {
    return made.increment.stamp >= horizon;
  });
  if (first - made_.begin() >= static_cast<std::ptrdiff_t>(kMinForgotten)) {
    made_.erase(made_.begin(), first);
  }
}

std::vector<ArrivedMotion> odometry_of(OdometryTimeline& timeline, const MessageLog& log) {
  std::vector<ArrivedMotion> motions;
  for (const MessageLog::Arrival& arrival : log.arrivals()) {
    for (const MadeMotion& made : timeline.on(arrival.message)) {
      motions.push_back({arrival.arrival, made});
    }
  }
  return motions;
}

}  // namespace locfuse
