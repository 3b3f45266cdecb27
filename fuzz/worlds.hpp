// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/replay/timeline.hpp"
#include "messages.hpp"
#include "support/robot.hpp"
#include "support/rooms.hpp"

/// Maps, anchors and starts of the fuzz targets.
namespace locfuse::fuzz {

[[nodiscard]] inline std::shared_ptr<const LandmarkMap> poles() {
  static const auto map = std::make_shared<const LandmarkMap>(
      std::vector<Landmark>{{0, {4.0, 3.0}}, {1, {-5.0, 6.0}}, {2, {2.0, -7.0}}, {3, {4.2, 3.1}}});
  return map;
}

/// A room of 8 x 6 m on a map of 20 cm cells.
[[nodiscard]] inline std::shared_ptr<const OccupancyGrid> small_room() {
  static const auto map = testing::map_of(testing::room_around({}), 48, 40, 0.2, {-4.8, -4.0, 0.0});
  return map;
}

[[nodiscard]] inline PoseEstimate start() {
  return {0, {2.0, -1.0, 0.4}, Vector<3>(0.01, 0.01, 0.0025).asDiagonal()};
}

template <class Io>
void code(Io& io, PoseEstimate& start) {
  Stamp now = 0;
  code(io, start.stamp, now);
  code(io, start.pose, 30.0);
  code(io, start.covariance, 10.0);
}

/// Messages in the order in which a Timeline fuses them.
inline void sort_for_fusion(std::vector<Message>& messages) {
  std::stable_sort(messages.begin(), messages.end(), precedes);
}

template <class Io>
void code(Io& io, TimelineOptions& options) {
  auto jump = static_cast<std::uint8_t>(options.clock_jump);
  auto jump_after = static_cast<std::uint8_t>(options.jump_after);
  code(io, jump, 3);
  code(io, jump_after, 40);
  options.clock_jump = static_cast<ClockJump>(jump);
  options.jump_after = jump_after;
}

/// Noise shapes of a filter. One-sided noise applies to ranges only; for the others it becomes
/// Gaussian.
template <class Io, class Config>
void code_noise(Io& io, Config& config) {
  for (NoiseKind* kind : {&config.range.noise, &config.position.noise, &config.pose.noise}) {
    auto shape = static_cast<std::uint8_t>(*kind);
    code(io, shape, 4);
    *kind = static_cast<NoiseKind>(shape);
    if (kind != &config.range.noise && *kind == NoiseKind::kOneSided) {
      *kind = NoiseKind::kGaussian;
    }
  }
  code(io, config.robust_dof, 1.0, 30.0);
  code(io, config.robust_late_share, 0.01, 0.5);
}

/// Settings that select code paths of a PoseEkf: calibration states, estimated or considered, and
/// noise shapes.
template <class Io>
void code(Io& io, PoseEkf::Config& config) {
  auto way = static_cast<std::uint8_t>(config.calibration.sigma_scale == 0.0 ? 0
                                       : config.calibration.consider         ? 2
                                                                             : 1);
  code(io, way, 3);
  if (way > 0) {
    const double correlation_s = way == 2 ? 0.0 : 5.0;
    config.calibration = {0.05, 0.05, 0.05,          0.01, 0.001, 0.05, 0.02, 0.1,     0.02,
                          0.05, 0.2,  correlation_s, 0.01, 0.05,  kPi,  0.03, way == 2};
  }
  code_noise(io, config);
}

[[nodiscard]] inline PoseEstimate read_start(Reader& io) {
  PoseEstimate start{0, {}, Matrix<3, 3>::Zero()};
  code(io, start);
  return start;
}

}  // namespace locfuse::fuzz
