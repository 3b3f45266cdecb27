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

/// A place that is found together with the poses: of an anchor (x, y, z in world), a landmark (x, y
/// in world) or a tag (forward, left in body). The world has the guess to start from.
struct UncertainPlace {
  Id id = 0;
  Vector<3> mean = Vector<3>::Zero();     ///< what is known before anything is measured [m]
  Vector<3> sigma_m = Vector<3>::Zero();  ///< of that, per axis; 0: the world is right
  double guess_sigma_m = 0.0;             ///< how far off the guess may be, for the first poses
  /// Of an anchor: the third mean and sigma are those of the square of its height over the tags,
  /// which are all at one height [m^2]. Of the two heights that fit, the upper one is reported.
  bool climbs = false;
};

/// How a log is smoothed: all poses at once, by all messages; docs/smoothing.md.
struct SmootherConfig {
  /// Of the models, their gates and noise, and of the filter that gives the first guess. Of its
  /// calibration `sigma_anchor_offset_m` and `sigma_anchor_scale` are estimated, one constant an
  /// anchor. With `correlation_s` covariances are those of errors that last, eq. (7) of the page.
  PoseEkf::Config estimator;
  double keyframe_s = 0.2;   ///< without measurements there is a pose at least so often [s]
  int max_iterations = 100;  ///< of the solver, each time it is called
  std::vector<UncertainPlace> anchors = {};    ///< of the map's those that are not exact
  std::vector<UncertainPlace> landmarks = {};  ///< z is not used
  std::vector<UncertainPlace> tags = {};       ///< z is not used
};

/// What all messages together say.
struct Smoothed {
  /// At each stamp of a measurement, and each `keyframe_s` of odometry between, with the marginal
  /// covariance.
  std::vector<PoseEstimate> poses;
  /// One for each message, in their order. Of a measurement `nis` is its squared residual in sigmas
  /// of its own noise; kGated is one that was judged wrong.
  std::vector<Outcome> outcomes;
  std::vector<CalibratedError> errors;  ///< offsets and scales of anchors
  std::vector<Anchor> anchors;          ///< those of the map, with the places and errors found
  std::vector<Landmark> landmarks;      ///< those of the map, with the places found
  std::vector<Tag> tags;                ///< those of the body, with the places found
  /// Of (x, y, z) of each of `anchors`, then (x, y) of each of `landmarks`, then (forward, left) of
  /// each of `tags` [m^2]; 0 where the place is exact.
  Eigen::MatrixXd places_covariance;
  double initial_cost = 0.0;  ///< half the sum of squared whitened residuals of the first guess
  double cost = 0.0;          ///< of the result, with that of each outlier at its limit
  int iterations = 0;
  bool converged = false;
  std::string termination;  ///< what the solver said last
};

/// Smooths messages, in any order, from `start` on. It uses odometry, ranges, positions, poses and
/// sightings of landmarks by name; others are kIgnored, and kStale what is before the start.
///
/// Throws std::invalid_argument on a config out of range, a place that the world does not have, a
/// message that is not valid, or where nothing was measured after the start; NumericalError where
/// the solver fails, or what is asked for is not determined.
[[nodiscard]] Smoothed smooth(const SmootherConfig& config, const World& world,
                              const PoseEstimate& start, const std::vector<Message>& messages);

}  // namespace locfuse
