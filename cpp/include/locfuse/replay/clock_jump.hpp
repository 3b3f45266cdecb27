// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <utility>
#include <variant>
#include <vector>

#include "locfuse/messages/message.hpp"
#include "locfuse/replay/made_motion.hpp"

namespace locfuse {

/// What to do when the clock of all messages goes back: a looped recording, a clock that was set.
enum class ClockJump : std::uint8_t {
  kRefuse,    ///< all messages are stale until the clock has caught up
  kReset,     ///< restart from the estimator's first state
  kContinue,  ///< continue from the same pose at the new time
};

namespace internal {

/// A message with its place in a Timeline.
struct TimelineEntry {
  Stamp stamp;        ///< at which it takes effect [ns]
  std::size_t index;  ///< order of arrival
  Message message;
};

/// Inserts a message into those that wait for their turn, in the order of `precedes`.
inline void insert_in_order(std::vector<TimelineEntry>& waiting, TimelineEntry entry) {
  const auto place = std::upper_bound(waiting.begin(), waiting.end(), entry,
                                      [](const TimelineEntry& a, const TimelineEntry& b) {
                                        return precedes(a.message, b.message);
                                      });
  waiting.insert(place, std::move(entry));
}

/// Where the motion of an origin is, which is near the end; the end if there is none.
template <class Entries>
auto find_origin(Entries& entries, std::size_t origin) {
  const auto behind = std::find_if(entries.rbegin(), entries.rend(), [&](const TimelineEntry& e) {
    return origin_of(e.message) == origin;
  });
  return behind == entries.rend() ? entries.end() : std::prev(behind.base());
}

/// The motion of an origin, or null.
inline const Increment* motion_of(const std::vector<TimelineEntry>& entries, std::size_t origin) {
  const auto found = find_origin(entries, origin);
  return found == entries.end() ? nullptr : &std::get<Increment>(found->message);
}

/// Detects a clock that went back, by consecutive stale messages, or far ahead.
class ClockJumpDetector {
 public:
  explicit ClockJumpDetector(std::size_t jump_after) : jump_after_(jump_after) {}

  /// A message arrived in time: those before it were merely late.
  void clear_stale() { stale_.clear(); }
  /// A message of that source was fused.
  void add_source(Source source) { sources_[static_cast<std::size_t>(source)] = true; }
  /// Returns whether this stale message and those before it signal a jump: with several sources
  /// they must come from at least two, as one alone may be late or have a clock of its own.
  bool add_stale(const TimelineEntry& entry, std::size_t max_messages) {
    stale_.push_back(entry);
    const bool is_one_source =
        std::none_of(stale_.begin(), stale_.end(), [&](const TimelineEntry& other) {
          return source_of(other.message) != source_of(entry.message);
        });
    const bool has_several = std::count(sources_.begin(), sources_.end(), true) > 1;
    if (stale_.size() >= jump_after_ && !(is_one_source && has_several)) {
      return true;
    }
    if (stale_.size() >= std::max(jump_after_, max_messages)) {
      stale_.erase(stale_.begin());
    }
    return false;
  }
  /// Holds a message that is stamped far ahead of all others, and returns whether those held show
  /// that the clock went on: two sources have it, or twice the only one. Where others have
  /// fallen silent, `jump_after` in a row do. One wrong stamp so makes no others stale.
  bool add_ahead(const TimelineEntry& entry) {
    const auto is_further = [&](const TimelineEntry& other) {
      return other.stamp > entry.stamp + kFarAhead;
    };
    ahead_.erase(std::remove_if(ahead_.begin(), ahead_.end(), is_further), ahead_.end());
    ahead_.push_back(entry);
    const bool is_one_source =
        std::all_of(ahead_.begin(), ahead_.end(), [&](const TimelineEntry& other) {
          return source_of(other.message) == source_of(entry.message);
        });
    const bool has_several = std::count(sources_.begin(), sources_.end(), true) > 1;
    return ahead_.size() >=
           (is_one_source && has_several ? std::max(jump_after_, kAgreeing) : kAgreeing);
  }
  void clear_ahead() { ahead_.clear(); }
  /// The messages that showed that the clock went on.
  [[nodiscard]] std::vector<TimelineEntry> take_ahead() { return std::exchange(ahead_, {}); }
  /// The messages that signalled the jump.
  [[nodiscard]] std::vector<TimelineEntry> take_stale() { return std::exchange(stale_, {}); }
  void reset() {
    stale_.clear();
    ahead_.clear();
    sources_ = {};
  }

  /// Beyond which a message is far ahead of all before it [ns].
  static constexpr Stamp kFarAhead = 5'000'000'000;

 private:
  static constexpr std::size_t kAgreeing = 2;

  std::size_t jump_after_;
  std::vector<TimelineEntry> stale_;      // in a row
  std::vector<TimelineEntry> ahead_;      // in a row, none far ahead of the next
  std::array<bool, kSources> sources_{};  // fused since the start or the last jump
};

}  // namespace internal

}  // namespace locfuse
