// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <vector>

#include "locfuse/replay/message_log.hpp"

/// Log that is replayed or extended without the GIL. `uses` changes only while holding the GIL.
struct SharedLog {
  locfuse::MessageLog log;
  int uses = 0;  // number of running replays, or -1 while the log is modified
};

/// The messages of a log in order of arrival.
inline std::vector<locfuse::Message> messages_of(const locfuse::MessageLog& log) {
  std::vector<locfuse::Message> messages;
  messages.reserve(log.arrivals().size());
  for (const locfuse::MessageLog::Arrival& arrival : log.arrivals()) {
    messages.push_back(arrival.message);
  }
  return messages;
}

/// Guard for one use of a log: throws std::runtime_error if a conflicting use is running. Construct
/// it before the GIL is released and destroy it after the GIL is reacquired.
class Use {
 public:
  enum class Kind { kRead, kChange };
  Use(SharedLog& log, Kind kind) : log_(log) {
    if (log.uses < 0 || (kind == Kind::kChange && log.uses > 0)) {
      throw std::runtime_error("this MessageLog is in use by another call; wait until it is done");
    }
    log.uses = kind == Kind::kChange ? -1 : log.uses + 1;
  }
  ~Use() { log_.uses = log_.uses < 0 ? 0 : log_.uses - 1; }
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;

 private:
  SharedLog& log_;
};
