// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/frontends/heading_start.hpp"
#include "locfuse/frontends/scan_matcher.hpp"
#include "locfuse/frontends/tag_conditioner.hpp"
#include "locfuse/messages/per_laser.hpp"
#include "locfuse/recovery/gaussian_sum.hpp"

namespace locfuse {

/// How far a start has come.
enum class StartStatus : std::uint8_t {
  kWaiting,    ///< too little is known; `reason` says what is missing
  kAmbiguous,  ///< several poses fit
  kReady,      ///< one pose fits, as sure as the config asks
};

/// How a start is searched.
enum class StartMethod : std::uint8_t {
  kGaussianSum,   ///< hypotheses, weighed by all that is measured
  kSrlsHeadings,  ///< as ekim2020: SR-LS on ranges of an instant, then 36 headings of one scan
};

/// Finds the pose of a robot that was switched on anywhere (ekim2020, section 2.2).
///
/// The belief is a Gaussian sum: one PoseEkf for every position that the first ranges allow (both
/// sides of a line of anchors; all ranges, and all but each of them in turn) and
/// every heading, weighed by how well each predicts what comes next. Scans on a map, ranges to
/// other tags, and ranges after some motion decide between headings; docs/start.md.
///
/// With StartMethod::kSrlsHeadings it takes ranges, scans and odometry alone: each scan, at the
/// newest position that ranges determine, gives the headings that fit, or the reason why none does.
///
/// Every `on` throws std::invalid_argument for a message that is not valid, and NumericalError for
/// one that no filter can use; then nothing has changed. Of landmarks, anchors and tags that are
/// not on the map it takes no notice.
class Initializer {
 public:
  struct Config {
    PoseEkf::Config estimator;  ///< of the hypotheses, and of the filter to go on with
    std::optional<TagConditioner::Config> tag_conditioner;  ///< of the fixes of tags before use
    StartMethod method = StartMethod::kGaussianSum;
    double epoch_s = 0.2;               ///< ranges this close together give the first position [s]
    int headings = 36;                  ///< tried all around where no heading is known
    double wrong_share = 0.01;          ///< of the ranges, and of the positions, that say nothing
    double wrong_span_m = 20.0;         ///< what is wrong is wrong by anything up to this [m]
    double spacing_m = 0.2;             ///< motion after which a laser is used again [m]
    double spacing_heading_rad = 0.35;  ///< or turn [rad]
    double sigma_map_m = 0.03;          ///< how well the map lies among the anchors [m]
    double sigma_map_rad = 0.02;        ///< and of its heading [rad]
    int standing_ranges = 10;           ///< ranges over one link that count before it has moved on
    double probability_ready = 0.999;   ///< that the pose given is the right one
    /// Sigma of the position at a start, or that of one position fix where it is larger [m]
    double sigma_xy_ready_m = 0.5;
    double sigma_heading_ready_rad = 0.087;  ///< [rad]
    /// Whether poses are of a localizer that a PoseWatch judges, so that nothing here uses them.
    bool watch_poses = false;
  };

  using Hypothesis = PoseHypothesis;

  struct State {
    StartStatus status = StartStatus::kWaiting;
    std::string reason;                  ///< why it is not ready; empty if it is
    std::vector<Hypothesis> hypotheses;  ///< the likeliest first
    /// Of the last scan that was turned; empty without one.
    std::optional<HeadingSearch> headings = {};
  };

  /// Without a matcher the heading needs motion. Throws std::invalid_argument on a config out of
  /// range.
  Initializer(const Config& config, const World& world);

  /// Takes the robot for one that moves and never says how, until there is odometry: `place`.
  void expect_motion() { moves_ = true; }
  /// Searches by a Gaussian sum, whatever the config says; before the first message.
  void use_gaussian_sum();

  void on(const Velocity& u);
  void on(const Increment& u);
  void on(const Range& z);
  void on(const PositionFix& z);
  void on(const PoseObservation& z);
  /// Weighs the hypotheses there are; two of one stamp, with range and bearing, start others.
  void on(const RangeBearing& z);
  void on(const LaserScan& z);
  void on(const Altitude& z) { validate(z); }  ///< of no use
  void on(const Heading& z);                   ///< weighs the hypotheses there are
  void on(const Imu& z) { validate(z); }       ///< of no use
  void on(const Message& message);

  [[nodiscard]] State state() const;
  /// The same of the position alone, with any heading: what ranges say of a robot of whose motion
  /// nothing was ever received. Ready once three links fit that were not its first position, and
  /// most do.
  [[nodiscard]] State place() const;

  /// The last odometry received, or what of it is after `stamp`; none without any.
  [[nodiscard]] std::optional<Message> odometry_from(Stamp stamp) const;
  /// A filter that starts at `start`, with the last odometry received.
  [[nodiscard]] PoseEkf started_at(const PoseEstimate& start) const;
  /// What conditions fixes, with all that it has received.
  [[nodiscard]] const std::optional<TagConditioner>& conditioner() const { return conditioner_; }
  /// The filter to go on with. Throws std::invalid_argument unless the state is ready.
  [[nodiscard]] PoseEkf estimator() const;

