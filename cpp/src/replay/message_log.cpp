// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/message_log.hpp"

#include <algorithm>
#include <utility>

namespace locfuse {

void MessageLog::add(const Message& message, Stamp arrival) {
  validate_in_space(message);
  arrivals_.push_back({arrival, message});
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
