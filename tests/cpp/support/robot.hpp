// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"

namespace locfuse::testing {

constexpr Stamp kSecond = 1'000'000'000;

[[nodiscard]] inline Stamp at(double seconds) { return static_cast<Stamp>(seconds * 1e9); }

/// Four anchors, 0 to 3, in the corners of a hall at different heights.
[[nodiscard]] inline std::shared_ptr<const AnchorMap> hall() {
  return std::make_shared<AnchorMap>(std::vector<Anchor>{{0, {-10.0, -10.0, 2.0}},
                                                         {1, {10.0, -10.0, 3.0}},
                                                         {2, {10.0, 10.0, 2.5}},
                                                         {3, {-10.0, 10.0, 2.0}}});
}

/// A world with nothing but a landmark sensor, there on the body.
[[nodiscard]] inline World sensor_at(const Pose2& T_body_sensor) {
  World world;
  world.landmarks.T_body_sensor = T_body_sensor;
  return world;
}

/// Tag 0, off-centre.
[[nodiscard]] inline std::vector<Tag> one_tag() { return {{0, {0.3, -0.2, 1.0}}}; }

/// An estimate at `pose` with sigmas of 0.1 m and 0.05 rad.
[[nodiscard]] inline PoseEkf ekf_at(const Pose2& pose, const PoseEkf::Config& config = {}) {
  const Vector<3> variances(0.01, 0.01, 0.0025);
  return {config, {hall(), one_tag()}, {0, pose, variances.asDiagonal()}};
}

/// The range that tag 0 measures at `pose`, plus `error`.
[[nodiscard]] inline Range range_to(Id anchor, const Pose2& pose, Stamp stamp, double error = 0.0) {
  const Vector<2> tag = pose.act({0.3, -0.2});
  const Vector<3> a = hall()->anchors()[static_cast<std::size_t>(anchor)].position;
  return {stamp, 0, anchor, (Vector<3>(tag.x(), tag.y(), 1.0) - a).norm() + error, {}};
}

}  // namespace locfuse::testing
