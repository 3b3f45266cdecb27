// SPDX-License-Identifier: Apache-2.0
#include "locfuse/messages/limits.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace locfuse {
namespace {

constexpr double kStampJitter = 0.1;  // [s]
constexpr double kMaxLimit = 1e12;    // finite in single precision after any time

void require(const char* name, double value) {
  if (!(value > 0.0 && value <= kMaxLimit)) {
    throw std::invalid_argument(std::string("limits.") + name + " is " + std::to_string(value) +
                                ", expected more than 0, at most 1e12");
  }
}

}  // namespace

void validate(const Limits& limits) {
  require("speed_mps", limits.speed_mps);
  require("turn_rate_radps", limits.turn_rate_radps);
  require("range_m", limits.range_m);
  require("distance_m", limits.distance_m);
}

bool is_plausible(const Velocity& message, const Limits& limits) {
  return Vector<2>(message.forward, message.left).norm() <= limits.speed_mps &&
         std::abs(message.turn_rate) <= limits.turn_rate_radps;
}

bool is_plausible(const Increment& message, const Limits& limits) {
  const double seconds = seconds_between(message.begin, message.stamp) + kStampJitter;
  return message.motion.position().norm() <= limits.speed_mps * seconds &&
         std::abs(message.motion.heading) <= limits.turn_rate_radps * seconds;
}

bool is_plausible(const Range& message, const Limits& limits) {
  return message.range <= limits.range_m;
}

bool is_plausible(const PositionFix& message, const Limits& limits) {
  return message.position.norm() <= limits.distance_m;
}

bool is_plausible(const PoseObservation& message, const Limits& limits) {
  return message.pose.position().norm() <= limits.distance_m;
}

bool is_plausible(const Altitude& message, const Limits& limits) {
  return std::abs(message.height) <= limits.distance_m;
}

bool is_plausible(const Heading& /*message*/, const Limits& /*limits*/) { return true; }

bool is_plausible(const RangeBearing& message, const Limits& limits) {
  return message.range.value_or(0.0) <= limits.range_m;
}

}  // namespace locfuse
