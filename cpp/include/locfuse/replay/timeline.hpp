// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/message.hpp"

namespace locfuse {

/// Feeds an estimator in order of (effective stamp, arrival), whatever order messages arrive in.
///
/// A late message inside the history is fused where it belongs: the snapshot before it is restored
/// and what followed is fused again, so the belief equals, bit for bit, that of the sorted log. A
/// message older than the history is kStale. A late message costs what followed it, plus at most
/// kStride more; one in order allocates nothing once the history has filled.
template <class Estimator>
class Timeline {
 public:
  /// `history` [ns] is how late a message may be. Throws std::invalid_argument if it is negative.
  Timeline(Estimator estimator, Stamp history)
      : estimator_(std::move(estimator)), history_(history) {
    if (history < 0) {
      throw std::invalid_argument("history is " + std::to_string(history) + " ns, expected >= 0");
    }
  }

  /// Takes the next arrival. `sink(index, outcome)` hears the outcome of every message fused, or
  /// fused again; `index` counts arrivals from 0. What the estimator throws for a message is passed
  /// on, and that message is forgotten.
  template <class Sink>
  void on(const Message& message, Sink&& sink) {
    const std::size_t index = arrivals_++;
    const Entry entry{effective_stamp(message), index, message};
    if (entries_.empty() || entry.stamp >= entries_.back().stamp) {
      append(entry, sink);
    } else if (entry.stamp < entries_.back().stamp - history_) {
      sink(index, Outcome{Verdict::kStale});
    } else {
      insert(entry, sink);
    }
  }

  [[nodiscard]] const Estimator& estimator() const { return estimator_; }

 private:
  static constexpr std::size_t kStride = 16;

  struct Entry {
    Stamp stamp;
    std::size_t index;
    Message message;
  };
  struct Snapshot {
    std::size_t position;  // in entries_, of the first one it has not seen
    Estimator estimator;
  };

  template <class Sink>
  void append(const Entry& entry, Sink& sink) {
    const bool taken =  // by a message that came here before and was refused
        snapshots_used_ > 0 && snapshots_[snapshots_used_ - 1].position == entries_.size();
    if (entries_.size() % kStride == 0 && !taken) {
      take_snapshot();
    }
    sink(entry.index, estimator_.on(entry.message));
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
    const std::size_t dropped = snapshots_[keep].position;
    entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(dropped));
    std::rotate(snapshots_.begin(), snapshots_.begin() + static_cast<std::ptrdiff_t>(keep),
                snapshots_.begin() + static_cast<std::ptrdiff_t>(snapshots_used_));
    snapshots_used_ -= keep;
    for (std::size_t i = 0; i < snapshots_used_; ++i) {
      snapshots_[i].position -= dropped;
    }
  }

  Estimator estimator_;
  Stamp history_;
  std::size_t arrivals_ = 0;
  std::vector<Entry> entries_;       // by (stamp, arrival); the oldest at a multiple of kStride
  std::vector<Snapshot> snapshots_;  // the first snapshots_used_ are valid
  std::size_t snapshots_used_ = 0;
};

}  // namespace locfuse
