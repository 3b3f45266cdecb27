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
  // A timeline that is never fed says whether the options are good.
  const Timeline<RecoveringEkf> probe(initial_, options.history, options.timeline);
  reset();
}

Outcome Live::on(const Message& message) {
  std::visit([](const auto& m) { validate(m); }, message);
  if (disabled_[static_cast<std::size_t>(source_of(message))]) {
    return {Verdict::kIgnored};
  }
  if (timeline_) {
    return track(message);
  }
  if (search_.is_late(message)) {
    const bool waits = options_.timeline.clock_jump == ClockJump::kRefuse ||
                       ++late_in_a_row_ < options_.timeline.jump_after;
    if (waits) {
      return {Verdict::kStale};
    }
    ++jumps_;
    relocalize();
  }
  late_in_a_row_ = 0;
  search_.on(message);
  look();
  return {Verdict::kIgnored};
}

void Live::on(const LaserScan& scan) {
  validate(scan);
  if (!timeline_ && !disabled_[static_cast<std::size_t>(Source::kScans)]) {
    search_.on(scan);
    look();
  }
}

/// From a place that was found, what has waited comes in the order in which it arrived. It may tell
/// that the clock jumped: what waited after that is for the next search. What cannot be fused is
/// left out: it was taken before.
void Live::look() {
  if (!search_.is_ready()) {
    return;
  }
  RecoveringEkf started = initial_;
  started.start_with(search_.initializer().estimator());
  found_ = true;
  track_from(std::move(started));
  const std::vector<Message> waiting = search_.waiting();  // of this search, whatever comes of it
  for (const Message& message : waiting) {
    try {
      timeline_ ? track(message) : on(message);
    } catch (const std::invalid_argument&) {
    } catch (const NumericalError&) {
    }
  }
}

Outcome Live::track(const Message& message) {
  Outcome outcome{Verdict::kStale};
  const std::size_t mine = told_++;
  try {
    timeline_->on(message, [&](std::size_t index, const Outcome& told) {
      if (index == mine) {
        outcome = told;
      }
    });
  } catch (...) {
    follow_clock();
    throw;
  }
  follow_clock();
  return outcome;
}

/// Where it jumped and there is no pose to go back to, another search begins.
void Live::follow_clock() {
  if (timeline_->jumps() > jumps_seen_) {
    jumps_seen_ = timeline_->jumps();
    ++jumps_;
    if (found_ && options_.timeline.clock_jump == ClockJump::kReset) {
      relocalize();
    }
  }
}

void Live::track_from(RecoveringEkf estimator) {
  const std::size_t fallen_out = this->fallen_out();
  timeline_.emplace(std::move(estimator), options_.history, options_.timeline);
  fallen_out_ = fallen_out;
  told_ = jumps_seen_ = 0;
}

void Live::start_at(const PoseEstimate& start) {
  RecoveringEkf started = initial_;
  started.start_at(start);
  found_ = false;
  track_from(std::move(started));
}

void Live::relocalize() {
  fallen_out_ = fallen_out();
  timeline_.reset();
  found_ = false;
  search_ = StartSearch(initial_.initializer(), options_.patience);
  late_in_a_row_ = 0;
}

void Live::reset() {
  relocalize();
  fallen_out_ = jumps_ = 0;
  disabled_ = {};
  if (initial_.estimator() != nullptr) {
    track_from(initial_);
  }
}

void Live::enable(Source source, bool enabled) {
  disabled_[static_cast<std::size_t>(source)] = !enabled;
}

std::size_t Live::fallen_out() const {
  return fallen_out_ + (timeline_ ? timeline_->fallen_out() : 0);
}

}  // namespace locfuse
