// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "locfuse/messages/messages.hpp"
#include "locfuse/models/motion/odometry.hpp"

/// What the recipes of estimators have in common.
namespace locfuse::internal {

inline double positive(const char* name, double value) {
  if (!(std::isfinite(value) && value > 0.0)) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                                ", expected a finite number > 0");
  }
  return value;
}

inline Stamp stamps_of(const char* name, double seconds) {
  constexpr double kForever = 1e9;  // 32 years: end of a hold and any clock's time fit in a Stamp
  return static_cast<Stamp>(std::min(positive(name, seconds), kForever) * kNanosecondsPerSecond);
}

template <class Config>
Stamp hold_of(const Config& config) {
  return stamps_of("hold_s", config.hold_s);
}

/// Standing where nothing is known of the motion any more.
template <class Config>
OdometryMotion lost_motion(const Config& config) {
  OdometryMotion::Config lost = config.odometry;
  lost.sigma_xy_per_sqrt_s = positive("sigma_lost_xy_per_sqrt_s", config.sigma_lost_xy_per_sqrt_s);
  lost.sigma_heading_per_sqrt_s =
      positive("sigma_lost_heading_per_sqrt_s", config.sigma_lost_heading_per_sqrt_s);
  return OdometryMotion(lost);
}

/// Throws std::invalid_argument unless all are valid and of one stamp.
template <class M>
void validate_together(const char* what, const std::vector<M>& messages) {
  for (const M& message : messages) {
    validate(message);
    if (message.stamp != messages.front().stamp) {
      throw std::invalid_argument(std::string(what) + " have stamps " +
                                  std::to_string(messages.front().stamp) + " and " +
                                  std::to_string(message.stamp) + " ns, expected one stamp");
    }
  }
}

}  // namespace locfuse::internal
