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

/// A number on which measurements of many poses depend: a coordinate of an anchor, its offset.
struct SharedVariable {
  double guess = 0.0;
  double mean = 0.0;  ///< before anything is measured
  double sigma = 0.0;
  bool is_climb = false;  ///< a squared height over the tags
};

/// Shared variables of one measurement, at the most: a range's anchor (x, y, z), its tag (forward,
/// left), and offset and scale.
inline constexpr int kMaxShared = 7;

/// In this order; of other measurements the first two or none.
enum RangeVariable : std::size_t { kX, kY, kZ, kForward, kLeft, kOffset, kScale };

/// Which shared variables a measurement depends on; -1 where it has no more.
using SharedPlaces = std::array<int, kMaxShared>;
inline constexpr SharedPlaces kNothingShared = {-1, -1, -1, -1, -1, -1, -1};

/// z minus h(x), its derivatives and R.
struct MeasuredRows {
  using Shared = Eigen::Matrix<double, Eigen::Dynamic, kMaxShared, Eigen::ColMajor, 3, kMaxShared>;
  Linearization<Eigen::Dynamic, 3, 3> by_pose;
  Shared by_shared;  ///< in the order of the measurement's shared variables
};

/// What a message says of one pose, and of variables that others share.
struct Measurement {
  using Values = std::array<double, kMaxShared>;
  std::size_t message = 0;  ///< place in the log
  std::size_t pose = 0;     ///< that it measures
  Source source = Source::kRanges;
  Id id = 0;           ///< of the anchor or landmark, else 0
  double limit = 0.0;  ///< of its squared residual, by its gate
  double dof = 0.0;    ///< of Student's noise; 0 where it is Gaussian
  SharedPlaces shared = kNothingShared;
  double wanders = 0.0;  ///< share of its variance that settings say does, for correlation_s
  /// With the values of its shared variables; empty where the model does not apply.
  std::function<std::optional<MeasuredRows>(const Pose2&, const Values&)> linearize = {};
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
  std::vector<SharedVariable> shared;
  std::vector<SharedPlaces> radios;             ///< of each anchor of the map, by RangeVariable
  std::vector<SharedPlaces> tags;               ///< of each tag: two
  std::vector<SharedPlaces> landmarks;          ///< of each landmark of the map: two
  std::array<LastingErrors, kSources> lasting;  ///< by Source
  std::vector<Outcome> outcomes;  ///< of each message; those of measurements are to come
};

/// Throws std::invalid_argument as `smooth`.
[[nodiscard]] PoseChain make_pose_chain(const SmootherConfig& config, const World& world,
                                        const PoseEstimate& start,
                                        const std::vector<Message>& messages);

}  // namespace locfuse::internal
