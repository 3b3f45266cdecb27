// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/replay/clock_jump.hpp"

namespace locfuse::internal {

/// Fused messages in order, with snapshots of the estimator every kSnapshotInterval of them, from
/// which a late message and those after it are fused again.
template <class Estimator>
class MessageHistory {
 public:
  static constexpr std::size_t kSnapshotInterval = 16;
  /// Messages that are kept at least.
  static constexpr std::size_t kMinMessages = 2 * kSnapshotInterval * kSnapshotInterval;

  /// `length` [ns] is how late a message may be.
  explicit MessageHistory(Stamp length) : length_(length) {}

  [[nodiscard]] std::size_t size() const { return entries_.size(); }
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
    snapshots_used_ = 0;
    forgotten_until_ = std::numeric_limits<Stamp>::min();
  }

  /// Fuses a message where it belongs. `sink(index, outcome)` receives the outcome of each message
  /// fused. What the estimator throws is passed on, and the message is forgotten.
  template <class Sink>
  void fuse(const TimelineEntry& entry, Estimator& estimator, Sink& sink) {
    if (entries_.empty() || entry.stamp >= entries_.back().stamp) {
      append(entry, estimator, sink);
    } else {
      insert(entry, estimator, sink);
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
  void append(const TimelineEntry& entry, Estimator& estimator, Sink& sink) {
    const bool has_snapshot =  // taken before a message here that was refused
        snapshots_used_ > 0 && last_snapshot().position == entries_.size();
    if (entries_.size() % kSnapshotInterval == 0 && !has_snapshot) {
      take_snapshot(entries_.size(), estimator);
    }
    try {
      sink(entry.index, estimator.on(entry.message));
    } catch (...) {  // the estimator may have changed
      fuse_again(entries_.size(), estimator, sink);
      throw;
    }
    entries_.push_back(entry);
    if (entries_.size() >= kSnapshotInterval * kSnapshotInterval) {
      drop_expired();
    }
  }

  template <class Sink>
  void insert(const TimelineEntry& entry, Estimator& estimator, Sink& sink) {
    const auto later = [](Stamp stamp, const TimelineEntry& e) { return stamp < e.stamp; };
    const auto place = std::upper_bound(entries_.begin(), entries_.end(), entry.stamp, later);
    const auto position = static_cast<std::size_t>(place - entries_.begin());
    entries_.insert(place, entry);
    try {
      fuse_again(position, estimator, sink);
    } catch (...) {
      entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(position));
      fuse_again(position, estimator, sink);
      throw;
    }
  }

  /// Restores the snapshot before a position and fuses what follows; the sink receives outcomes
  /// from that position on.
  template <class Sink>
  void fuse_again(std::size_t position, Estimator& estimator, Sink& sink) {
    while (snapshots_used_ > 1 && last_snapshot().position > position) {
      --snapshots_used_;
    }
    std::size_t next = last_snapshot().position;
    estimator = last_snapshot().estimator;
    for (; next < entries_.size(); ++next) {
      if (next % kSnapshotInterval == 0 && next > last_snapshot().position) {
        take_snapshot(next, estimator);
      }
      const Outcome outcome = estimator.on(entries_[next].message);
      if (next >= position) {
        sink(entries_[next].index, outcome);
      }
    }
  }

  [[nodiscard]] const Snapshot& last_snapshot() const { return snapshots_[snapshots_used_ - 1]; }

  void take_snapshot(std::size_t position, const Estimator& estimator) {
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
    if (keep * 2 >= snapshots_used_) {
      drop_before(keep);
    }
  }

  void drop_before(std::size_t snapshot) {
    const std::size_t dropped = snapshots_[snapshot].position;
    if (dropped > 0) {
      forgotten_until_ = entries_[dropped - 1].stamp;
    }
    entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(dropped));
    std::rotate(snapshots_.begin(), snapshots_.begin() + static_cast<std::ptrdiff_t>(snapshot),
                snapshots_.begin() + static_cast<std::ptrdiff_t>(snapshots_used_));
    snapshots_used_ -= snapshot;
    for (std::size_t i = 0; i < snapshots_used_; ++i) {
      snapshots_[i].position -= dropped;
    }
  }

  Stamp length_;
  Stamp forgotten_until_ = std::numeric_limits<Stamp>::min();
  std::vector<TimelineEntry>
      entries_;  // by (stamp, arrival); the oldest at a multiple of kSnapshotInterval
  std::vector<Snapshot> snapshots_;  // the first snapshots_used_ are valid
  std::size_t snapshots_used_ = 0;
};

}  // namespace locfuse::internal
