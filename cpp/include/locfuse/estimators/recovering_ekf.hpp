// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/estimators/initializer.hpp"

namespace locfuse {

/// A PoseEkf that starts by itself, notices when it was carried away, and starts anew.
///
/// While it is lost an Initializer takes the messages: landmarks seen together, ranges, fixes and
/// poses start hypotheses until one wins. While it tracks, either of two cumulative sums of log
/// likelihood ratios raises the alarm (Page, 1954): measurements say nothing of where it believes
/// to be, or too many of them pass no gate. Derivation: docs/start.md.
///
/// Every `on` throws std::invalid_argument for a message that is not valid.
class RecoveringEkf {
 public:
  struct Config {
    PoseEkf::Config estimator;
    Initializer::Config start;
    /// Mean number of measurements before a false alarm is at least this, if as many are wrong as
    /// `start.wrong_share` says, each by itself.
    double measurements_per_false_alarm = 1e6;
  };

  /// Lost at first. Throws std::invalid_argument on a config out of range.
  RecoveringEkf(const Config& config, std::shared_ptr<const AnchorMap> anchors,
                std::vector<Tag> tags, std::shared_ptr<const ScanMatcher> matcher,
                LandmarkSight landmarks = {});

  /// Tracks from `start` on. Throws std::invalid_argument as a PoseEkf does.
  void start_at(const PoseEstimate& start);

  /// What became of it; kIgnored while lost: then it weighs hypotheses.
  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  Outcome on(const PoseObservation& z);
  Outcome on(const RangeBearing& z);
  Outcome on(const Message& message);
  /// Of use while lost; kIgnored.
  Outcome on(const LaserScan& z);

  /// Sightings of one instant, put together with landmarks as by PoseEkf::on_joint.
  std::vector<Outcome> on_joint(const std::vector<RangeBearing>& sightings,
                                Association association = Association::kJoint);

  /// kReady while it tracks; otherwise how far the start has come.
  [[nodiscard]] Initializer::State state() const;
  [[nodiscard]] bool is_lost() const { return !ekf_.has_value(); }
  /// How often it noticed that it was lost.
  [[nodiscard]] int alarms() const { return alarms_; }
  /// The filter that tracks, or null.
  [[nodiscard]] const PoseEkf* estimator() const { return ekf_ ? &*ekf_ : nullptr; }

 private:
  template <class M>
  Outcome drive(const M& u);
  template <class M>
  Outcome correct(const M& z);
  void judge(const Outcome& outcome, double log_anything, double gate);
  [[nodiscard]] bool is_alarming() const { return std::max(evidence_, unexplained_) > limit_; }
  void trust();
  void raise_alarm();
  [[nodiscard]] Initializer fresh() const;  // that has heard the last odometry
  void decide();

  Config config_;
  double limit_;           // of both sums
  Initializer prototype_;  // that has heard nothing
  Initializer start_;
  std::optional<PoseEkf> ekf_;
  std::optional<Message> control_;  // the last odometry
  double evidence_ = 0.0;           // that nothing fits
  double unexplained_ = 0.0;        // that too much fits nothing
  int alarms_ = 0;
};

}  // namespace locfuse
