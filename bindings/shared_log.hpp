// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

#include "locfuse/replay/message_log.hpp"

/// A log that is replayed or grown without the GIL. `uses` changes under the GIL only.
struct SharedLog {
  locfuse::MessageLog log;
  int uses = 0;  // replays that go on, or -1 while it changes
};

/// One use of a log, refused where another use goes on that it would disturb. Made before the GIL
/// is released, destroyed after it is back.
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
