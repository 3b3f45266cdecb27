// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "locfuse/estimators/health.hpp"
#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/estimators/landmark_sight.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/filters/clustering.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/particles.hpp"
#include "locfuse/filters/resampling.hpp"
#include "locfuse/frontends/scan_matcher.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/models/measurement/beam_model.hpp"
#include "locfuse/models/measurement/likelihood_field.hpp"
#include "locfuse/models/measurement/pose.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// Monte Carlo localization: laser scans on a map, odometry, and whatever else tells of the pose
/// (Thrun, Burgard and Fox, Probabilistic Robotics, chapter 8); docs/models/mcl.md.
///
/// Copying it is a snapshot. Every `on` throws std::invalid_argument for a message that is not
/// valid and NumericalError where numbers break. The same seed gives the same bits on any number of
/// threads.
class Mcl {
 public:
  /// What a scan's likelihood is made of.
  enum class Likelihood : std::uint8_t {
    kField,  ///< where beams end
    kBeams,  ///< how far they go
  };

  struct Config {
    int min_particles = 500;
    int max_particles = 5000;         ///< of them, as many as keep the errors below
    double kld_error = 0.05;          ///< of the particles' distribution (Kullback-Leibler)
    double kld_quantile = 2.33;       ///< normal quantile of the probability that it is kept: 99 %
    int beams = 60;                   ///< of a scan, evenly among its returns
    double independent_beams = 10.0;  ///< what they count for: neighbours share the map's errors
    double independent_beams_searching =
        2.0;                       ///< likewise until it is found, so that no place is lost early
    double effective_share = 0.2;  ///< of the particles that a measurement leaves at least
    double outlier_share = 0.01;   ///< of ranges, positions and poses, wrong by anything
    double resample_below = 0.5;   ///< share of effective particles
    int refine_up_to =
        0;  ///< so many, or fewer, are drawn where a match of the scan puts them, too
    double spacing_m = 0.1;             ///< motion after which a scan is news again [m]
    double spacing_heading_rad = 0.05;  ///< likewise a turn [rad]
    double most_drop = 1.5;  ///< of a return's log density below the usual, or the body is lost
    double min_explained = 0.75;           ///< of the returns, over ten scans, or the body is lost
    int scouts = 64;                       ///< particles that look for a lost body anywhere else
    int scout_draws = 20000;               ///< from which they are chosen, scan by scan
    double most_gain = 2.0;                ///< of a scout over the belief by one scan [nats]
    double kidnapping_probability = 1e-4;  ///< that a scout must outweigh
    double hold_s = 1.0;  ///< how long the last motion is believed without new odometry [s]
    double sigma_lost_xy_per_sqrt_s = 0.5;       ///< thereafter: standing, spreading [m / sqrt(s)]
    double sigma_lost_heading_per_sqrt_s = 0.5;  ///< [rad / sqrt(s)]
    double probability_ready = 0.999;            ///< of the likeliest cluster
    double sigma_xy_ready_m = 0.5;               ///< of it, at most [m]
    double sigma_heading_ready_rad = 0.17;       ///< likewise [rad]
    double bin_m = 0.5;            ///< side of the bins by which particles are put together [m]
    int bin_headings = 24;         ///< bins all around
    double sigma_map_m = 0.03;     ///< how well the map is known, which scans do not tell [m]
    double sigma_map_rad = 0.005;  ///< likewise turned [rad]
    std::uint64_t seed = 1;
    int threads = 1;
    OdometryMotion::Config odometry;
    LikelihoodField::Config field{0.05, 0.05, 30.0};  ///< its sigma is the least that is tried
    double sigma_widest_m = 0.4;  ///< the largest: the one that fits is used, and this one at first
    Likelihood likelihood = Likelihood::kField;  ///< by which scans weigh particles
    BeamModel::Config beam_model;                ///< if that is kBeams
    RangeModel::Config range;
    PositionModel::Config position;
    PoseModel::Config pose;
    RangeBearingModel::Config landmark;
    Limits limits;
    Health::Config health;
  };

