// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <type_traits>
#include <variant>

#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Variant of all messages: the register of sensors in C++. Code that handles all of them visits
/// it, so that the compiler reports where a new one is missing.
using Message = std::variant<Velocity, Increment, Range, PositionFix, PoseObservation, RangeBearing,
                             Altitude, LaserScan, Imu, Heading>;

/// Stamp at which a message takes effect: its own, or for an Increment the beginning of the motion.
[[nodiscard]] inline Stamp effective_stamp(const Increment& message) { return message.begin; }
template <class M>
[[nodiscard]] Stamp effective_stamp(const M& message) {
  return message.stamp;
}
[[nodiscard]] inline Stamp effective_stamp(const Message& message) {
  return std::visit([](const auto& m) { return effective_stamp(m); }, message);
}

/// Stamp of the measurement, the earliest at which it can be known.
[[nodiscard]] inline Stamp stamp_of(const Message& message) {
  return std::visit([](const auto& m) { return m.stamp; }, message);
}

/// Kind of source of a message.
enum class Source : std::uint8_t {
  kOdometry,
  kRanges,
  kPositions,
  kPoses,
  kSightings,
  kScans,
  kAltitudes,
  kHeadings,
  kImu
};
constexpr std::size_t kSources = 9;

[[nodiscard]] inline Source source_of(const Message& message) {
  constexpr Source kOf[] = {Source::kOdometry,  Source::kOdometry, Source::kRanges,
                            Source::kPositions, Source::kPoses,    Source::kSightings,
                            Source::kAltitudes, Source::kScans,    Source::kImu,
                            Source::kHeadings};
  static_assert(std::size(kOf) == std::variant_size_v<Message>);
  return kOf[message.index()];
}

/// Throws std::invalid_argument unless the message is valid, a sighting as one from a flying body:
/// an estimator in the plane refuses its elevation.
inline void validate_in_space(const Message& message) {
  std::visit(
      [](const auto& m) {
        if constexpr (std::is_same_v<std::decay_t<decltype(m)>, RangeBearing>) {
          validate_in_space(m);
        } else {
          validate(m);
        }
      },
      message);
}

/// The order of fusion: by effective stamp, at equal ones odometry and Imu first and scans last,
/// between them by kind in the order of Message, by ids, and by what they say. Odometry is by the
/// end of the motion, and as it arrives where that is equal, too: there the last one holds.
[[nodiscard]] bool precedes(const Message& a, const Message& b);

/// Message of a source whose stamps are late by `delay` [ns], with corrected stamps.
template <class M>
[[nodiscard]] M earlier(M message, Stamp delay) {
  message.stamp -= delay;
  if constexpr (std::is_same_v<M, Increment>) {
    message.begin -= delay;
  }
  return message;
}
[[nodiscard]] inline Message earlier(const Message& message, Stamp delay) {
  return std::visit([&](const auto& m) -> Message { return earlier(m, delay); }, message);
}

}  // namespace locfuse
