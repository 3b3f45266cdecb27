// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "locfuse/filters/gate.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/smoothing/smoother.hpp"

namespace locfuse::internal {

/// What odometry says between two poses: eq. (2) of docs/smoothing.md.
struct RelativeMotion {
  Pose2 motion;             ///< in the frame of the first pose
  Matrix<3, 3> covariance;  ///< of the second pose, in the axes of the first
};

/// What a message says of one pose, and of the offset of an anchor if that is a variable.
struct Measurement {
  using Rows = Linearization<Eigen::Dynamic, 3, 3>;
  std::size_t message;  ///< place in the log
  std::size_t pose;     ///< that it measures
  Source source;
  Id id;           ///< of the anchor or landmark, else 0
  double limit;    ///< of its squared residual, by its gate
  double dof;      ///< of Student's noise; 0 where it is Gaussian
  int offset;      ///< which anchor's offset adds to its only row, or -1
  double wanders;  ///< share of its variance that settings say does, for correlation_s
  /// z minus h(x), H and R; empty where the model does not apply.
  std::function<std::optional<Rows>(const Pose2&)> linearize;
};

/// What innovations of the filter say of the errors of a kind of measurement: how much of their
/// variance lasts, how much of that all sources have in common, and how large it is over R.
struct LastingErrors {
  double share = 0.0;
  double common = 0.0;
  double factor = 1.0;
};

/// A log as poses at stamps, motions between and measurements of them.
struct PoseChain {
  std::vector<Stamp> stamps;
  std::vector<Pose2> guess;
  std::vector<RelativeMotion> motions;  ///< from each pose to the next
  std::vector<Measurement> measurements;
  std::vector<Id> anchors;                      ///< whose offsets are variables
  std::array<LastingErrors, kSources> lasting;  ///< by Source
  std::vector<Outcome> outcomes;  ///< of each message; those of measurements are to come
};

/// Throws std::invalid_argument as `smooth`.
[[nodiscard]] PoseChain make_pose_chain(const SmootherConfig& config, const World& world,
                                        const PoseEstimate& start,
                                        const std::vector<Message>& messages);

}  // namespace locfuse::internal