  /// Knows nothing at first: particles all over the free cells. `anchors` may be null. Throws
  /// std::invalid_argument on a config out of range.
  Mcl(const Config& config, const std::shared_ptr<const OccupancyGrid>& grid, Stamp start,
      std::shared_ptr<const AnchorMap> anchors = nullptr, std::vector<Tag> tags = {},
      LandmarkSight landmarks = {});

  /// Starts anew: anywhere in free space, or near poses, each as likely as its probability says.
  /// Throw std::invalid_argument for a pose, or a sigma of its position, beyond limits.distance_m.
  void start_anywhere(Stamp stamp);
  void start_at(const std::vector<PoseHypothesis>& hypotheses);
  /// Starts anew with particles that are given, one column (x, y, heading, weight) each, in world.
  /// Throws std::invalid_argument unless all are finite, none lies beyond limits.distance_m, no
  /// weight is negative and not all are 0.
  void start_with(Stamp stamp, const Matrix<4, Eigen::Dynamic>& particles);

  /// Replaces a share of the particles, evenly, by draws from a pose that somebody else is sure of,
  /// at a stamp that is not before the last message; odometry goes on. Throws
  /// std::invalid_argument unless the covariance is positive definite and 0 < share <= 1.
  void inject(const PoseEstimate& pose, double share = 1.0);

  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  /// Weighs by the likelihood field or the beam model. kNotModelled if the body has hardly moved
  /// since the last scan that was used, or if the scan has no returns; kGated if most of them come
  /// from right before the laser, where the map has no wall.
  Outcome on(const LaserScan& z);
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  Outcome on(const PoseObservation& z);
  /// One without a name weighs each particle by the landmark that fits it best.
  Outcome on(const RangeBearing& z);

  /// The likeliest cluster, carried to where odometry ends.
  [[nodiscard]] PoseEstimate estimate() const;
  /// The same with the covariance of all particles about their mean, whatever cluster they are in.
  [[nodiscard]] PoseEstimate spread() const;
  /// All clusters as of the belief's stamp, the likeliest first.
  [[nodiscard]] const std::vector<PoseHypothesis>& hypotheses() const { return hypotheses_; }
  /// Whether one cluster has all but 1 - probability_ready, and is narrow.
  [[nodiscard]] bool ready() const;
  /// Share of the last scan's end points that end at a wall as seen from the likeliest cluster.
  [[nodiscard]] double explained() const { return explained_; }
  /// Share of the last scan's information that was used, as `reweigh` returns it.
  [[nodiscard]] double used_share() const { return used_share_; }

  /// How far its estimate may be trusted; docs/health.md.
  [[nodiscard]] HealthReport health() const;
  [[nodiscard]] const std::vector<SourceStatus>& sources() const { return health_.sources(); }

  [[nodiscard]] const ParticleBelief& belief() const { return belief_; }
  [[nodiscard]] const Config& config() const { return recipe_->config; }
  [[nodiscard]] const OccupancyGrid& grid() const { return recipe_->fields.front().grid(); }
  /// How far end points lie beside walls, as scans tell [m].
  [[nodiscard]] double sigma_hit() const { return recipe_->fields[level_].config().sigma_hit_m; }

 private:
  struct Recipe {  // what never changes, shared by all snapshots
    Config config;
    OdometryMotion motion;
    OdometryMotion lost;
    std::vector<LikelihoodField> fields;  // sigma doubles from one to the next
    std::optional<BeamModel> beams;
    std::optional<RangeModel> range;
    PositionModel position;
    PoseModel pose;
    RangeBearingModel landmark;
    std::shared_ptr<const LandmarkMap> landmarks;  // or null
    Stamp hold;
    std::vector<std::int32_t> free;  // cells, row by row
    std::shared_ptr<Workers> workers;
    std::shared_ptr<const ScanMatcher> matcher;  // or null
  };

