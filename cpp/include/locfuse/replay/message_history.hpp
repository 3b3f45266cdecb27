// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/replay/clock_jump.hpp"

namespace locfuse::internal {

/// Whether an estimator may fuse the sightings of one instant as one measurement.
template <class Estimator, class = void>
constexpr bool kMayFuseJointly = false;
template <class Estimator>
constexpr bool kMayFuseJointly<
    Estimator, std::void_t<decltype(std::declval<const Estimator&>().fuses_jointly())>> = true;

/// Whether a snapshot of an estimator is large, so that few are kept: its kSnapshots, evenly over
/// the history.
template <class Estimator, class = void>
constexpr int kFewSnapshots = 0;
template <class Estimator>
constexpr int kFewSnapshots<Estimator, std::void_t<decltype(Estimator::kSnapshots)>> =
    Estimator::kSnapshots;

/// Whether an estimator is fed in order of stamps, and not of when motions begin.
template <class Estimator, class = void>
constexpr bool kInOrderOfStamps = false;
template <class Estimator>
constexpr bool kInOrderOfStamps<Estimator, std::void_t<decltype(Estimator::kInOrderOfStamps)>> =
    Estimator::kInOrderOfStamps;

/// Whether some messages cost an estimator so much that a snapshot is kept after each of them.
template <class Estimator, class = void>
constexpr bool kHasCostly = false;
template <class Estimator>
constexpr bool kHasCostly<
    Estimator, std::void_t<decltype(Estimator::is_costly(std::declval<const Message&>()))>> = true;

/// The stamp by which an estimator is fed a message.
template <class Estimator>
[[nodiscard]] Stamp order_stamp(const Message& message) {
  return kInOrderOfStamps<Estimator> ? stamp_of(message) : effective_stamp(message);
}

/// Fused messages in the order of `precedes`, with snapshots of the
/// estimator every kSnapshotInterval of them, from which a late message and those after it are
/// fused again. Where the estimator fuses jointly, so do the sightings of one stamp between two
/// other messages: each that arrives fuses all of them again.
template <class Estimator>
class MessageHistory {
 public:
  static constexpr std::size_t kSnapshotInterval = 16;
  /// Messages that are kept at least.
  static constexpr std::size_t kMinMessages = 2 * kSnapshotInterval * kSnapshotInterval;
  /// Messages of one stamp that are put in order.
  static constexpr std::size_t kMaxOfInstant = 256;

  /// `length` [ns] is how late a message may be, of at most `max_messages`.
  MessageHistory(Stamp length, std::size_t max_messages)
      : length_(length), max_messages_(max_messages) {}

  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  /// Stamp of the newest message fused; the least of all stamps before the first.
  [[nodiscard]] Stamp newest() const {
    return entries_.empty() ? std::numeric_limits<Stamp>::min() : entries_.back().stamp;
  }
  /// Whether a message is older than the history.
  [[nodiscard]] bool is_stale(Stamp stamp) const {
    return !entries_.empty() &&
           (stamp < entries_.back().stamp - length_ || stamp < forgotten_until_);
  }

  /// Whether a message is more than a time [ns] after all before it.
  [[nodiscard]] bool is_ahead(Stamp stamp, Stamp by) const {
    return !entries_.empty() && stamp > entries_.back().stamp + by;
  }

  void clear() {
    entries_.clear();
    joint_begin_.reset();
    instant_begin_.reset();
    snapshots_used_ = 0;
    forgotten_until_ = std::numeric_limits<Stamp>::min();
  }

  /// Fuses a message where it belongs. `sink(index, outcome)` receives the outcome of each message
  /// fused. What the estimator throws is passed on, and the message is forgotten. A sighting that
  /// is fused jointly may wait for the next one, if that is of the same stamp for sure.
  template <class Sink>
  void fuse(const TimelineEntry& entry, Estimator& estimator, Sink& sink, bool may_wait) {
    if (entries_.empty() || joins_last(entry, estimator) || is_crowded(entry.stamp) ||
        !precedes(entry, entries_.back())) {
      append(entry, estimator, sink, may_wait);
    } else {
      insert(entry, estimator, sink);
    }
  }

  /// The motion of an origin, or null.
  [[nodiscard]] const Increment* find(std::size_t origin) const {
    return motion_of(entries_, origin);
  }

