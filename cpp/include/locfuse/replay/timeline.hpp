// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <exception>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/replay/clock_jump.hpp"
#include "locfuse/replay/made_motion.hpp"
#include "locfuse/replay/message_history.hpp"

namespace locfuse {

struct TimelineOptions {
  ClockJump clock_jump = ClockJump::kRefuse;
  /// Number of consecutive stale messages that signals a clock jump. With several sources they must
  /// come from at least two.
  std::size_t jump_after = 20;
  std::size_t max_messages = 100'000;  ///< kept for late ones; at least 512
};

namespace internal {

/// Whether an estimator can continue from one of its poses at another time.
template <class Estimator, class = void>
constexpr bool kRestarts = false;
template <class Estimator>
constexpr bool kRestarts<Estimator, std::void_t<decltype(std::declval<Estimator>().restarted(
                                        std::declval<Estimator>().current()))>> = true;

/// Whether an estimator may first have to find its start, and holds another one from then on.
template <class Estimator, class = void>
constexpr bool kSearches = false;
template <class Estimator>
constexpr bool
    kSearches<Estimator, std::void_t<decltype(std::declval<const Estimator&>().has_started())>> =
        true;

/// Whether an estimator may have a height, and says so.
template <class Estimator, class = void>
constexpr bool kMayFly = false;
template <class Estimator>
constexpr bool
    kMayFly<Estimator, std::void_t<decltype(std::declval<const Estimator&>().is_in_space())>> =
        true;

/// Throws std::invalid_argument unless the message is valid for an estimator: in the plane, or in
/// space.
template <class Estimator>
void validate_for(const Estimator& estimator, const Message& message) {
  if constexpr (kMayFly<Estimator>) {
    if (estimator.is_in_space()) {
      validate_in_space(message);
      return;
    }
  }
  std::visit([](const auto& m) { validate(m); }, message);
}

/// Whether some messages only help others, so that their clocks do not count.
template <class Estimator, class = void>
constexpr bool kHasHelpers = false;
template <class Estimator>
constexpr bool kHasHelpers<Estimator, std::void_t<decltype(std::declval<const Estimator&>().leads(
                                          std::declval<const Message&>()))>> = true;

/// Whether an estimator may judge messages that it does not use, so that their clocks do not count.
template <class Estimator, class = void>
constexpr bool kWatches = false;
template <class Estimator>
constexpr bool kWatches<Estimator, std::void_t<decltype(std::declval<const Estimator&>().watches(
                                       std::declval<const Message&>()))>> = true;

/// Whether an estimator judges a message and does not use it.
template <class Estimator>
[[nodiscard]] bool watches(const Estimator& estimator, const Message& message) {
  if constexpr (kWatches<Estimator>) {
    return estimator.watches(message);
  } else {
    return false;
  }
}

/// Whether there is a pose to continue from.
template <class Estimator>
[[nodiscard]] bool has_started(const Estimator& estimator) {
  if constexpr (kSearches<Estimator>) {
    return estimator.has_started();
  } else {
    return true;
  }
}

}  // namespace internal

/// Feeds an estimator in order of effective stamps, whatever order messages arrive in; at equal
/// stamps odometry comes first and scans last, the rest as `precedes` has it.
///
/// A late message inside the history is fused where it belongs: the snapshot before it is restored
/// and what followed is fused again, so the belief equals, bit for bit, that of the sorted log. A
/// message older than the history is kStale. A late message costs those after it and at most 16
/// more, so at most what the history holds, which max_messages bounds; one in order allocates
/// nothing once the history has filled. A source that stops publishing delays no other.
///
/// A message stamped more than 5 s after all before it is kIgnored and held until the next one. If
/// that is as late, from another source where there are several, both are fused; else it is
/// dropped. What the estimator judges and does not use (`watches`) waits until those that it uses
/// have come that far.
template <class Estimator>
class Timeline {
 public:
  /// `history` [ns] is how late a message may be. Throws std::invalid_argument unless it is in 0 to
  /// kStampLimit, if options are out of range, or for kContinue if the estimator has no
  /// `restarted`.
  Timeline(Estimator estimator, Stamp history, const TimelineOptions& options = {})
      : start_(estimator),
        estimator_(std::move(estimator)),
        options_(options),
        history_(history, options.max_messages),
        detector_(options.jump_after) {
    if (history < 0 || history > kStampLimit) {
      throw std::invalid_argument("history is " + std::to_string(history) +
                                  " ns, expected 0 to 2^62 ns");
    }
    if (options.max_messages < History::kMinMessages || options.jump_after < 1) {
      throw std::invalid_argument("max_messages is " + std::to_string(options.max_messages) +
                                  " and jump_after " + std::to_string(options.jump_after) +
                                  ", expected >= " + std::to_string(History::kMinMessages) +
                                  " and >= 1");
    }
    if (options.clock_jump == ClockJump::kContinue && !internal::kRestarts<Estimator>) {
      throw std::invalid_argument(
          "this estimator cannot go on at another time; expected kRefuse "
          "or kReset for a clock that jumps");
    }
  }

