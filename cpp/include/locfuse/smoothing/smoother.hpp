// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/message.hpp"

namespace locfuse {

/// How a log is smoothed: all poses at once, by all messages; docs/smoothing.md.
struct SmootherConfig {
  /// Of the models, their gates and noise, and of the filter that gives the first guess. Of its
  /// calibration `sigma_anchor_offset_m` is estimated, one constant an anchor. With
  /// `correlation_s` covariances are those of errors that last, eq. (7) of the page.
  PoseEkf::Config estimator;
  double keyframe_s = 0.2;   ///< without measurements there is a pose at least so often [s]
  int max_iterations = 100;  ///< of the solver, each time it is called
};

/// What all messages together say.
struct Smoothed {
  /// At each stamp of a measurement, and each `keyframe_s` of odometry between, with the marginal
  /// covariance.
  std::vector<PoseEstimate> poses;
  /// One for each message, in their order. Of a measurement `nis` is its squared residual in sigmas
  /// of its own noise; kGated is one that was judged wrong.
  std::vector<Outcome> outcomes;
  std::vector<CalibratedError> errors;  ///< offsets of anchors
  double initial_cost = 0.0;  ///< half the sum of squared whitened residuals of the first guess
  double cost = 0.0;          ///< of the result
  int iterations = 0;
  bool converged = false;
  std::string termination;  ///< what the solver said last
};

/// Smooths messages, in any order, from `start` on. It uses odometry, ranges, positions, poses and
/// sightings of landmarks by name; others are kIgnored, and kStale what is before the start.
///
/// Throws std::invalid_argument on a config out of range, a message that is not valid, or where
/// nothing was measured after the start; NumericalError where the solver fails.
[[nodiscard]] Smoothed smooth(const SmootherConfig& config, const World& world,
                              const PoseEstimate& start, const std::vector<Message>& messages);

}  // namespace locfuse
