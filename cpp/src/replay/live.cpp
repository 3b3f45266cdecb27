// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/live.hpp"

#include <stdexcept>
#include <utility>

#include "locfuse/error.hpp"

namespace locfuse {

Live::Live(RecoveringEkf estimator, const Options& options)
    : initial_(std::move(estimator)),
      options_(options),
      search_(initial_.initializer(), options.patience) {
  // Throws if the options are out of range.
  const Timeline<RecoveringEkf> probe(initial_, options.history, options.timeline);
  reset();
}

Outcome Live::on(const Message& message) {
  internal::validate_for(initial_, message);
  if (disabled_[static_cast<std::size_t>(source_of(message))]) {
    return {Verdict::kIgnored, Reason::kSwitchedOff};
  }
  return search_or_track(message);
}

Outcome Live::search_or_track(const Message& message) {
  const bool is_scan = std::holds_alternative<LaserScan>(message);
  if (timeline_) {
    return is_scan ? Outcome{Verdict::kIgnored, Reason::kNotUsed} : track(message);
  }
  if (initial_.watches(message)) {
    return {Verdict::kIgnored, Reason::kNotStarted};
  }
  if (!is_scan && search_.is_late(message)) {
    const bool is_merely_late = options_.timeline.clock_jump == ClockJump::kRefuse ||
                                ++consecutive_late_ < options_.timeline.jump_after;
    if (is_merely_late) {
      return {Verdict::kStale, Reason::kTooLate};
    }
    ++jumps_;
    relocalize();
  }
  consecutive_late_ = is_scan ? consecutive_late_ : 0;
  search_.on(message);
  check_search();
  return {Verdict::kIgnored, Reason::kNotStarted};
}

Outcome Live::on(const std::vector<MadeMotion>& motions) {
  if (motions.empty()) {
    return {Verdict::kIgnored, Reason::kNone};
  }
  if (disabled_[static_cast<std::size_t>(Source::kOdometry)]) {
    return {Verdict::kIgnored, Reason::kSwitchedOff};
  }
  if (timeline_) {
    return track(motions);
  }
  if (!are_made_again(motions)) {
    Outcome outcome;
    for (const MadeMotion& motion : motions) {
      outcome = search_or_track(motion.message());
    }
    return outcome;
  }
  search_.on(motions);
  check_search();
  return {Verdict::kIgnored, Reason::kNotStarted};
}

/// Once the search is ready, the messages that wait are delivered in order of arrival. They may
/// show a clock jump: those after it belong to the next search. Refused ones are skipped, as their
/// callers have returned.
void Live::check_search() {
  if (!search_.is_ready()) {
    return;
  }
  RecoveringEkf started = initial_;
  started.start_from(search_.initializer());
  is_from_search_ = true;
  track_from(std::move(started));
  const std::vector<internal::TimelineEntry> waiting = search_.waiting();  // search_ may change
  for (const internal::TimelineEntry& entry : waiting) {
    try {
      search_or_track(entry.message);
    } catch (const std::invalid_argument&) {
    } catch (const NumericalError&) {
    }
  }
}

Outcome Live::track(const Message& message) {
  return track_by(
      1, [&](std::size_t index, const auto& sink) { timeline_->on(index, message, sink); });
}

Outcome Live::track(const std::vector<MadeMotion>& motions) {
  return track_by(motions.size(), [&](std::size_t index, const auto& sink) {
    timeline_->on(index, motions, sink);
  });
}

/// Calls the timeline with a number of messages; returns the outcome of the first.
template <class Call>
Outcome Live::track_by(std::size_t messages, const Call& call) {
  Outcome outcome{Verdict::kStale, Reason::kTooLate};
  const std::size_t first = delivered_;
  delivered_ += messages;
  try {
    call(first, [&](std::size_t index, const Outcome& fused) {
      if (index == first) {
        outcome = fused;
      }
    });
  } catch (...) {
    follow_clock();
    throw;
  }
  follow_clock();
  return outcome;
}

/// Counts clock jumps; after one, another search begins where there is no start to return to.
void Live::follow_clock() {
  if (timeline_->jumps() > timeline_jumps_) {
    timeline_jumps_ = timeline_->jumps();
    ++jumps_;
    if (is_from_search_ && options_.timeline.clock_jump == ClockJump::kReset) {
      relocalize();
    }
  }
}

void Live::track_from(RecoveringEkf estimator) {
  const std::size_t dropped_messages = this->dropped_messages();
  timeline_.emplace(std::move(estimator), options_.history, options_.timeline);
  dropped_messages_ = dropped_messages;
  delivered_ = timeline_jumps_ = 0;
}

void Live::start_at(const PoseEstimate& start) {
  RecoveringEkf started = initial_;
  started.start_at(start);
  is_from_search_ = false;
  track_from(std::move(started));
}

void Live::relocalize() {
  dropped_messages_ = dropped_messages();
  timeline_.reset();
  is_from_search_ = false;
  search_ = StartSearch(initial_.initializer(), options_.patience);
  consecutive_late_ = 0;
}

void Live::reset() {
  relocalize();
  dropped_messages_ = jumps_ = 0;
  disabled_ = {};
  if (initial_.has_started()) {
    track_from(initial_);
  }
}

void Live::enable(Source source, bool enabled) {
  disabled_[static_cast<std::size_t>(source)] = !enabled;
}

std::size_t Live::dropped_messages() const {
  return dropped_messages_ + (timeline_ ? timeline_->dropped_messages() : 0);
}

}  // namespace locfuse
