// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "locfuse/estimators/health.hpp"
#include "locfuse/estimators/initializer.hpp"

namespace locfuse {

/// A PoseEkf that starts by itself, notices when it is lost, and starts anew.
///
/// Until it has started an Initializer takes the messages: landmarks seen together, ranges, fixes
/// and poses start hypotheses until one wins. While it tracks, a Health listens. Lost, it goes on
/// as it was, but another Initializer begins beside it: whichever explains first what is measured
/// is believed. Derivation: docs/health.md.
///
/// A cheap value. Every `on` throws std::invalid_argument for a message that is not valid.
class RecoveringEkf {
 public:
  struct Config {
    PoseEkf::Config estimator;
    Initializer::Config start;
    Health::Config health;
    bool restart = true;  ///< whether it looks for another place while it is lost
  };

  /// Not started. Throws std::invalid_argument on a config out of range.
  RecoveringEkf(const Config& config, std::shared_ptr<const AnchorMap> anchors,
                std::vector<Tag> tags, std::shared_ptr<const ScanMatcher> matcher,
                LandmarkSensor landmarks = {});

  /// Tracks from `start` on. Throws std::invalid_argument as a PoseEkf does.
  void start_at(const PoseEstimate& start);
  /// Tracks on with a filter that somebody else has started.
  void start_with(PoseEkf ekf);

  /// What became of it; kIgnored until it has started.
  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  Outcome on(const PoseObservation& z);
  Outcome on(const RangeBearing& z);
  Outcome on(const Message& message);
  /// Of use while it has no place or is lost; kIgnored.
  Outcome on(const LaserScan& z);

  /// Sightings of one instant, put together with landmarks as by PoseEkf::on_joint.
  std::vector<Outcome> on_joint(const std::vector<RangeBearing>& sightings,
                                Association association = Association::kJoint);

  /// kReady while it tracks; otherwise how far the start has come.
  [[nodiscard]] Initializer::State state() const;
  /// Whether there is no estimate to be trusted.
  [[nodiscard]] bool is_lost() const { return !ekf_ || health_.is_lost(); }
  /// How far its estimate may be trusted.
  [[nodiscard]] HealthReport health() const;
  [[nodiscard]] const std::vector<SourceStatus>& sources() const { return health_.sources(); }
  /// The belief at its own stamp, and carried to the end of odometry. Throw std::logic_error unless
  /// it has started.
  [[nodiscard]] PoseEstimate current() const { return started().current(); }
  [[nodiscard]] PoseEstimate estimate() const { return started().estimate(); }
  /// The same, tracking anew from `start`, as a PoseEkf does.
  [[nodiscard]] RecoveringEkf restarted(const PoseEstimate& start) const;
  /// The initializer at its beginning, without any message.
  [[nodiscard]] const Initializer& initializer() const { return recipe_->fresh; }
  /// How often it noticed that it was lost.
  [[nodiscard]] int alarms() const { return alarms_; }
  /// How often it then found another place.
  [[nodiscard]] int restarts() const { return restarts_; }
  /// The filter, or null until it has started. While it is lost, that of the place it had.
  [[nodiscard]] const PoseEkf* estimator() const { return ekf_ ? &*ekf_ : nullptr; }

 private:
  struct Recipe {  // what never changes, shared by all snapshots
    Config config;
    Gate range_gate;
    Gate position_gate;
    Gate pose_gate;
    Gate landmark_gate;
    Initializer fresh;  // without any message
  };

  template <class M>
  Outcome drive(const M& u);
  template <class M>
  Outcome correct(const M& z);
  template <class M>
  [[nodiscard]] Outcome fuse(const M& z);
  template <class M>
  void record(const M& z, const Outcome& outcome);
  void listen();  // to what health says
  void decide();
  template <class Feed>
  [[nodiscard]] bool search(const Feed& feed);
  [[nodiscard]] const PoseEkf& started() const;
  [[nodiscard]] Initializer fresh() const;  // with the last odometry

  std::shared_ptr<const Recipe> recipe_;
  std::optional<Initializer> start_;  // while there is no place, or it is lost
  std::optional<PoseEkf> ekf_;
  Health health_;
  std::optional<Message> control_;  // the last odometry
  bool was_lost_ = false;
  int alarms_ = 0;
  int restarts_ = 0;
};

}  // namespace locfuse
