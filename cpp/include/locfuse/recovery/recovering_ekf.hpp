// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "locfuse/recovery/air_sum.hpp"
#include "locfuse/recovery/health.hpp"
#include "locfuse/recovery/initializer.hpp"
#include "locfuse/recovery/pose_watch.hpp"
#include "locfuse/recovery/tracker.hpp"

namespace locfuse {

/// A Tracker that starts by itself, notices when it is lost, and starts anew.
///
/// Until it has started an Initializer takes the messages: landmarks seen together, ranges, fixes
/// and poses start hypotheses until one wins. While it tracks, a Health listens. Lost, it goes on
/// as it was, with a covariance that says so, but another Initializer begins beside it. Whichever
/// explains first what is measured is believed; on the word of one source alone that the belief
/// contradicts, only once that source has likelier come right than stayed wrong. Derivation:
/// docs/health.md. A LandmarkEkf, whose map is relative to where it began, is not started anew. An
/// AirEkf is searched for in space, by an AirSum, whenever its belief is too vague for single
/// ranges: docs/air.md.
///
/// With a `tag_conditioner` fixes of tags are conditioned before the tracker fuses them. One that
/// is rejected is kImplausible, with the distance and the limit of ConditionedFix as `residual` and
/// `limit`. The conditioner is a part of this value, so that a Timeline rewinds it for a late fix.
///
/// With `start.watch_poses` poses are those of another localizer, which a PoseWatch judges by the
/// estimate: they are kIgnored with kWatched, and change no bit of it.
///
/// A cheap value. Every `on` throws std::invalid_argument for a message that is not valid.
class RecoveringEkf {
 public:
  /// A belief that no message has changed for this long is carried to the last one, so that an
  /// estimate that is not corrected any more grows vague in sight of everybody [ns].
  static constexpr Stamp kReportEvery = 100'000'000;

  struct Config {
    /// Of the search for a start, with the PoseEkf of its hypotheses, which tracks from then on.
    Initializer::Config start;
    /// Of another filter that tracks instead.
    std::optional<std::variant<LandmarkEkf::Config, TagTriangleEkf::Config, AirEkf::Config>>
        tracker;
    double start_height = 0.0;        ///< at which an AirEkf begins [m]
    double sigma_start_height = 0.3;  ///< [m]
    Health::Config health;
    bool restart = true;  ///< whether it looks for another place while it is lost
  };

  /// Not started. Throws std::invalid_argument on a config out of range.
  RecoveringEkf(const Config& config, const World& world);

  /// Tracks from `start` on. Throws std::invalid_argument as a PoseEkf does.
  void start_at(const PoseEstimate& start);
  /// Tracks on with a filter that somebody else has started.
  void start_with(Tracker tracker);
  /// Tracks from where a search has come. Throws std::invalid_argument unless it is ready.
  void start_from(const Initializer& found);

  /// What became of it; kIgnored until it has started.
  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  Outcome on(const PoseObservation& z);
  /// With an elevation only where is_in_space.
  Outcome on(const RangeBearing& z);
  /// kNotModelled unless is_in_space.
  Outcome on(const Altitude& z);
  Outcome on(const Heading& z);
  /// As of an AirEkf; kIgnored by any other.
  Outcome on(const Imu& z);
  static constexpr bool kTakesImu = true;
  Outcome on(const Message& message);
  /// Of use while it has no place or is lost; kIgnored.
  Outcome on(const LaserScan& z);

  /// Sightings of one instant, put together with landmarks as by PoseEkf::on_joint.
  std::vector<Outcome> on_joint(const std::vector<RangeBearing>& sightings,
                                Association association = Association::kJoint);

  /// Whether a Timeline gives it the sightings of one stamp together.
  [[nodiscard]] bool fuses_jointly() const {
    return tracker_ && std::holds_alternative<LandmarkEkf>(*tracker_);
  }

  /// Whether it judges a message and does not use it: its clock counts for nothing.
  [[nodiscard]] bool watches(const Message& message) const {
    return watch_ && std::holds_alternative<PoseObservation>(message);
  }

  /// Whether it tracks by an AirEkf, which has a height.
  [[nodiscard]] bool is_in_space() const {
    const auto& tracker = recipe_->config.tracker;
    return tracker && std::holds_alternative<AirEkf::Config>(*tracker);
  }

