// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/message.hpp"

namespace locfuse {

/// What to do when the clock of all messages goes back: a recording that is looped, a clock that
/// was set.
enum class ClockJump : std::uint8_t {
  kRefuse,    ///< all that comes is stale until the clock has caught up
  kReset,     ///< start anew, as the estimator was at first
  kContinue,  ///< go on from the same pose at the new time
};

struct TimelineOptions {
  ClockJump clock_jump = ClockJump::kRefuse;
  /// So many stale messages in a row tell of a jump; of more than one source, if more than one is
  /// heard: a source alone is late, or has a clock of its own.
  std::size_t jump_after = 20;
  std::size_t most_messages = 100'000;  ///< held for late ones; at least 512
};

namespace internal {

/// Whether an estimator can go on from one of its poses at another time.
template <class Estimator, class = void>
constexpr bool kRestarts = false;
template <class Estimator>
constexpr bool kRestarts<Estimator, std::void_t<decltype(std::declval<Estimator>().restarted(
                                        std::declval<Estimator>().current()))>> = true;

/// Whether an estimator may have to find its start, and holds another until then.
template <class Estimator, class = void>
constexpr bool kSearches = false;
template <class Estimator>
constexpr bool
    kSearches<Estimator, std::void_t<decltype(std::declval<const Estimator&>().estimator())>> =
        true;

/// Whether there is a pose to go on from.
template <class Estimator>
[[nodiscard]] bool has_started(const Estimator& estimator) {
  if constexpr (kSearches<Estimator>) {
    return estimator.estimator() != nullptr;
  } else {
    return true;
  }
}

}  // namespace internal

/// Feeds an estimator in order of (effective stamp, arrival), whatever order messages arrive in.
///
/// A late message inside the history is fused where it belongs: the snapshot before it is restored
/// and what followed is fused again, so the belief equals, bit for bit, that of the sorted log. A
/// message older than the history is kStale. A late message costs what followed it, plus at most
/// kStride more; one in order allocates nothing once the history has filled. A source that falls
/// silent delays no other.
template <class Estimator>
class Timeline {
 public:
  /// `history` [ns] is how late a message may be. Throws std::invalid_argument unless it is in 0 to
  /// kStampLimit, if options are out of range, or if they ask to continue an estimator that cannot
  /// be `restarted`.
  Timeline(Estimator estimator, Stamp history, const TimelineOptions& options = {})
      : start_(estimator), estimator_(std::move(estimator)), history_(history), options_(options) {
    if (history < 0 || history > kStampLimit) {
      throw std::invalid_argument("history is " + std::to_string(history) +
                                  " ns, expected 0 to 2^62 ns");
    }
    if (options.most_messages < kLeast || options.jump_after < 1) {
      throw std::invalid_argument("most_messages is " + std::to_string(options.most_messages) +
                                  " and jump_after " + std::to_string(options.jump_after) +
                                  ", expected >= " + std::to_string(kLeast) + " and >= 1");
    }
    if (options.clock_jump == ClockJump::kContinue && !internal::kRestarts<Estimator>) {
      throw std::invalid_argument(
          "this estimator cannot go on at another time; expected kRefuse "
          "or kReset for a clock that jumps");
    }
  }

  /// Takes the next arrival. `sink(index, outcome)` hears the outcome of every message fused, or
  /// fused again; `index` counts arrivals from 0. What the estimator throws for a message is passed
  /// on, and that message is forgotten.
  template <class Sink>
  void on(const Message& message, Sink&& sink) {
    const Entry entry{effective_stamp(message), arrivals_++, message};
    const auto source = static_cast<std::size_t>(source_of(message));
    if (disabled_[source]) {
      sink(entry.index, Outcome{Verdict::kIgnored});
    } else if (is_stale(entry)) {
      sink(entry.index, Outcome{Verdict::kStale});
      hold(entry, sink);
    } else {
      held_.clear();
      take(entry, sink);
      heard_[source] = true;
    }
  }

  /// Switches a source off, or on again: while it is off its messages are kIgnored. What was fused
  /// stays.
  void enable(Source source, bool enabled) {
    disabled_[static_cast<std::size_t>(source)] = !enabled;
  }

