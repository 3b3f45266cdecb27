// SPDX-License-Identifier: Apache-2.0
#pragma once

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

}  // namespace locfuse
