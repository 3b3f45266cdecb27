// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <type_traits>
#include <variant>

#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Every message there is: the one register of sensors in C++. Code that must know all of them
/// visits it, so the compiler lists what a new one still lacks.
using Message =
    std::variant<Velocity, Increment, Range, PositionFix, PoseObservation, RangeBearing>;

/// When a message takes effect: its stamp, but the beginning of the motion for an Increment.
[[nodiscard]] inline Stamp effective_stamp(const Increment& message) { return message.begin; }
template <class M>
[[nodiscard]] Stamp effective_stamp(const M& message) {
  return message.stamp;
}
[[nodiscard]] inline Stamp effective_stamp(const Message& message) {
  return std::visit([](const auto& m) { return effective_stamp(m); }, message);
}

/// When a message was taken, which is when it can be known at the earliest.
[[nodiscard]] inline Stamp stamp_of(const Message& message) {
  return std::visit([](const auto& m) { return m.stamp; }, message);
}

/// What a message comes from.
/// Scans are no Message, as they find a start or weigh particles, but a source like the others.
enum class Source : std::uint8_t { kOdometry, kRanges, kPositions, kPoses, kSightings, kScans };
constexpr std::size_t kSources = 6;

[[nodiscard]] inline Source source_of(const Message& message) {
  constexpr Source kOf[] = {Source::kOdometry,  Source::kOdometry, Source::kRanges,
                            Source::kPositions, Source::kPoses,    Source::kSightings};
  static_assert(std::size(kOf) == std::variant_size_v<Message>);
  return kOf[message.index()];
}

/// A message of a source whose stamps are late by `delay` [ns], at the stamp at which it was taken.
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