  /// As it was made: estimator, sources, counts.
  void reset() {
    clear();
    arrivals_ = jumps_ = fallen_out_ = 0;
    disabled_ = {};
  }

  [[nodiscard]] const Estimator& estimator() const { return estimator_; }
  /// How often the clock went back and the estimator started anew or went on.
  [[nodiscard]] std::size_t jumps() const { return jumps_; }
  /// Messages inside the history that were forgotten since there were too many of them: what comes
  /// from before them is stale.
  [[nodiscard]] std::size_t fallen_out() const { return fallen_out_; }

 private:
  static constexpr std::size_t kStride = 16;
  static constexpr std::size_t kLeast = 2 * kStride * kStride;

  struct Entry {
    Stamp stamp;
    std::size_t index;
    Message message;
  };
  struct Snapshot {
    std::size_t position;  // in entries_, of the first one it has not seen
    Estimator estimator;
  };

  [[nodiscard]] bool is_stale(const Entry& entry) const {
    return !entries_.empty() &&
           (entry.stamp < entries_.back().stamp - history_ || entry.stamp < forgotten_until_);
  }

  template <class Sink>
  void take(const Entry& entry, Sink& sink) {
    if (entries_.empty() || entry.stamp >= entries_.back().stamp) {
      append(entry, sink);
    } else {
      insert(entry, sink);
    }
    if (entries_.size() > options_.most_messages) {
      forget_oldest();
    }
  }

  // Remembers a stale message; enough of them in a row are what comes after a jump.
  template <class Sink>
  void hold(const Entry& entry, Sink& sink) {
    if (options_.clock_jump == ClockJump::kRefuse) {
      return;
    }
    std::visit([](const auto& message) { validate(message); }, entry.message);
    held_.push_back(entry);
    const auto is_other = [&](const Entry& e) {
      return source_of(e.message) != source_of(entry.message);
    };
    const bool alone = std::none_of(held_.begin(), held_.end(), is_other);
    if (held_.size() < options_.jump_after ||
        (alone && std::count(heard_.begin(), heard_.end(), true) > 1)) {
      if (held_.size() >= std::max(options_.jump_after, kLeast)) {  // a source may stay alone
        held_.erase(held_.begin());
      }
      return;
    }
    const std::vector<Entry> after = std::move(held_);
    jump(after);
    std::exception_ptr refused;
    for (const Entry& e : after) {
      try {
        if (!is_stale(e)) {
          take(e, sink);
        }
      } catch (...) {
        refused = std::current_exception();
      }
    }
    if (refused) {
      std::rethrow_exception(refused);
    }
  }

  void jump(const std::vector<Entry>& after) {
    ++jumps_;
    if constexpr (internal::kRestarts<Estimator>) {
      if (options_.clock_jump == ClockJump::kContinue && internal::has_started(estimator_)) {
        auto now = estimator_.estimate();
        now.stamp =
            std::min_element(after.begin(), after.end(), [](const Entry& a, const Entry& b) {
              return a.stamp < b.stamp;
            })->stamp;
        Estimator on = estimator_.restarted(now);
        clear();
        estimator_ = std::move(on);
        return;
      }
    }
    clear();
  }

  void clear() {
    estimator_ = start_;
    entries_.clear();
    snapshots_used_ = 0;
    forgotten_until_ = std::numeric_limits<Stamp>::min();
    held_.clear();
    heard_ = {};
  }

  template <class Sink>
  void append(const Entry& entry, Sink& sink) {
    const bool taken =  // by a message that came here before and was refused
        snapshots_used_ > 0 && snapshots_[snapshots_used_ - 1].position == entries_.size();
    if (entries_.size() % kStride == 0 && !taken) {
      take_snapshot();
    }
    try {
      sink(entry.index, estimator_.on(entry.message));
    } catch (...) {  // whatever it left behind
      fuse_again(entries_.size(), sink);
      throw;
    }
    entries_.push_back(entry);
    if (entries_.size() >= kStride * kStride) {
      forget();
    }
  }