  /// Fuses motions in place of those of the same origins, which the sink receives as kReplaced.
  /// What the estimator throws is passed on, and all is as it was.
  template <class Sink>
  void replace(const std::vector<TimelineEntry>& motions, Estimator& estimator, Sink& sink) {
    std::vector<TimelineEntry> before;
    std::size_t first = entries_.size();
    for (const TimelineEntry& motion : motions) {
      const std::size_t place = remove_origin(origin_of(motion.message), &before);
      first = std::min({first, place, insert_in_place(motion)});
    }
    for (const TimelineEntry& entry : before) {
      sink(entry.index, Outcome{Verdict::kIgnored, Reason::kReplaced});
    }
    joint_begin_.reset();
    if (instant_begin_ && *instant_begin_ > first) {
      instant_begin_.reset();
    }
    first = begin_of_joint(first, estimator);
    try {
      fuse_again(first, estimator, sink);
    } catch (...) {
      for (const TimelineEntry& motion : motions) {
        remove_origin(origin_of(motion.message), nullptr);
      }
      for (const TimelineEntry& entry : before) {
        insert_in_place(entry);
      }
      fuse_again(std::min(first, entries_.size()), estimator, sink);
      throw;
    }
  }

  /// Drops a quarter of the messages, or a little more; returns how many of them the history should
  /// still have held.
  std::size_t drop_oldest() {
    const Stamp horizon = entries_.back().stamp - length_;
    std::size_t keep = 0;
    while (keep + 1 < snapshots_used_ && snapshots_[keep].position < entries_.size() / 4) {
      ++keep;
    }
    const auto end = entries_.begin() + static_cast<std::ptrdiff_t>(snapshots_[keep].position);
    const auto dropped = std::count_if(entries_.begin(), end,
                                       [&](const TimelineEntry& e) { return e.stamp >= horizon; });
    drop_before(keep);
    return static_cast<std::size_t>(dropped);
  }

 private:
  struct Snapshot {
    std::size_t position;  // in entries_, of the first message that it has not fused
    Estimator estimator;
  };

  template <class Sink>
  void append(const TimelineEntry& entry, Estimator& estimator, Sink& sink, bool may_wait) {
    const bool joins = joins_last(entry, estimator);
    if (!joins && is_snapshot_due(entries_.size(), entry.stamp)) {
      take_snapshot(entries_.size(), estimator);
    }
    if (is_joint(entry, estimator)) {
      if (!joins) {
        joint_begin_ = entries_.size();
        before_joint_ = estimator;
      }
      append_joint(entry, estimator, sink, may_wait);
    } else {
      try {
        sink(entry.index, estimator.on(entry.message));
      } catch (...) {  // the estimator may have changed
        fuse_again(entries_.size(), estimator, sink);
        throw;
      }
      entries_.push_back(entry);
    }
    if (kFewSnapshots < Estimator >> 0 ||
        entries_.size() >= kSnapshotInterval * kSnapshotInterval) {
      drop_expired();
    }
  }

  template <class Sink>
  void insert(const TimelineEntry& entry, Estimator& estimator, Sink& sink) {
    const auto place = std::upper_bound(entries_.begin(), entries_.end(), entry, precedes);
    const auto position = static_cast<std::size_t>(place - entries_.begin());
    entries_.insert(place, entry);
    const std::size_t first = begin_of_joint(position, estimator);
    joint_begin_.reset();  // what is before it changes
    if (instant_begin_ && *instant_begin_ > position) {
      instant_begin_.reset();
    }
    try {
      if (entry.stamp == entries_.back().stamp) {
        keep_begin_of_instant(position, estimator, sink);
      }
      fuse_again(first, estimator, sink);
    } catch (...) {
      forget(entry, first);
      fuse_again(first, estimator, sink);
      throw;
    }
  }

  /// Removes the motion of an origin; returns where it was.
  std::size_t remove_origin(std::size_t origin, std::vector<TimelineEntry>* removed) {
    const auto found = find_origin(entries_, origin);
    if (found == entries_.end()) {
      return entries_.size();
    }
    const auto place = static_cast<std::size_t>(found - entries_.begin());
    if (removed != nullptr) {
      removed->push_back(std::move(*found));
    }
    entries_.erase(found);
    return place;
  }
  /// Inserts a motion without fusing it; returns where.
  std::size_t insert_in_place(const TimelineEntry& entry) {
    const auto place = std::upper_bound(entries_.begin(), entries_.end(), entry, precedes);
    const auto position = static_cast<std::size_t>(place - entries_.begin());
    entries_.insert(place, entry);
    return position;
  }