  /// Takes the next message. `sink(index, outcome)` receives the outcome of every message fused, or
  /// fused again; `index` counts arrivals from 0. What the estimator throws for a message is passed
  /// on, and that message is forgotten. `may_wait`: the next message is a sighting of the same
  /// stamp as this one, so that an estimator that fuses them jointly does so once, then.
  template <class Sink>
  void on(const Message& message, Sink&& sink, bool may_wait = false) {
    take(entry_of(arrivals_++, message), sink, may_wait);
  }
  /// Takes the motions that one message changed, of an OdometryTimeline; `sink` as above, and
  /// kReplaced for those that were there before. Where these are not all in the history, or cover
  /// more than what is in place of them, nothing changes, and all are kStale.
  template <class Sink>
  void on(const std::vector<MadeMotion>& motions, Sink&& sink) {
    const std::size_t first = arrivals_;
    arrivals_ += motions.size();
    on(first, motions, sink);
  }

  /// The same of messages that the caller has counted, from `index` on.
  template <class Sink>
  void on(std::size_t index, const Message& message, Sink&& sink) {
    take(entry_of(index, message), sink, false);
  }
  template <class Sink>
  void on(std::size_t index, const std::vector<MadeMotion>& motions, Sink&& sink) {
    if (!are_made_again(motions)) {
      for (const MadeMotion& motion : motions) {
        take(entry_of(index++, motion.message()), sink, false);
      }
      return;
    }
    std::vector<Entry> entries;
    bool is_late = false;
    for (const MadeMotion& motion : motions) {
      entries.push_back(entry_of(index++, motion.message()));
      is_late = is_late || history_.is_stale(entries.back().stamp);
    }
    is_late = is_late || !covers_those_before(
                             motions, [&](std::size_t origin) { return history_.find(origin); });
    const bool is_off = disabled_[static_cast<std::size_t>(Source::kOdometry)];
    if (!is_off && !is_late) {
      history_.replace(entries, estimator_, sink);
      drop_oldest();
      return;
    }
    for (const Entry& entry : entries) {
      sink(entry.index, is_off ? Outcome{Verdict::kIgnored, Reason::kSwitchedOff}
                               : Outcome{Verdict::kStale, Reason::kTooLate});
    }
  }

  /// Switches a source off or on: while it is off its messages are kIgnored. Those fused before
  /// stay.
  void enable(Source source, bool enabled) {
    disabled_[static_cast<std::size_t>(source)] = !enabled;
  }

  /// Back to the state after construction: estimator, sources, counts.
  void reset() {
    clear();
    arrivals_ = jumps_ = dropped_messages_ = 0;
    disabled_ = {};
  }

  [[nodiscard]] const Estimator& estimator() const { return estimator_; }
  /// Stamp of the newest message fused; the least of all stamps before the first.
  [[nodiscard]] Stamp newest() const { return history_.newest(); }
  /// The motion of an origin in the history, or null.
  [[nodiscard]] const Increment* find(std::size_t origin) const { return history_.find(origin); }
  /// Clock jumps after which the estimator restarted or continued.
  [[nodiscard]] std::size_t jumps() const { return jumps_; }
  /// Messages inside the history that were dropped since there were more than max_messages: later
  /// ones from before them are stale.
  [[nodiscard]] std::size_t dropped_messages() const { return dropped_messages_; }

 private:
  static constexpr std::size_t kMaxWatched = 1000;

  using Entry = internal::TimelineEntry;
  using History = internal::MessageHistory<Estimator>;

  [[nodiscard]] static Entry entry_of(std::size_t index, const Message& message) {
    return {internal::order_stamp<Estimator>(message), index, message};
  }