  template <class Sink>
  void insert(const Entry& entry, Sink& sink) {
    const auto later = [](Stamp stamp, const Entry& e) { return stamp < e.stamp; };
    const auto place = std::upper_bound(entries_.begin(), entries_.end(), entry.stamp, later);
    const auto position = static_cast<std::size_t>(place - entries_.begin());
    entries_.insert(place, entry);
    try {
      fuse_again(position, sink);
    } catch (...) {
      entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(position));
      fuse_again(position, sink);
      throw;
    }
  }

  template <class Sink>
  void fuse_again(std::size_t position, Sink& sink) {
    while (snapshots_used_ > 1 && snapshots_[snapshots_used_ - 1].position > position) {
      --snapshots_used_;
    }
    std::size_t next = snapshots_[snapshots_used_ - 1].position;
    estimator_ = snapshots_[snapshots_used_ - 1].estimator;
    for (; next < entries_.size(); ++next) {
      if (next % kStride == 0 && next > snapshots_[snapshots_used_ - 1].position) {
        take_snapshot(next);
      }
      const Outcome outcome = estimator_.on(entries_[next].message);
      if (next >= position) {
        sink(entries_[next].index, outcome);
      }
    }
  }

  void take_snapshot() { take_snapshot(entries_.size()); }
  void take_snapshot(std::size_t position) {
    if (snapshots_used_ == snapshots_.size()) {
      snapshots_.push_back({position, estimator_});
    } else {  // reuse memory
      snapshots_[snapshots_used_].position = position;
      snapshots_[snapshots_used_].estimator = estimator_;
    }
    ++snapshots_used_;
  }

  // Drops, kStride at a time, what lies before the last snapshot that the history can ask for.
  void forget() {
    const Stamp horizon = entries_.back().stamp - history_;
    std::size_t keep = 0;
    while (keep + 1 < snapshots_used_ && entries_[snapshots_[keep + 1].position].stamp < horizon) {
      ++keep;
    }
    if (keep * 2 < snapshots_used_) {
      return;  // not worth the move yet: every entry is moved once on average
    }
    drop_before(keep);
  }

  // Drops a quarter of what is held, or a little more.
  void forget_oldest() {
    const Stamp horizon = entries_.back().stamp - history_;
    std::size_t keep = 0;
    while (keep + 1 < snapshots_used_ && snapshots_[keep].position < entries_.size() / 4) {
      ++keep;
    }
    const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(snapshots_[keep].position);
    fallen_out_ += static_cast<std::size_t>(std::count_if(
        entries_.begin(), end, [&](const Entry& entry) { return entry.stamp >= horizon; }));
    drop_before(keep);
  }

  // Drops what lies before a snapshot.
  void drop_before(std::size_t keep) {
    const std::size_t dropped = snapshots_[keep].position;
    if (dropped > 0) {
      forgotten_until_ = entries_[dropped - 1].stamp;
    }
    entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(dropped));
    std::rotate(snapshots_.begin(), snapshots_.begin() + static_cast<std::ptrdiff_t>(keep),
                snapshots_.begin() + static_cast<std::ptrdiff_t>(snapshots_used_));
    snapshots_used_ -= keep;
    for (std::size_t i = 0; i < snapshots_used_; ++i) {
      snapshots_[i].position -= dropped;
    }
  }

  Estimator start_;
  Estimator estimator_;
  Stamp history_;
  TimelineOptions options_;
  std::size_t arrivals_ = 0;
  std::size_t jumps_ = 0;
  std::size_t fallen_out_ = 0;
  Stamp forgotten_until_ = std::numeric_limits<Stamp>::min();
  std::array<bool, kSources> disabled_{};
  std::array<bool, kSources> heard_{};  // since the start or the last jump
  std::vector<Entry> held_;             // stale ones in a row
  std::vector<Entry> entries_;          // by (stamp, arrival); the oldest at a multiple of kStride
  std::vector<Snapshot> snapshots_;     // the first snapshots_used_ are valid
  std::size_t snapshots_used_ = 0;
};

}  // namespace locfuse
