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
  kInitializing,   ///< no estimate yet
  kOk,             ///< all sources agree
  kDegraded,       ///< right, but a source is silent or wrong, or noise exceeds its covariance
  kAmbiguous,      ///< several poses fit, and none is chosen yet
  kDeadReckoning,  ///< nothing but odometry for aiding_lost_s
  kLost,           ///< likely wrong, or nothing but odometry for invalid_s
};

/// Why a state is not kOk.
enum class HealthReason : std::uint8_t {
  kNone,
  kNoEstimate,       ///< not started yet
  kSeveralPlaces,    ///< several poses fit
  kMeasurements,     ///< measurements of several sources contradict the pose
  kSilence,          ///< nothing but odometry was fused for some time
  kSourceIsWrong,    ///< one source contradicts the others
  kSourceIsSilent,   ///< one source stopped publishing
  kNoiseIsLarger,    ///< innovations are larger than their covariance
  kPositionIsVague,  ///< position error is below limit_m by less than even odds
  kScansDoNotFit,    ///< scans contradict the pose
  kLaserIsCovered,   ///< something covers a laser
};

/// Where measurements come from: an anchor, a landmark, a tag with a position, or another
/// localizer.
struct NamedSource {
  static constexpr Id kUnnamed = std::numeric_limits<Id>::min();

  Source kind = Source::kRanges;
  Id name = kUnnamed;  ///< of the anchor, the tag or the landmark

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
  return {Source::kPositions, z.tag.value_or(NamedSource::kUnnamed)};
}
[[nodiscard]] inline NamedSource named_source_of(const PoseObservation& /*z*/) {
  return {Source::kPoses, NamedSource::kUnnamed};
}
[[nodiscard]] inline NamedSource named_source_of(const RangeBearing& z) {
  return {Source::kSightings, z.landmark.value_or(NamedSource::kUnnamed)};
}

[[nodiscard]] inline NamedSource named_source_of(const Altitude& /*z*/) {
  return {Source::kAltitudes, NamedSource::kUnnamed};
}
[[nodiscard]] inline NamedSource named_source_of(const Heading& z) {
  return {Source::kHeadings, z.is_course ? 1 : NamedSource::kUnnamed};
}

/// How well a scan fits a pose on a map.
struct ScanEvidence {
  Stamp stamp = 0;
  double explained = 0.0;    ///< share of the uncovered returns that a wall explains
  double by_chance = 0.0;    ///< the same from random poses
  double covered = 0.0;      ///< share of the returns near the laser where the map has no wall
  double independent = 0.0;  ///< independent beams that it counts for
  double novelty = 1.0;      ///< share of it that earlier scans have not shown
};

/// Statistics of one source's messages.
struct SourceStatus {
  NamedSource source;
  Stamp last_received = 0;     ///< last message received [ns]
  std::optional<Stamp> fused;  ///< last message fused [ns]
  double interval = 0.0;       ///< mean time between messages [s]
  double residual = 0.0;       ///< first row of the last innovation
  double sigma = 0.0;          ///< of that innovation: det(S)^(1 / (2 dof))
  /// Last NIS over the gate's limit: above 1 it was gated. For scans, the last drop of the
  /// explained share over the drop at which a wrong pose becomes the better explanation.
  double test_ratio = 0.0;
  double accepted = 1.0;  ///< share fused of the last 32 or so
  double nis = 1.0;       ///< mean NIS per degree of freedom, without outliers
  double faulty = 0.0;    ///< probability that it is wrong as a whole, given that the pose is right
  bool is_excluded = false;  ///< that has been above exclude_above, and not low since
};

/// How far an estimate may be trusted, in numbers.
struct HealthReport {
  Stamp stamp = 0;
  HealthState state = HealthState::kInitializing;
  HealthReason reason = HealthReason::kNoEstimate;
  std::optional<NamedSource> source;  ///< the one at fault, if one is
  double wrong = 1.0;                 ///< probability that the robot is somewhere else
  double within = 0.0;                ///< probability that the position error is below limit_m
  double inflation = 1.0;             ///< of the covariance, for innovations larger than expected
  /// Protection levels: |error| in x [m], y [m] and heading [rad] exceeds them with probability
  /// `risk` at most; infinite where no level holds.
  Vector<3> protection = Vector<3>::Constant(std::numeric_limits<double>::infinity());
};

/// Integrity monitor: how far an estimate may be trusted, from the outcomes of its measurements.
///
/// A hidden Markov model with one bit for the pose and one for each source, right or wrong. All
/// evidence is likelihood ratios: a single faulty source explains its own rejections, several at
/// once do not. Without measurements trust runs out. Derivation: docs/health.md. A cheap value;
/// recording allocates only when a source is new.
class Health {
 public:
  struct Config {
    double limit_m = 1.0;                    ///< alert limit of `HealthReport::within` [m]
    double risk = 0.01;                      ///< that an error exceeds its protection level
    double mean_s_between_losses = 14400.0;  ///< mean time between losses of the pose [s]
    double wrong_share = 0.02;               ///< fraction of independent outliers, at least
    double wrong_span_m = 20.0;              ///< outliers are uniform over this span [m]
    double chance_share = 0.4;  ///< fraction of measurements that fit a wrong pose by chance
    double faulty_share = 0.1;  ///< share of the time that a source is wrong as a whole
    double faulty_share_unnamed = 1e-6;  ///< the same for a sensor of unnamed landmarks
    double faulty_s = 10.0;              ///< mean duration of such a fault [s]
    double exclude_above = 0.999;    ///< range sources more likely wrong than this are not fused
    double probability_lost = 0.5;   ///< of a wrong pose: lost above this for doubt_s
    double probability_found = 0.1;  ///< of a wrong pose: no longer lost below this
    double doubt_s = 0.5;            ///< delay before kLost is reported [s]
    double aiding_lost_s = 2.0;      ///< time without a fused measurement: kDeadReckoning [s]
    double invalid_s = 60.0;         ///< time without a fused measurement: kLost [s]
  };