  /// Adds a sighting to those of its instant, the last ones, and fuses all of them.
  template <class Sink>
  void append_joint(const TimelineEntry& entry, Estimator& estimator, Sink& sink, bool may_wait) {
    validate(std::get<RangeBearing>(entry.message));
    entries_.push_back(entry);
    if (may_wait) {
      return;
    }
    const std::size_t first = begin_of_joint(entries_.size() - 1, estimator);
    const auto fuse_them = [&] {
      if (joint_begin_ == first) {
        estimator = *before_joint_;
        fuse_from(first, first, entries_.size(), estimator, sink);
      } else {
        fuse_again(first, estimator, sink);
      }
    };
    try {
      fuse_them();
    } catch (...) {
      forget(entry, first);
      fuse_them();
      throw;
    }
  }

  /// Whether so many messages have the last stamp that others are added as they arrive: a clock
  /// stands still.
  [[nodiscard]] bool is_crowded(Stamp stamp) const {
    return entries_.size() > kMaxOfInstant &&
           entries_[entries_.size() - kMaxOfInstant].stamp == stamp;
  }

  /// Keeps the estimator before the first message of the last stamp, which one of them came to in
  /// the wrong order: drivers repeat their order, and others will come so.
  template <class Sink>
  void keep_begin_of_instant(std::size_t position, Estimator& estimator, Sink& sink) {
    std::size_t begin = position;
    while (begin > 0 && entries_[begin - 1].stamp == entries_[position].stamp) {
      --begin;
    }
    if (instant_begin_ == begin) {
      return;
    }
    const std::size_t next = restore(begin, estimator);
    fuse_from(next, entries_.size(), begin, estimator, sink);
    instant_begin_ = begin;
    before_instant_ = estimator;
  }

  /// Removes a message, which is not before a position.
  void forget(const TimelineEntry& entry, std::size_t position) {
    entries_.erase(std::find_if(entries_.begin() + static_cast<std::ptrdiff_t>(position),
                                entries_.end(),
                                [&](const TimelineEntry& e) { return e.index == entry.index; }));
  }

  [[nodiscard]] static bool precedes(const TimelineEntry& a, const TimelineEntry& b) {
    if (a.stamp != b.stamp) {
      return a.stamp < b.stamp;
    }
    if constexpr (kInOrderOfStamps<Estimator>) {
      return Estimator::precedes(a.message, b.message);
    } else {
      return locfuse::precedes(a.message, b.message);
    }
  }

  [[nodiscard]] static bool is_joint(const TimelineEntry& entry, const Estimator& estimator) {
    if constexpr (kMayFuseJointly<Estimator>) {
      return estimator.fuses_jointly() && std::holds_alternative<RangeBearing>(entry.message);
    } else {
      return false;
    }
  }

  [[nodiscard]] bool joins_last(const TimelineEntry& entry, const Estimator& estimator) const {
    return is_joint(entry, estimator) && !entries_.empty() &&
           entries_.back().stamp == entry.stamp && is_joint(entries_.back(), estimator);
  }

  /// The first of the sightings that are one measurement with that of a position.
  [[nodiscard]] std::size_t begin_of_joint(std::size_t position, const Estimator& estimator) const {
    std::size_t first = position;
    if (is_joint(entries_[position], estimator)) {
      while (first > 0 && entries_[first - 1].stamp == entries_[position].stamp &&
             is_joint(entries_[first - 1], estimator)) {
        --first;
      }
    }
    return first;
  }

  /// Restores the estimator that is kept nearest before a position; returns what it fuses next.
  std::size_t restore(std::size_t position, Estimator& estimator) {
    while (snapshots_used_ > 1 && last_snapshot().position > position) {
      --snapshots_used_;
    }
    if (instant_begin_ && *instant_begin_ <= position &&
        *instant_begin_ > last_snapshot().position) {
      estimator = *before_instant_;
      return *instant_begin_;
    }
    estimator = last_snapshot().estimator;
    return last_snapshot().position;
  }

  /// Restores what is kept before a position and fuses what follows; the sink receives outcomes
  /// from that position on.
  template <class Sink>
  void fuse_again(std::size_t position, Estimator& estimator, Sink& sink) {
    const std::size_t next = restore(position, estimator);
    fuse_from(next, position, entries_.size(), estimator, sink);
  }

  /// Fuses entries from `next` to `end`; the sink receives outcomes from `position` on.
  template <class Sink>
  void fuse_from(std::size_t next, std::size_t position, std::size_t end, Estimator& estimator,
                 Sink& sink) {
    while (next < end) {
      if (is_snapshot_due(next, entries_[next].stamp)) {
        take_snapshot(next, estimator);
      }
      if constexpr (kMayFuseJointly<Estimator>) {
        if (is_joint(entries_[next], estimator)) {
          next = fuse_joint(next, position, estimator, sink);
          continue;
        }
      }
      const Outcome outcome = estimator.on(entries_[next].message);
      if (next >= position) {
        sink(entries_[next].index, outcome);
      }
      ++next;
    }
  }

