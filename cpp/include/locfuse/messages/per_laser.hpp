// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

#include "locfuse/messages/messages.hpp"

namespace locfuse::internal {

/// Whether two geometries are of one laser: their mounts are equal to the bit. What else they say
/// may change from scan to scan.
[[nodiscard]] inline bool are_of_one_laser(const LaserGeometry& a, const LaserGeometry& b) {
  const Pose2& mount = a.pose_in_body;
  const Pose2& other = b.pose_in_body;
  return mount.x == other.x && mount.y == other.y && mount.heading == other.heading;
}

/// Lasers of a body that are kept apart. Of one that moves on the body each scan is another's.
constexpr std::size_t kMaxLasers = 16;

/// A value for each laser of a body, by valid scans; of more than kMaxLasers for those that came
/// last. Allocates for the first scan of a laser only.
template <class T>
class PerLaser {
 public:
  [[nodiscard]] bool empty() const { return entries_.empty(); }
  void clear() { entries_.clear(); }

  /// Null for a laser that has none.
  [[nodiscard]] const T* find(const LaserScan& scan) const {
    const auto found = std::find_if(entries_.begin(), entries_.end(), is_of(scan));
    return found != entries_.end() ? &found->value : nullptr;
  }

  void set(const LaserScan& scan, const T& value) {
    const auto found = std::find_if(entries_.begin(), entries_.end(), is_of(scan));
    if (found != entries_.end()) {
      found->value = value;
      return;
    }
    if (entries_.size() == kMaxLasers) {
      entries_.erase(entries_.begin());
    }
    entries_.push_back({scan.geometry, value});
  }

  /// Calls `change` with the value of every laser.
  template <class Change>
  void for_each(const Change& change) {
    for (Entry& entry : entries_) {
      change(entry.value);
    }
  }

 private:
  struct Entry {
    std::shared_ptr<const LaserGeometry> geometry;
    T value;
  };

  [[nodiscard]] static auto is_of(const LaserScan& scan) {
    return
        [&scan](const Entry& entry) { return are_of_one_laser(*entry.geometry, *scan.geometry); };
  }

  std::vector<Entry> entries_;
};

}  // namespace locfuse::internal