  void begin(Stamp stamp, int particles);
  void advance_to(Stamp stamp);
  void drive(const OdometryMotion& model, const Pose2& motion, Stamp until);
  void settle(const LaserScan* scan = nullptr);
  bool settle_by_match(const LaserScan& z, const Pose2& motion_in_cells);
  static PoseEstimate carried(const PoseEstimate& from, const UncertainMotion& by, Stamp stamp);
  [[nodiscard]] PoseEstimate carried_on(const PoseEstimate& from) const;
  void draw_near(int begin, int end, const PoseEstimate& pose, std::uint64_t key);
  void draw_free(ParticleBelief& belief, int k, std::uint64_t key) const;
  void summarize();
  void roughen();
  [[nodiscard]] bool fits_as_ever() const;
  bool choose_level(const EndPoints& points);
  void climb(const EndPoints& points, const LikelihoodField& field, ParticleBelief& pool);
  [[nodiscard]] ParticleBelief places_that_fit(const EndPoints& points, int count);
  void challenge(const EndPoints& points, double share, double best, bool just_lost);
  void admit(std::size_t first, int scouts);
  void fit_beams(const LaserScan& scan);
  void fit(const LikelihoodField& field, const EndPoints& points, const ParticleBelief& belief);
  [[nodiscard]] double spacing() const;
  [[nodiscard]] ParticleBins bins() const;
  [[nodiscard]] std::uint64_t next_key();
  [[nodiscard]] Pose2 to_world(const Pose2& cells) const;
  [[nodiscard]] Matrix<3, 3> metres_per_cell() const;
  [[nodiscard]] Pose2 to_cells(const Pose2& world) const;
  [[nodiscard]] ScanEvidence evidence_of(const LaserScan& z, const PoseEstimate& here) const;
  void tell(ScanEvidence evidence);
  [[nodiscard]] static LaserScan uncovered(LaserScan z);
  template <class Model, class Message>
  Outcome compare(const Model& model, const Message& z);
  template <class Model, class Message>
  Outcome weigh(const Model& model, const Message& z);
  void reweigh_and_resample(double most_share);

  std::shared_ptr<const Recipe> recipe_;
  ParticleBelief belief_;
  ParticleBelief scratch_;
  ParticleBelief scouts_;     // each in a place of its own
  std::vector<double> gain_;  // of each over the belief [nats]
  ParticleBelief tries_;
  std::vector<float> log_likelihood_;
  std::vector<float> correction_;
  std::vector<std::int32_t> costs_;
  std::vector<PoseHypothesis> hypotheses_;  // at belief_.stamp
  HeldMotion odometry_;
  Stamp stamp_;                           // up to where pending_ leads
  UncertainMotion pending_;               // since belief_.stamp, in metres
  Vector<3> spread_ = Vector<3>::Zero();  // variances that motion has added since resampling
  Pose2 since_scan_;  // driven since the last scan that was used: ways, not displacement
  bool scanned_ = false;
  bool searching_ = true;  // it started anywhere, and was not found since
  bool tracking_ = false;
  int rereads_ = 0;               // scans that may still be read without having moved
  std::vector<double> evidence_;  // mean log density of an end point, for each of the fields
  std::size_t level_ = 0;         // the field in use
  double explained_ = 0.0;
  double lately_explained_ = 1.0;
  double usual_evidence_ = 0.0;  // under the field that fits best, slowly averaged
  double used_share_ = 0.0;
  std::uint64_t step_ = 0;
  int target_ = 0;  // particles after the next resampling
  Health health_;
  bool is_found_ = false;        // once since it started: from then on `health_` listens
  std::optional<Stamp> judged_;  // the last scan
  double since_judged_ = 0.0;    // share of a scan's spacing that was driven since
};

}  // namespace locfuse