  /// Fuses the sightings of one instant; returns where they end.
  template <class Sink>
  std::size_t fuse_joint(std::size_t first, std::size_t position, Estimator& estimator,
                         Sink& sink) {
    std::vector<RangeBearing> sightings;
    std::size_t end = first;
    while (end < entries_.size() && entries_[end].stamp == entries_[first].stamp &&
           is_joint(entries_[end], estimator)) {
      sightings.push_back(std::get<RangeBearing>(entries_[end++].message));
    }
    const std::vector<Outcome> outcomes = estimator.on_joint(sightings);
    for (std::size_t i = std::max(first, position); i < end; ++i) {
      sink(entries_[i].index, outcomes[i - first]);
    }
    return end;
  }

  [[nodiscard]] const Snapshot& last_snapshot() const { return snapshots_[snapshots_used_ - 1]; }

  /// Whether it is time for a snapshot before a message.
  [[nodiscard]] bool is_snapshot_due(std::size_t position, Stamp stamp) const {
    if (snapshots_used_ == 0) {
      return true;
    }
    const std::size_t last = last_snapshot().position;
    if constexpr (kFewSnapshots < Estimator >> 0) {
      const bool is_time =
          last < position && stamp - entries_[last].stamp >= length_ / kFewSnapshots<Estimator>;
      const bool are_many = position >= last + max_messages_ / (2 * kFewSnapshots<Estimator>);
      if (!is_time && !are_many) {
        return false;
      }
    }
    if constexpr (kHasCostly<Estimator>) {
      if (position > last && Estimator::is_costly(entries_[position - 1].message)) {
        return true;
      }
    }
    return position >= last + kSnapshotInterval;
  }

  void drop_unused() {
    snapshots_.erase(snapshots_.begin() + static_cast<std::ptrdiff_t>(snapshots_used_),
                     snapshots_.end());
  }

  void take_snapshot(std::size_t position, const Estimator& estimator) {
    if constexpr (kFewSnapshots < Estimator >> 0) {  // none keeps the memory of a larger one
      drop_unused();
    }
    if (snapshots_used_ == snapshots_.size()) {
      snapshots_.push_back({position, estimator});
    } else {  // reuse memory
      snapshots_[snapshots_used_].position = position;
      snapshots_[snapshots_used_].estimator = estimator;
    }
    ++snapshots_used_;
  }

  /// Drops messages that no late one can reach any more, once they are half of all: so each message
  /// is moved once on average.
  void drop_expired() {
    const Stamp horizon = entries_.back().stamp - length_;
    std::size_t keep = 0;
    while (keep + 1 < snapshots_used_ && entries_[snapshots_[keep + 1].position].stamp < horizon) {
      ++keep;
    }
    if (keep * 2 >= snapshots_used_ || (kFewSnapshots < Estimator >> 0 && keep > 0)) {
      drop_before(keep);
    }
  }

  void drop_before(std::size_t snapshot) {
    const std::size_t dropped = snapshots_[snapshot].position;
    if (dropped > 0) {
      forgotten_until_ = entries_[dropped - 1].stamp;
    }
    entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(dropped));
    if (joint_begin_ && *joint_begin_ >= dropped) {
      *joint_begin_ -= dropped;
    } else {
      joint_begin_.reset();
    }
    instant_begin_.reset();
    std::rotate(snapshots_.begin(), snapshots_.begin() + static_cast<std::ptrdiff_t>(snapshot),
                snapshots_.begin() + static_cast<std::ptrdiff_t>(snapshots_used_));
    snapshots_used_ -= snapshot;
    if constexpr (kFewSnapshots < Estimator >> 0) {
      drop_unused();
    }
    for (std::size_t i = 0; i < snapshots_used_; ++i) {
      snapshots_[i].position -= dropped;
    }
  }

  Stamp length_;
  std::size_t max_messages_;
  Stamp forgotten_until_ = std::numeric_limits<Stamp>::min();
  std::vector<TimelineEntry> entries_;  // sorted; the oldest has a snapshot
  std::vector<Snapshot> snapshots_;     // the first snapshots_used_ are valid
  std::size_t snapshots_used_ = 0;
  std::optional<std::size_t> joint_begin_;    // of the last sightings that are fused jointly
  std::optional<Estimator> before_joint_;     // the estimator there
  std::optional<std::size_t> instant_begin_;  // of the last stamp, where its order mattered
  std::optional<Estimator> before_instant_;   // the estimator there
};

}  // namespace locfuse::internal