  template <class Sink>
  void take(const Entry& entry, Sink& sink, bool may_wait) {
    const Source source = source_of(entry.message);
    if (disabled_[static_cast<std::size_t>(source)]) {
      sink(entry.index, Outcome{Verdict::kIgnored, Reason::kSwitchedOff});
    } else if (internal::watches(estimator_, entry.message)) {
      take_watched(entry, sink);
    } else if (history_.is_stale(entry.stamp)) {
      sink(entry.index, Outcome{Verdict::kStale, Reason::kTooLate});
      watch_clock(entry, sink);
    } else if (history_.is_ahead(entry.stamp, internal::ClockJumpDetector::kFarAhead)) {
      hold(entry, sink);
    } else {
      detector_.clear_ahead();
      detector_.clear_stale();
      fuse(entry, sink, may_wait);
      add_source(entry);
      judge_watched(sink);
    }
  }

  /// Judges a message now, or once those that are used have come that far.
  template <class Sink>
  void take_watched(const Entry& entry, Sink& sink) {
    internal::validate_for(estimator_, entry.message);
    if (history_.is_stale(entry.stamp)) {
      sink(entry.index, Outcome{Verdict::kStale, Reason::kTooLate});
    } else if (entry.stamp > history_.newest()) {
      sink(entry.index, Outcome{Verdict::kIgnored, Reason::kWatched});
      if (watched_.size() < kMaxWatched) {
        internal::insert_in_order(watched_, entry);
      }
    } else {
      fuse(entry, sink);
    }
  }

  template <class Sink>
  void judge_watched(Sink& sink) {
    while (!watched_.empty() && watched_.front().stamp <= history_.newest()) {
      const Entry entry = std::move(watched_.front());
      watched_.erase(watched_.begin());
      fuse(entry, sink);
    }
  }

  void add_source(const Entry& entry) {
    if constexpr (internal::kHasHelpers<Estimator>) {
      if (!estimator_.leads(entry.message)) {
        return;
      }
    }
    detector_.add_source(source_of(entry.message));
  }

  template <class Sink>
  void fuse(const Entry& entry, Sink& sink, bool may_wait = false) {
    history_.fuse(entry, estimator_, sink, may_wait);
    drop_oldest();
  }

  void drop_oldest() {
    if (history_.size() > options_.max_messages) {
      dropped_messages_ += history_.drop_oldest();
    }
  }

  /// Follows the clock where a stale message shows that it went back, and fuses the messages that
  /// showed it.
  template <class Sink>
  void watch_clock(const Entry& entry, Sink& sink) {
    if (options_.clock_jump == ClockJump::kRefuse) {
      return;
    }
    internal::validate_for(estimator_, entry.message);
    if (!detector_.add_stale(entry, History::kMinMessages)) {
      return;
    }
    const std::vector<Entry> after = detector_.take_stale();
    follow_jump(after);
    fuse_all(after, sink);
  }

  /// Keeps a message that is far ahead until others show that it is right.
  template <class Sink>
  void hold(const Entry& entry, Sink& sink) {
    internal::validate_for(estimator_, entry.message);
    sink(entry.index, Outcome{Verdict::kIgnored, Reason::kTooFarAhead});
    if (detector_.add_ahead(entry)) {
      detector_.clear_stale();
      fuse_all(detector_.take_ahead(), sink);
    }
  }

  /// Fuses messages that waited. What the estimator throws for one is passed on after the others.
  template <class Sink>
  void fuse_all(const std::vector<Entry>& waiting, Sink& sink) {
    std::exception_ptr refused;
    for (const Entry& e : waiting) {
      try {
        if (!history_.is_stale(e.stamp)) {
          fuse(e, sink);
          add_source(e);
        }
      } catch (...) {
        refused = std::current_exception();
      }
    }
    if (refused) {
      std::rethrow_exception(refused);
    }
  }

  void follow_jump(const std::vector<Entry>& after) {
    ++jumps_;
    if constexpr (internal::kRestarts<Estimator>) {
      if (options_.clock_jump == ClockJump::kContinue && internal::has_started(estimator_)) {
        auto now = estimator_.estimate();
        now.stamp =
            std::min_element(after.begin(), after.end(), [](const Entry& a, const Entry& b) {
              return a.stamp < b.stamp;
            })->stamp;
        Estimator continued = estimator_.restarted(now);
        clear();
        estimator_ = std::move(continued);
        return;
      }
    }
    clear();
  }

  void clear() {
    estimator_ = start_;
    history_.clear();
    detector_.reset();
    watched_.clear();
  }

  Estimator start_;
  Estimator estimator_;
  TimelineOptions options_;
  History history_;
  internal::ClockJumpDetector detector_;
  std::array<bool, kSources> disabled_{};
  std::vector<Entry> watched_;  // sorted; ahead of all that are used
  std::size_t arrivals_ = 0;
  std::size_t jumps_ = 0;
  std::size_t dropped_messages_ = 0;
};

}  // namespace locfuse
