// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/message.hpp"

namespace locfuse {

/// How far an estimate may be trusted.
enum class HealthState : std::uint8_t {
  kInitializing,   ///< there is no estimate yet
  kOk,             ///< every source that was ever heard agrees
  kDegraded,       ///< right, but some source is silent or wrong, or noise is larger than believed
  kAmbiguous,      ///< several poses fit, and none is chosen yet
  kDeadReckoning,  ///< nothing but odometry for some time
  kLost,           ///< likely wrong, or without aid for too long
};

/// Why a state is not kOk.
enum class HealthClue : std::uint8_t {
  kNone,
  kNoEstimate,       ///< never started
  kSeveralPlaces,    ///< several poses fit
  kMeasurements,     ///< measurements speak against the pose
  kSilence,          ///< nothing was fused for some time
  kSourceIsWrong,    ///< one source says what the others deny
  kSourceIsSilent,   ///< one source says nothing any more
  kNoiseIsLarger,    ///< innovations are larger than their covariance
  kPositionIsVague,  ///< the covariance alone leaves the limit
  kScansDoNotFit,    ///< scans speak against the pose
  kLaserIsCovered,   ///< a laser sees something right before it
};

/// Where measurements come from: an anchor, a landmark, a tag whose position is told, or another
/// localizer.
struct NamedSource {
  static constexpr Id kNameless = std::numeric_limits<Id>::min();

  Source kind = Source::kRanges;
  Id name = kNameless;  ///< of the anchor, the tag or the landmark

  friend bool operator==(const NamedSource& a, const NamedSource& b) {
    return a.kind == b.kind && a.name == b.name;
  }
  friend bool operator<(const NamedSource& a, const NamedSource& b) {
    return a.kind != b.kind ? a.kind < b.kind : a.name < b.name;
  }
};

[[nodiscard]] inline NamedSource named_source_of(const Range& z) {
  return {Source::kRanges, z.anchor};
}
[[nodiscard]] inline NamedSource named_source_of(const PositionFix& z) {
  return {Source::kPositions, z.tag.value_or(NamedSource::kNameless)};
}
[[nodiscard]] inline NamedSource named_source_of(const PoseObservation& /*z*/) {
  return {Source::kPoses, NamedSource::kNameless};
}
[[nodiscard]] inline NamedSource named_source_of(const RangeBearing& z) {
  return {Source::kSightings, z.landmark.value_or(NamedSource::kNameless)};
}

/// What a scan says of a pose on a map, in shares of some of its beams.
struct ScanEvidence {
  Stamp stamp = 0;
  double explained = 0.0;    ///< of the returns that nothing covers: that a wall explains
  double by_chance = 0.0;    ///< likewise from anywhere else
  double covered = 0.0;      ///< of the returns: right before the laser, where the map has no wall
  double independent = 0.0;  ///< beams that it counts for
  double news = 1.0;         ///< share of it that earlier scans have not said
};

/// What became of one source's messages.
struct SourceStatus {
  NamedSource source;
  Stamp heard = 0;             ///< last [ns]
  std::optional<Stamp> fused;  ///< last [ns]
  double interval = 0.0;       ///< between messages, mean [s]
  double residual = 0.0;       ///< last innovation's first row
  double sigma = 0.0;          ///< of that innovation, det(S)^(1 / (2 dof))
  /// Last NIS over the gate's limit: above 1 it was gated. Of scans the last loss of explained
  /// returns over that from which on a wrong pose is the better explanation.
  double test_ratio = 0.0;
  double accepted = 1.0;  ///< share of the last 32 or so that was fused
  double nis = 1.0;       ///< mean NIS per degree of freedom of what was no outlier
  double faulty = 0.0;    ///< probability that it is wrong as a whole, if the pose is right
};

/// How far an estimate may be trusted, in numbers.
struct HealthReport {
  Stamp stamp = 0;
  HealthState state = HealthState::kInitializing;
  HealthClue clue = HealthClue::kNoEstimate;
  std::optional<NamedSource> source;  ///< that the clue names
  double wrong = 1.0;                 ///< probability that the robot is somewhere else
  double within = 0.0;                ///< probability that the position error is below the limit
  double inflation = 1.0;             ///< of the covariance, by innovations larger than believed
  /// |error| in x [m], y [m] and heading [rad] exceeds these with the stated risk at most; infinite
  /// where that cannot be said.
  Vector<3> protection = Vector<3>::Constant(std::numeric_limits<double>::infinity());
};

/// Listens to what becomes of measurements, and says how far the estimate may be trusted.
///
/// A hidden Markov model: one bit says whether the pose is right, one bit for every source whether
/// it is. All clues are likelihood ratios; a source that is wrong for long explains its own
/// rejections, several at once do not. Without measurements trust runs out. Derivation:
/// docs/health.md. A cheap value; hears without allocating once every source was heard.
class Health {
 public:
  struct Config {
    double limit_m = 1.0;  ///< position error that `HealthReport::within` asks about [m]
    double risk = 0.01;    ///< that an error exceeds its protection level
    double mean_s_between_losses = 14400.0;  ///< how rarely a robot loses its place [s]
    double wrong_share = 0.02;               ///< of measurements that say nothing, each by itself
    double wrong_span_m = 20.0;              ///< what is wrong is wrong by anything up to this [m]
    double chance_share = 0.4;               ///< of measurements that fit a pose that is wrong
    double faulty_share = 0.1;               ///< of the time that a source is wrong as a whole
    double faulty_share_unnamed = 1e-6;      ///< likewise of a sensor of landmarks without names
    double faulty_s = 10.0;                  ///< how long it is, on average [s]
    double exclude_above = 0.999;    ///< a range's source more likely wrong than this is not fused
    double probability_lost = 0.5;   ///< of being wrong, from which on it is lost
    double probability_found = 0.1;  ///< of being wrong, below which it is not any more
    double doubt_s = 0.5;        ///< for which it must have been that likely wrong, to be lost [s]
    double aiding_lost_s = 2.0;  ///< without anything fused: dead reckoning [s]
    double invalid_s = 60.0;     ///< likewise: lost [s]
  };

