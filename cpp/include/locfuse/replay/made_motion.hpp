// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <variant>
#include <vector>

#include "locfuse/messages/message.hpp"

namespace locfuse {

/// A motion that an OdometryTimeline makes when a message ends it.
struct MadeMotion {
  std::size_t origin = Increment::kNoOrigin;  ///< number of that message, in order of arrival
  bool again = false;    ///< in place of the motion of that origin, after a late message
  bool slipped = false;  ///< gyro and wheels contradict each other
  Increment increment;

  /// The motion with its origin, as estimators take it.
  [[nodiscard]] Increment message() const {
    Increment numbered = increment;
    numbered.origin = origin;
    numbered.again = again;
    return numbered;
  }
};

/// The origin of a motion that was made; of all else Increment::kNoOrigin.
[[nodiscard]] inline std::size_t origin_of(const Message& message) {
  const auto* motion = std::get_if<Increment>(&message);
  return motion != nullptr ? motion->origin : Increment::kNoOrigin;
}

/// Whether motions that were made again cover those before: `find(origin)` gives the former motion,
/// or null. An estimator may have missed what made them shorter before; then it keeps what it has.
template <class Find>
[[nodiscard]] bool covers_those_before(const std::vector<MadeMotion>& motions, const Find& find) {
  Stamp begin = std::numeric_limits<Stamp>::max();
  Stamp end = std::numeric_limits<Stamp>::min();
  for (const MadeMotion& motion : motions) {
    begin = std::min(begin, motion.increment.begin);
    end = std::max(end, motion.increment.stamp);
  }
  return std::all_of(motions.begin(), motions.end(), [&](const MadeMotion& motion) {
    if (!motion.again) {
      return true;
    }
    const Increment* before = find(motion.origin);
    return before != nullptr && before->begin >= begin && before->stamp <= end;
  });
}

/// Whether some of the motions that one message changed were made before.
[[nodiscard]] inline bool are_made_again(const std::vector<MadeMotion>& motions) {
  return std::any_of(motions.begin(), motions.end(), [](const MadeMotion& m) { return m.again; });
}

}  // namespace locfuse
