// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// A motion that an OdometryTimeline makes when a message ends it.
struct MadeMotion {
  /// Of a message that nothing was made of.
  static constexpr std::size_t kNoOrigin = std::numeric_limits<std::size_t>::max();

  std::size_t origin = kNoOrigin;  ///< number of that message, in order of arrival
  bool again = false;              ///< in place of the motion of that origin, after a late message
  bool slipped = false;            ///< gyro and wheels contradict each other
  Increment increment;
};

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
