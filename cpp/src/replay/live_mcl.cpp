// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/live_mcl.hpp"

#include <algorithm>
#include <utility>

namespace locfuse {

LiveMcl::LiveMcl(Mcl mcl, const Options& options)
    : timeline_(Timeline<Mcl>(std::move(mcl), options.history, options.timeline)),
      history_(options.history) {}

LiveMcl::LiveMcl(SwitchingMcl mcl, const Options& options)
    : timeline_(Timeline<SwitchingMcl>(std::move(mcl), options.history, options.timeline)),
      history_(options.history) {}

void LiveMcl::on(const Message& message, const Observer& observer) {
  std::visit([](const auto& m) { validate(m); }, message);
  take({effective_stamp(message), arrivals_++, message}, observer);
}

void LiveMcl::on(const std::vector<MadeMotion>& motions, const Observer& observer) {
  const std::size_t first = arrivals_;
  arrivals_ += motions.size();
  if (!are_made_again(motions)) {
    for (std::size_t k = 0; k < motions.size(); ++k) {
      const Increment moved = motions[k].message();
      take({moved.begin, first + k, moved}, observer);
    }
    return;
  }
  const auto waits = [&](std::size_t origin) { return internal::motion_of(waiting_, origin); };
  const bool fits = covers_those_before(motions, [&](std::size_t origin) {
    const Increment* waiting = waits(origin);
    return waiting != nullptr ? waiting : find_fused(origin);
  });
  // Those that are fused are a beginning of them.
  std::size_t fused = 0;
  for (std::size_t k = 0; k < motions.size(); ++k) {
    fused = motions[k].again && waits(motions[k].origin) == nullptr ? k + 1 : fused;
  }
  bool is_late = !fits;
  if (fits && fused > 0) {
    const std::vector<MadeMotion> of_timeline(motions.begin(),
                                              motions.begin() + static_cast<std::ptrdiff_t>(fused));
    const Outcome outcome = fuse_by(first, observer, [&](auto& timeline, const auto& sink) {
      timeline.on(first, of_timeline, sink);
    });
    is_late = outcome.verdict == Verdict::kStale;
  }
  for (std::size_t k = fits ? fused : 0; k < motions.size(); ++k) {
    const Increment moved = motions[k].message();
    if (is_late) {
      if (observer.fused) {
        observer.fused(first + k, {Verdict::kStale, Reason::kTooLate});
      }
      continue;
    }
    if (motions[k].again) {
      const auto before = internal::find_origin(waiting_, motions[k].origin);
      if (observer.fused) {
        observer.fused(before->index, {Verdict::kIgnored, Reason::kReplaced});
      }
      waiting_.erase(before);
    }
    internal::insert_in_order(waiting_, {moved.begin, first + k, moved});
  }
}

const Increment* LiveMcl::find_fused(std::size_t origin) const {
  return std::visit([&](const auto& timeline) { return timeline.find(origin); }, timeline_);
}

void LiveMcl::take(Entry entry, const Observer& observer) {
  const Message& message = entry.message;
  if (mcl().watches(message)) {  // has its turn by the clock of the others
    internal::insert_in_order(waiting_, std::move(entry));
    take_turns(waiting_.size() > kMaxWaiting ? waiting_.front().stamp : due(), observer);
    return;
  }
  const bool is_ahead = newest_ != std::numeric_limits<Stamp>::min() &&
                        entry.stamp > newest_ + internal::ClockJumpDetector::kFarAhead;
  if (is_ahead) {  // one wrong stamp makes none of the others late
    take_turns(newest_, observer);
    fuse(entry, observer);
    newest_ = std::max(newest_, newest_fused());
  } else {
    watch_time(message, entry.stamp);
    internal::insert_in_order(waiting_, std::move(entry));
  }
  take_turns(due(), observer);
  if (waiting_.size() > kMaxWaiting) {  // the clock stands still
    take_turns(waiting_.front().stamp, observer);
  }
}

void LiveMcl::finish(const Observer& observer) {
  take_turns(std::numeric_limits<Stamp>::max(), observer);
}

void LiveMcl::go_on_from(const LiveMcl& before, const Observer& observer) {
  std::vector<Entry> waiting = before.waiting_;
  std::sort(waiting.begin(), waiting.end(),
            [](const Entry& a, const Entry& b) { return a.index < b.index; });
  for (Entry& entry : waiting) {
    entry.index = arrivals_++;
    take(std::move(entry), observer);
  }
  lateness_ = before.lateness_;
  scans_ = before.scans_;
}

/// Notes how far odometry has come, and how late scans are behind it.
void LiveMcl::watch_time(const Message& message, Stamp stamp) {
  newest_ = std::max(newest_, stamp);
  if (source_of(message) == Source::kOdometry) {
    const Stamp end = stamp_of(message);
    odometry_end_ = std::max(end, odometry_end_.value_or(end));
    odometry_begin_ = std::max(stamp, odometry_begin_.value_or(stamp));
  } else if (source_of(message) == Source::kScans) {
    const Stamp late = std::max<Stamp>(0, odometry_begin_.value_or(stamp) - stamp);
    if (late <= history_) {
      lateness_[scans_++ % kRecentScans] = late;
    }
  }
}

Stamp LiveMcl::lateness() const { return *std::max_element(lateness_.begin(), lateness_.end()); }

/// Up to when all that waits has its turn.
Stamp LiveMcl::due() const {
  if (newest_ == std::numeric_limits<Stamp>::min()) {
    return newest_;
  }
  const Stamp late = lateness();
  const Stamp patient = newest_ - std::max(kPatience, late) - 1;
  if (!odometry_end_ || scans_ == 0) {
    return patient;
  }
  return std::max(patient, late > 0 ? *odometry_begin_ - late : *odometry_end_);
}

void LiveMcl::take_turns(Stamp until, const Observer& observer) {
  while (!waiting_.empty() && waiting_.front().stamp <= until) {
    const Entry now = std::move(waiting_.front());
    waiting_.erase(waiting_.begin());
    fuse(now, observer);
  }
}

/// Calls the timeline; returns the outcome of the message of an index.
template <class Call>
Outcome LiveMcl::fuse_by(std::size_t index, const Observer& observer, const Call& call) {
  Outcome own{Verdict::kIgnored};
  const std::size_t jumps_before = jumps();
  const auto sink = [&](std::size_t of, const Outcome& outcome) {
    if (of == index) {
      own = outcome;
    }
    if (observer.fused) {
      observer.fused(of, outcome);
    }
  };
  try {
    std::visit([&](auto& timeline) { call(timeline, sink); }, timeline_);
  } catch (...) {
    follow_clock(jumps_before, index);
    throw;
  }
  follow_clock(jumps_before, index);
  return own;
}

void LiveMcl::fuse(const Entry& entry, const Observer& observer) {
  const Outcome own = fuse_by(entry.index, observer, [&](auto& timeline, const auto& sink) {
    timeline.on(entry.index, entry.message, sink);
  });
  if (const auto* scan = std::get_if<LaserScan>(&entry.message); scan && observer.scanned) {
    observer.scanned(*scan, own);
  }
}

/// After a jump, what waited by the clock before it has no turn any more.
void LiveMcl::follow_clock(std::size_t jumps_before, std::size_t index) {
  if (jumps() == jumps_before) {
    return;
  }
  newest_ = newest_fused();
  odometry_begin_.reset();
  odometry_end_.reset();
  waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(),
                                [&](const Entry& entry) {
                                  return entry.index < index && entry.stamp > newest_;
                                }),
                 waiting_.end());
}

const Mcl& LiveMcl::mcl() const {
  const SwitchingMcl* both = switching();
  return both != nullptr ? both->mcl() : std::get<Timeline<Mcl>>(timeline_).estimator();
}

const SwitchingMcl* LiveMcl::switching() const {
  const auto* timeline = std::get_if<Timeline<SwitchingMcl>>(&timeline_);
  return timeline != nullptr ? &timeline->estimator() : nullptr;
}

std::size_t LiveMcl::jumps() const {
  return std::visit([](const auto& timeline) { return timeline.jumps(); }, timeline_);
}

std::size_t LiveMcl::dropped_messages() const {
  return std::visit([](const auto& timeline) { return timeline.dropped_messages(); }, timeline_);
}

Stamp LiveMcl::newest_fused() const {
  return std::visit([](const auto& timeline) { return timeline.newest(); }, timeline_);
}

}  // namespace locfuse
