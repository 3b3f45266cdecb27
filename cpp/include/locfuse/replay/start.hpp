// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/estimators/initializer.hpp"
#include "locfuse/replay/message_log.hpp"

namespace locfuse {

/// How a start went.
struct StartRun {
  struct Step {
    Stamp stamp;
    Initializer::State state;
  };
  std::size_t consumed = 0;  ///< messages used
  std::vector<Step> steps;   ///< whenever status or number of hypotheses changed
};

/// Feeds a sorted log and scans, in order of their stamps, until the initializer is ready or both
/// end. At equal stamps messages come before scans.
[[nodiscard]] StartRun find_start(Initializer& initializer, const MessageLog& log,
                                  const std::vector<LaserScan>& scans);

}  // namespace locfuse
