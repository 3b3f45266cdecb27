// SPDX-License-Identifier: Apache-2.0
#include "locfuse/messages/message.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <tuple>
#include <type_traits>

namespace locfuse {
namespace {

int rank_of(const Message& message) {
  const Source source = source_of(message);
  const bool moves = source == Source::kOdometry || source == Source::kImu;
  return moves ? 0 : source == Source::kScans ? 2 : 1;
}

constexpr std::int64_t kNoId = std::numeric_limits<std::int64_t>::min();

std::int64_t number_of(const std::optional<Id>& id) { return id ? *id : kNoId; }

/// A number for any double, in their order; NaN has a place, too.
std::uint64_t bits_of(double value) {
  constexpr std::uint64_t kSign = std::uint64_t{1} << 63U;
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  return (bits & kSign) != 0 ? ~bits : bits | kSign;
}
std::uint64_t bits_of(const std::optional<double>& value) {
  return value ? bits_of(*value) : std::numeric_limits<std::uint64_t>::max();
}

using Key = std::tuple<std::int64_t, std::int64_t, std::array<std::uint64_t, 5>>;

Key key_of(const Range& z) { return {z.anchor, z.tag, {bits_of(z.range), bits_of(z.sigma)}}; }
Key key_of(const PositionFix& z) {
  return {number_of(z.tag),
          0,
          {bits_of(z.position.x()), bits_of(z.position.y()), bits_of(z.covariance(0, 0)),
           bits_of(z.covariance(1, 1)), bits_of(z.covariance(0, 1))}};
}
Key key_of(const PoseObservation& z) {
  return {0,
          0,
          {bits_of(z.pose.x), bits_of(z.pose.y), bits_of(z.pose.heading),
           bits_of(z.covariance(0, 0)), bits_of(z.covariance(2, 2))}};
}
Key key_of(const Altitude& z) { return {0, 0, {bits_of(z.height), bits_of(z.sigma)}}; }
Key key_of(const Heading& z) {
  return {z.is_course ? 1 : 0, 0, {bits_of(z.heading), bits_of(z.sigma)}};
}
Key key_of(const RangeBearing& z) {
  return {number_of(z.landmark),
          0,
          {bits_of(z.bearing), bits_of(z.range), bits_of(z.elevation),
           z.covariance ? bits_of((*z.covariance)(0, 0)) : 0,
           z.covariance ? bits_of((*z.covariance)(1, 1)) : 0}};
}
Key key_of(const Imu& z) {
  const Vector<3> force = z.specific_force.value_or(Vector<3>::Zero());
  return {z.specific_force ? 1 : 0,
          static_cast<std::int64_t>(bits_of(force.y())),
          {bits_of(z.angular_rate.x()), bits_of(z.angular_rate.y()), bits_of(z.angular_rate.z()),
           bits_of(force.x()), bits_of(force.z())}};
}
Key key_of(const LaserScan& z) {
  const Pose2 mount = z.geometry ? z.geometry->pose_in_body : Pose2{};
  return {static_cast<std::int64_t>(z.ranges.size()),
          0,
          {bits_of(mount.x), bits_of(mount.y), bits_of(mount.heading)}};
}

/// The first of the key, which mostly decides.
std::int64_t id_of(const Range& z) { return z.anchor; }
std::int64_t id_of(const PositionFix& z) { return number_of(z.tag); }
std::int64_t id_of(const RangeBearing& z) { return number_of(z.landmark); }
template <class M>
std::int64_t id_of(const M& /*z*/) {
  return 0;
}

template <class M>
bool is_less(const M& a, const M& b) {
  return id_of(a) != id_of(b) ? id_of(a) < id_of(b) : key_of(a) < key_of(b);
}
bool is_less(const LaserScan& a, const LaserScan& b) {
  if (key_of(a) != key_of(b)) {
    return key_of(a) < key_of(b);
  }
  return std::lexicographical_compare(
      a.ranges.begin(), a.ranges.end(), b.ranges.begin(), b.ranges.end(),
      [](double one, double other) { return bits_of(one) < bits_of(other); });
}

}  // namespace

bool precedes(const Message& a, const Message& b) {
  const Stamp stamp = effective_stamp(a);
  const Stamp other_stamp = effective_stamp(b);
  if (stamp != other_stamp) {
    return stamp < other_stamp;
  }
  const int rank = rank_of(a);
  const int other_rank = rank_of(b);
  if (rank != other_rank) {
    return rank < other_rank;
  }
  if (rank == 0) {  // motions, whose order counts
    return stamp_of(a) < stamp_of(b);
  }
  if (a.index() != b.index()) {
    return a.index() < b.index();
  }
  return std::visit(
      [&](const auto& one) {
        using M = std::decay_t<decltype(one)>;
        if constexpr (std::is_same_v<M, Velocity> || std::is_same_v<M, Increment>) {
          return false;
        } else {
          return is_less(one, std::get<M>(b));
        }
      },
      a);
}

}  // namespace locfuse
