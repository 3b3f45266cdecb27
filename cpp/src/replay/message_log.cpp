// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/message_log.hpp"

#include <algorithm>
#include <unordered_set>
#include <utility>
#include <variant>

namespace locfuse {

void MessageLog::add(const Message& message, Stamp arrival) {
  validate_in_space(message);
  arrivals_.push_back({arrival, message});
}

std::vector<bool> MessageLog::replaced() const {
  std::unordered_set<std::size_t> origins;  // of later ones
  std::vector<bool> found;
  for (std::size_t i = arrivals_.size(); i-- > 0;) {
    const auto* motion = std::get_if<Increment>(&arrivals_[i].message);
    if (motion == nullptr || motion->origin == Increment::kNoOrigin) {
      continue;
    }
    if (origins.count(motion->origin) > 0) {
      found.resize(arrivals_.size());
      found[i] = true;
    }
    if (motion->again) {
      origins.insert(motion->origin);
    }
  }
  return found;
}

std::vector<MadeMotion> MessageLog::motions_from(std::size_t begin) const {
  std::vector<MadeMotion> motions;
  for (std::size_t i = begin; i < arrivals_.size(); ++i) {
    const auto* next = std::get_if<Increment>(&arrivals_[i].message);
    if (next == nullptr || next->origin == Increment::kNoOrigin) {
      break;
    }
    const bool belongs =
        i == begin || (next->again && arrivals_[i].arrival == arrivals_[begin].arrival);
    const bool is_of_next = std::any_of(motions.begin(), motions.end(), [&](const MadeMotion& m) {
      return m.origin == next->origin;
    });
    if (!belongs || is_of_next) {
      break;
    }
    motions.push_back({next->origin, next->again, false, *next});
  }
  return motions;
}

// Merges sorted runs: a log consists of a few columns, each sorted.
void MessageLog::sort() {
  const auto earlier = [](const Arrival& a, const Arrival& b) { return a.arrival < b.arrival; };
  std::vector<std::vector<Arrival>::iterator> bounds{arrivals_.begin()};
  while (bounds.back() != arrivals_.end()) {
    bounds.push_back(std::is_sorted_until(bounds.back(), arrivals_.end(), earlier));
  }
  while (bounds.size() > 2) {
    std::vector<std::vector<Arrival>::iterator> merged;
    for (std::size_t i = 0; i + 2 < bounds.size(); i += 2) {
      std::inplace_merge(bounds[i], bounds[i + 1], bounds[i + 2], earlier);
      merged.push_back(bounds[i]);
    }
    if (bounds.size() % 2 == 0) {  // an odd run is left over
      merged.push_back(bounds[bounds.size() - 2]);
    }
    merged.push_back(bounds.back());
    bounds = std::move(merged);
  }
}

}  // namespace locfuse
