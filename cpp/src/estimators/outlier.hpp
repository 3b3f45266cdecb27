// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/messages.hpp"

/// What messages say that say nothing of the pose: docs/start.md eq. (1).
namespace locfuse::internal {

/// Log density of a message that may be anything within `span` [m], and any angle.
inline double log_anything(const Range& /*z*/, double span) { return -std::log(span); }
inline double log_anything(const PositionFix& /*z*/, double span) { return -2.0 * std::log(span); }
inline double log_anything(const PoseObservation& /*z*/, double span) {
  return -2.0 * std::log(span) - std::log(2.0 * kPi);
}
inline double log_anything(const RangeBearing& z, double span) {
  return (z.range ? -std::log(span) : 0.0) - (z.bearing ? std::log(2.0 * kPi) : 0.0);
}

inline double log_sum(double a, double b) {
  const double high = std::max(a, b);
  return high + std::log1p(std::exp(std::min(a, b) - high));
}

/// Log density of a message under a belief, or of one that says nothing.
inline double log_density(const Outcome& outcome, double wrong_share, double log_anything) {
  return log_sum(std::log1p(-wrong_share) + outcome.log_likelihood(),
                 std::log(wrong_share) + log_anything);
}

}  // namespace locfuse::internal
