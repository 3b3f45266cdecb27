// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/messages/reported_covariance.hpp"

/// What messages say that say nothing of the pose: docs/start.md eq. (1).
namespace locfuse::internal {

/// Log density of a message that may be anything within `span` [m], and any angle.
inline double log_anything(const Range& /*z*/, double span) { return -std::log(span); }
template <int N>
double log_anything(const Matrix<N, N>& covariance, double span) {
  double sum = 0.0;
  for (int axis = 0; axis < N; ++axis) {
    if (!is_reported<N>(covariance) || covariance(axis, axis) < kNotMeasured) {
      sum -= std::log(axis < 2 ? span : 2.0 * kPi);
    }
  }
  return sum;
}
inline double log_anything(const PositionFix& z, double span) {
  return log_anything<2>(z.covariance, span);
}
inline double log_anything(const PoseObservation& z, double span) {
  return log_anything<3>(z.covariance, span);
}
inline double log_anything(const Altitude& /*z*/, double span) { return -std::log(span); }
inline double log_anything(const Heading& /*z*/, double /*span*/) { return -std::log(2.0 * kPi); }
inline double log_anything(const RangeBearing& z, double span) {
  return (z.range ? -std::log(span) : 0.0) - (z.bearing ? std::log(2.0 * kPi) : 0.0) -
         (z.elevation ? std::log(kPi) : 0.0);
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