  /// Throws std::invalid_argument on a config out of range.
  explicit Health(const Config& config);

  /// The pose is wrong with that probability at `stamp`, and nothing is known of the sources.
  void start(Stamp stamp, double wrong = 0.0);

  /// What became of a measurement: `limit` is the gate's, `breadth` the volume of what a wrong one
  /// may be, see breadth_of.
  void hear(const NamedSource& source, Stamp stamp, const Outcome& outcome, double limit,
            double breadth);
  /// What a scan says; eq. (10) to (12) of docs/health.md.
  void hear(const ScanEvidence& scan);
  /// Time passes: trust runs out.
  void advance(Stamp stamp);

  /// Volume within which a wrong measurement lies anywhere: 1 / q of docs/health.md.
  [[nodiscard]] double breadth_of(const Range& z) const;
  [[nodiscard]] double breadth_of(const PositionFix& z) const;
  [[nodiscard]] double breadth_of(const PoseObservation& z) const;
  [[nodiscard]] double breadth_of(const RangeBearing& z) const;

  /// How far `estimate`, which the measurements heard belong to, may be trusted. Throws
  /// std::invalid_argument, as all that takes a stamp, where that is beyond +-kStampLimit.
  [[nodiscard]] HealthReport report(const PoseEstimate& estimate) const;
  /// Probability that the pose is wrong.
  [[nodiscard]] double wrong() const { return odds_ / (1.0 + odds_); }
  [[nodiscard]] bool is_lost() const { return lost_; }
  /// Whether a source is better left out until it agrees again.
  [[nodiscard]] bool is_excluded(const NamedSource& source) const;
  [[nodiscard]] const std::vector<SourceStatus>& sources() const { return sources_; }

 private:
  void heard(SourceStatus& status, Stamp stamp, bool is_fused);
  SourceStatus& status_of(const NamedSource& source, Stamp stamp);
  void weigh(SourceStatus& status, const Outcome& outcome, double breadth);
  [[nodiscard]] double faulty_share(const NamedSource& source) const;
  [[nodiscard]] double agreement() const;
  [[nodiscard]] double inflation(const PoseEstimate& estimate) const;
  /// What odometry alone has carried for that long is as likely wrong as what is lost.
  [[nodiscard]] bool is_out_of_date(Stamp stamp) const { return stamp - fused_ > invalid_; }
  void judge();
  void find_state(HealthReport& report) const;
  void find_flaw(HealthReport& report) const;

  Config config_;
  Stamp aiding_lost_;
  Stamp invalid_;
  Stamp doubt_;
  double odds_lost_;
  double odds_found_;
  double quantile_;  // of an error in its sigmas, of half of the risk
  Stamp stamp_ = 0;
  Stamp fused_ = 0;          // last time that anything was
  double odds_ = 0.0;        // that the pose is wrong
  double scale_ = 0.0;       // mean variance of an innovation
  double nis_ = 1.0;         // mean per degree of freedom, of all sources
  double explained_ = 0.0;   // share of a scan's returns, usually
  double by_chance_ = 0.0;   // likewise from anywhere else
  double covered_ = 0.0;     // likewise right before the laser
  bool scans_lost_ = false;  // it was scans that spoke last against the pose
  bool lost_ = false;
  std::optional<Stamp> doubted_;       // since when it is more likely wrong than probability_lost
  std::vector<SourceStatus> sources_;  // sorted
  std::size_t latest_ = 0;             // index of the last one heard
  int excluded_ = 0;                   // how many are more likely wrong than exclude_above
};

}  // namespace locfuse