 private:
  [[nodiscard]] PoseEkf started(const PoseEkf& prototype, const PoseEstimate& start) const;
  using Component = internal::GaussianComponent;
  using Scatter = internal::Scatter;
  struct Link {  // ranges between a tag and an anchor since the body last moved on
    Id tag;
    Id anchor;
    int count;
    bool fits = false;  // the last range fitted the likeliest component
  };

  struct Place {  // by SR-LS
    Vector<2> position;
    Matrix<2, 2> covariance;
    Vector<2> tag_in_body;
    Component driven;  // since then, from the origin
  };

  template <class Call>
  void attempt(const Call& call);
  [[nodiscard]] bool is_known(const Range& z) const;
  [[nodiscard]] bool ends_epoch(const Range& z) const;
  void collect(const Range& z);
  [[nodiscard]] bool place_by_squares();
  void turn(const LaserScan& z);
  void locate();
  void locate_by(const std::vector<Range>& epoch);
  void see(const RangeBearing& z);
  void match(const LaserScan& z);
  void add_constellations();
  [[nodiscard]] double log_by_chance(const RangeBearing& z) const;
  /// What is known of the body at a heading, of sigma, with a tag in place.
  [[nodiscard]] static PoseEstimate about(const Vector<2>& tag_in_world,
                                          const Matrix<2, 2>& covariance,
                                          const Vector<2>& tag_in_body, double heading,
                                          double sigma, Stamp stamp);
  void add_positions(const Vector<2>& tag_in_world, const Matrix<2, 2>& covariance,
                     const Vector<2>& tag_in_body, double log_weight, Stamp stamp);
  [[nodiscard]] Component component(const PoseEstimate& start, double log_weight) const;
  template <class M>
  bool weigh(const M& z, const std::optional<double>& log_outlier);
  template <class M>
  bool weigh(Component& component, const M& z, const std::optional<double>& log_outlier) const;
  template <class M>
  void drive(const M& u);
  void moved(const Pose2& motion);
  [[nodiscard]] bool moved_on(const Pose2& motion) const;
  void weigh_range(const Range& z);
  [[nodiscard]] bool is_adrift() const { return moves_ && !control_; }
  void follow_place();
  [[nodiscard]] Link* link_of(const Range& z);
  [[nodiscard]] int counted_before(const Range& z);
  [[nodiscard]] Range widened(Range z) const;
  [[nodiscard]] PositionFix widened(PositionFix z) const;
  void check_noise(Scatter Component::*of, double& factor);
  void begin_anew();
  [[nodiscard]] State state_of(const std::vector<internal::GaussianCluster>& all) const;
  [[nodiscard]] double sigma_xy_ready() const;
  [[nodiscard]] double sigma_heading_ready() const;
  void match(Stamp stamp, const ScanMatch& fit, double log_likelihood,
             std::vector<Component>& matched) const;
  void reduce();

  Config config_;
  std::shared_ptr<const AnchorMap> anchors_;
  std::vector<Tag> tags_;
  std::shared_ptr<const ScanMatcher> matcher_;
  Gate gate_;          // of a scan's pose
  PoseEkf prototype_;  // what every component is made from
  PoseEkf tracker_;    // what is started at the end

  std::optional<TagConditioner> conditioner_;
  std::vector<Component> components_;
  std::vector<Range> epoch_;             // the ranges of the first position
  std::vector<RangeBearing> sightings_;  // of the latest stamp
  double log_before_ = 0.0;              // of the best component before these
  // That constellations fitted by chance: none of the components is right.
  double log_nowhere_ = -std::numeric_limits<double>::infinity();
  std::vector<Link> links_;
  std::optional<Message> control_;        // the last odometry
  internal::PerLaser<Pose2> since_scan_;  // that was used
  Pose2 since_sightings_;                 // that were evidence
  std::size_t most_sightings_ = 0;        // of one stamp since then
  std::set<Id> named_;                    // that were seen since then
  double since_ranges_m_ = 0.0;
  Vector<2> ranged_at_ = Vector<2>::Zero();  // where links_ began, without odometry
  bool moves_ = false;
  double range_noise_ = 1.0;     // variance of ranges over the stated one, as they scatter
  double position_noise_ = 1.0;  // the same of position fixes
  double best_fix_ = std::numeric_limits<double>::infinity();  // sigma of the best one [m]
  std::optional<Place> place_;
  double epoch_path_m_ = 0.0;  // driven since the first range of the epoch
  std::optional<HeadingSearch> headings_;
  std::string waiting_for_ = "no range, position or pose yet, and no two landmarks at once";
};

}  // namespace locfuse