  /// kReady while it tracks; otherwise how far the start has come.
  [[nodiscard]] Initializer::State state() const;
  /// Whether there is no estimate to be trusted.
  [[nodiscard]] bool is_lost() const { return !tracker_ || health_.is_lost(); }
  [[nodiscard]] bool has_started() const { return tracker_.has_value(); }
  /// How far its estimate may be trusted.
  [[nodiscard]] HealthReport health() const;
  [[nodiscard]] const std::vector<SourceStatus>& sources() const { return health_.sources(); }
  /// How far the poses that it watches may be trusted; empty unless it watches poses.
  [[nodiscard]] std::optional<WatchReport> watched() const;
  /// The stamp of `current` [ns]: that of the belief, or of the last measurement where for
  /// kReportEvery none has changed the belief. Throws std::logic_error unless it has started.
  [[nodiscard]] Stamp stamp() const;
  /// The belief at `stamp()`, and carried to the end of odometry; while it is lost with a
  /// covariance that says so, Health::doubted. Throw std::logic_error unless it has started.
  [[nodiscard]] PoseEstimate current() const;
  [[nodiscard]] PoseEstimate estimate() const;
  [[nodiscard]] const GaussianBelief& belief() const;
  /// The place in space of an AirEkf at `stamp()`, and carried to the end of odometry; empty with
  /// any other.
  [[nodiscard]] std::optional<AirEstimate> current_in_space() const;
  [[nodiscard]] std::optional<AirEstimate> estimate_in_space() const;
  /// The same, tracking anew from `start`, as a PoseEkf does. A LandmarkEkf keeps its map and its
  /// pose, an AirEkf its place and velocity, and takes the stamp alone.
  [[nodiscard]] RecoveringEkf restarted(const PoseEstimate& start) const;
  [[nodiscard]] const Config& config() const { return recipe_->config; }
  [[nodiscard]] const World& world() const { return recipe_->world; }
  /// The initializer at its beginning, without any message.
  [[nodiscard]] const Initializer& initializer() const { return recipe_->fresh; }
  /// How often it noticed that it was lost.
  [[nodiscard]] int alarms() const { return alarms_; }
  /// How often it then found another place.
  [[nodiscard]] int restarts() const { return restarts_; }
  /// What tracks, or null until it has started. While it is lost, that of the place it had.
  [[nodiscard]] const Tracker* tracker() const { return tracker_ ? &*tracker_ : nullptr; }
  /// The same if it is a PoseEkf, else null.
  [[nodiscard]] const PoseEkf* estimator() const { return std::get_if<PoseEkf>(tracker()); }

 private:
  struct Recipe {  // what never changes, shared by all snapshots
    Config config;
    Initializer fresh;  // without any message
    World world;
    bool restarts;  // whether it looks for another place while it is lost

    [[nodiscard]] AirSum::Config places() const {
      return {config.start.epoch_s, config.start.wrong_share, config.start.wrong_span_m,
              config.start.estimator.correlation_s};
    }
  };

  template <class M>
  Outcome drive(const M& u);
  template <class M>
  Outcome correct(const M& z);
  template <class M>
  [[nodiscard]] Outcome track(const M& message);
  template <class M>
  [[nodiscard]] Outcome track_in_space(AirEkf& air, const M& message);
  void mirror(const AirEkf& air);
  template <class M>
  [[nodiscard]] Outcome fuse(const M& z);
  template <class M>
  [[nodiscard]] Outcome fuse_unless_excluded(const M& z);
  [[nodiscard]] Outcome fuse_conditioned(const PositionFix& z);
  [[nodiscard]] bool is_in_reach(const PoseEstimate& there) const;
  template <class M>
  void give(Initializer& start, const M& z) const;
  template <class M>
  void record(const M& z, const Outcome& outcome);
  void listen();  // to what health says
  void decide();
  void begin_search();
  void check_search(Stamp stamp, const Vector<2>& position, const Matrix<2, 2>& R);
  template <class Feed>
  [[nodiscard]] bool search(const Feed& feed);
  [[nodiscard]] Outcome watch(const PoseObservation& z);
  [[nodiscard]] PoseEstimate believed() const;
  [[nodiscard]] PoseEstimate believed_at(Stamp stamp) const;
  [[nodiscard]] HealthReport health_of(const PoseEstimate& here) const;
  [[nodiscard]] PoseEstimate doubted(const PoseEstimate& estimate) const;
  [[nodiscard]] const Tracker& started() const;
  [[nodiscard]] Initializer fresh() const;  // with the last odometry
  [[nodiscard]] Tracker tracker_at(const PoseEstimate& start, const Initializer& found) const;

  std::shared_ptr<const Recipe> recipe_;
  std::optional<Initializer> start_;  // while there is no place, or it is lost
  std::optional<Tracker> tracker_;
  std::optional<AirSum> places_;               // whose mean an AirEkf is while its belief is vague
  std::optional<TagConditioner> conditioner_;  // of the fixes that the tracker fuses
  Health health_;
  std::optional<PoseWatch> watch_;
  std::optional<std::variant<Velocity, Increment>> control_;  // the last odometry
  Stamp newest_ = 0;       // of the measurements received while it tracked, fused or not
  Stamp search_fits_ = 0;  // the last fix that a place of the search explained
  bool was_lost_ = false;
  int alarms_ = 0;
  int restarts_ = 0;
};

}  // namespace locfuse
