// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/message_log.hpp"

#include <algorithm>

namespace locfuse {

void MessageLog::add(const Message& message, Stamp arrival) {
  std::visit([](const auto& m) { validate(m); }, message);
  arrivals_.push_back({arrival, message});
}

void MessageLog::sort() {
  const auto earlier = [](const Arrival& a, const Arrival& b) { return a.arrival < b.arrival; };
  if (!std::is_sorted(arrivals_.begin(), arrivals_.end(), earlier)) {
    std::stable_sort(arrivals_.begin(), arrivals_.end(), earlier);
  }
}

}  // namespace locfuse