  /// Throws std::invalid_argument on a config out of range.
  explicit Health(const Config& config);

  /// Starts with a pose that is wrong with that probability, and forgets all sources.
  void start(Stamp stamp, double wrong = 0.0);

  /// Records the outcome of a measurement, with the limit of its gate and its outlier volume. An
  /// altitude or a heading is counted, but says nothing of the place: it fits anywhere.
  void record(const NamedSource& source, Stamp stamp, const Outcome& outcome, double limit,
              double outlier_volume);
  /// Records a scan; eq. (10) to (12) of docs/health.md.
  void record(const ScanEvidence& scan);
  /// Lets time pass: trust runs out.
  void advance(Stamp stamp);

  /// Volume over which an outlier is uniform: 1 / q of docs/health.md [m^i rad^j].
  [[nodiscard]] double outlier_volume(const Range& z) const;
  [[nodiscard]] double outlier_volume(const PositionFix& z) const;
  [[nodiscard]] double outlier_volume(const PoseObservation& z) const;
  [[nodiscard]] double outlier_volume(const RangeBearing& z) const;
  [[nodiscard]] double outlier_volume(const Altitude& z) const;
  [[nodiscard]] double outlier_volume(const Heading& z) const;

  /// How far `estimate`, that of the recorded measurements, may be trusted. Throws
  /// std::invalid_argument, as do all methods that take a stamp, beyond +-kStampLimit.
  [[nodiscard]] HealthReport report(const PoseEstimate& estimate) const;
  /// The estimate of a robot that is lost: with probability `wrong` it is anywhere within
  /// wrong_span_m to either side, at any heading; the covariance is that of both together, eq.
  /// (14).
  [[nodiscard]] PoseEstimate doubted(PoseEstimate estimate, double wrong) const;
  /// Probability that the pose is wrong.
  [[nodiscard]] double wrong() const { return odds_ / (1.0 + odds_); }
  /// The same without what silence adds, where of the sources within faulty_s one at most
  /// contradicts the pose, so that it may be the one that is wrong; empty where several do.
  [[nodiscard]] std::optional<double> wrong_by_one_source() const;
  [[nodiscard]] bool is_lost() const { return lost_; }
  /// Whether measurements of a source should not be fused until it agrees again.
  [[nodiscard]] bool is_excluded(const NamedSource& source) const;
  [[nodiscard]] const std::vector<SourceStatus>& sources() const { return sources_; }

 private:
  void receive(SourceStatus& status, Stamp stamp, bool is_fused);
  SourceStatus& status_of(const NamedSource& source, Stamp stamp);
  void exclude(SourceStatus& status);
  void weigh(SourceStatus& status, const Outcome& outcome, double outlier_volume);
  void weigh(SourceStatus& status, const ScanEvidence& scan);
  void weigh_cover(SourceStatus& status, const ScanEvidence& scan) const;
  void learn_usual(const SourceStatus& status, const ScanEvidence& scan);
  [[nodiscard]] double faulty_share(const NamedSource& source) const;
  [[nodiscard]] double grown(double odds, double seconds) const;
  [[nodiscard]] double agreement() const;
  [[nodiscard]] double inflation(const PoseEstimate& estimate) const;
  [[nodiscard]] bool is_out_of_date(Stamp stamp) const { return stamp - fused_ > invalid_; }
  void update_state();
  void find_state(HealthReport& report) const;
  void find_degradation(HealthReport& report) const;

  Config config_;
  Stamp aiding_lost_;
  Stamp invalid_;
  Stamp lost_delay_;
  double odds_lost_;
  double odds_found_;
  double quantile_;  // protection level over sigma, for half of the risk
  Stamp stamp_ = 0;
  Stamp fused_ = 0;                // last measurement fused
  double odds_ = 0.0;              // of a wrong pose
  double odds_measured_ = 0.0;     // the same without what a silence added
  double outliers_ = 0.0;          // share of independent outliers, as messages say
  double scale_ = 0.0;             // mean variance of an innovation
  double nis_ = 1.0;               // mean per degree of freedom, of all sources
  double explained_ = 0.0;         // usual ScanEvidence::explained
  double by_chance_ = 0.0;         // usual ScanEvidence::by_chance
  double covered_ = 0.0;           // usual ScanEvidence::covered
  bool scans_contradict_ = false;  // the last evidence against the pose was a scan
  bool lost_ = false;
  std::optional<Stamp> suspect_since_;  // odds have exceeded those of probability_lost
  std::vector<SourceStatus> sources_;   // sorted
  std::size_t latest_ = 0;              // index of the last one recorded
  int excluded_ = 0;                    // sources more likely wrong than exclude_above
};

}  // namespace locfuse
