// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/particles.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/messages/per_laser.hpp"
#include "locfuse/particles/mcl_config.hpp"
#include "locfuse/particles/mcl_health.hpp"
#include "locfuse/particles/mcl_map_sharpness.hpp"
#include "locfuse/particles/mcl_particle_filter.hpp"
#include "locfuse/particles/mcl_recipe.hpp"
#include "locfuse/particles/mcl_recovery.hpp"
#include "locfuse/recovery/health.hpp"
#include "locfuse/recovery/pose_watch.hpp"

namespace locfuse {

/// Monte Carlo localization: a particle filter on an occupancy grid with laser scans, odometry,
/// ranges, positions, poses and landmarks (Thrun, Burgard and Fox, Probabilistic Robotics, chapter
/// 8); docs/models/particles.md.
///
/// Copying it is a snapshot. Every `on` throws std::invalid_argument for a message that is not
/// valid and NumericalError where numbers break. The same seed gives the same bits on any number of
/// threads.
class Mcl {
 public:
  using Config = MclConfig;
  using Likelihood = MclConfig::Likelihood;
  using Proposal = MclConfig::Proposal;

  /// Snapshots that a history of messages keeps. One takes 56 bytes a particle.
  static constexpr int kSnapshots = 8;

  /// Starts with particles all over the free cells. Throws std::invalid_argument on a config out
  /// of range, and without a grid.
  Mcl(const Config& config, const World& world, Stamp start);

  /// Restarts: anywhere in free space, or near poses in proportion to their probabilities. Throw
  /// std::invalid_argument for a pose, or a sigma of its position, beyond limits.distance_m.
  void start_anywhere(Stamp stamp);
  void start_at(const std::vector<PoseHypothesis>& hypotheses);
  /// Restarts with given particles (x, y, heading, weight) in world, one per column, 4xN. Throws
  /// std::invalid_argument unless all are finite, none lies beyond limits.distance_m, no weight is
  /// negative and not all are 0.
  void start_with(Stamp stamp, const Matrix<4, Eigen::Dynamic>& particles);

  /// Replaces a share of the particles, evenly, by draws from a pose known from elsewhere, at a
  /// stamp that is not before the last message; odometry continues. Throws std::invalid_argument
  /// unless the covariance is positive definite and 0 < share <= 1.
  void inject(const PoseEstimate& pose, double share = 1.0);

  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  /// Weighs by the likelihood field or the beam model. kNotModelled if the robot has hardly moved
  /// since the last scan used of the same laser, which its mount shows, or if the scan has no
  /// returns; kGated if something covers most of the laser: near returns where the map has no wall.
  Outcome on(const LaserScan& z);
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  Outcome on(const PoseObservation& z);
  /// An unnamed one weighs each particle by the landmark that fits it best.
  Outcome on(const RangeBearing& z);
  /// Checked, and kNotModelled: it has no height.
  Outcome on(const Altitude& z);
  Outcome on(const Heading& z);
  Outcome on(const Message& message);

  /// The same Mcl, at a pose.
  [[nodiscard]] Mcl restarted(const PoseEstimate& pose) const;
  /// Whether it judges a message and does not use it: its clock counts for nothing.
  [[nodiscard]] bool watches(const Message& message) const {
    return watch_ && std::holds_alternative<PoseObservation>(message);
  }
  /// Whether it knows where it is: `ready` at some time since it started.
  [[nodiscard]] bool has_started() const { return health_.is_active(); }

  /// The likeliest cluster at the stamp of the last message.
  [[nodiscard]] const PoseEstimate& current() const { return filter_.best().estimate; }
  /// The likeliest cluster, carried to where odometry ends; while it is lost with a covariance that
  /// says so, Health::doubted.
  [[nodiscard]] PoseEstimate estimate() const;
  /// The same pose with the covariance of all particles about their mean, whatever their cluster.
  [[nodiscard]] PoseEstimate overall_estimate() const;
  /// All clusters at the belief's stamp, the likeliest first.
  [[nodiscard]] const std::vector<PoseHypothesis>& hypotheses() const {
    return filter_.hypotheses();
  }
  /// Whether one cluster has probability_ready and is narrow.
  [[nodiscard]] bool ready() const { return has_scan() && filter_.is_converged(); }
  /// Share of the last scan's end points that a wall explains, seen from the likeliest cluster.
  [[nodiscard]] double explained() const { return sharpness_.explained(); }
  /// Share of the last measurement's information that was used, as `reweigh` returns it.
  [[nodiscard]] double used_share() const { return filter_.used_share(); }

  /// How far the estimate may be trusted; docs/health.md.
  [[nodiscard]] HealthReport health() const;
  [[nodiscard]] const std::vector<SourceStatus>& sources() const { return health_.sources(); }
  /// How far the poses that it watches may be trusted; empty unless it watches poses.
  [[nodiscard]] std::optional<WatchReport> watched() const;

  [[nodiscard]] const ParticleBelief& belief() const { return filter_.belief(); }
  [[nodiscard]] const Config& config() const { return recipe_->config; }
  [[nodiscard]] const OccupancyGrid& grid() const { return recipe_->grid(); }
  /// Sigma of end points about walls, as scans show it [m].
  [[nodiscard]] double sigma_hit() const { return sharpness_.sigma_hit(); }

 private:
  struct Way {
    double travelled = 0.0;  // [m]: the path, not the displacement
    double turned = 0.0;     // [rad]
  };

  struct Tracking {
    bool is_searching = false;           // started anywhere, and not tracked since
    bool is_tracking = false;            // one cluster outweighs all others, and scans fit
    int stationary_scans = 0;            // of any laser that may still be used without motion
    internal::PerLaser<Way> since_scan;  // since the last one used, after the start
  };

  [[nodiscard]] PoseEstimate believed() const;
  [[nodiscard]] PoseEstimate believed_at(Stamp stamp) const;
  [[nodiscard]] HealthReport report_of(const PoseEstimate& here) const;
  void restart(Stamp stamp, bool anywhere);
  void advance_to(Stamp stamp);
  [[nodiscard]] bool advance_unless_stale(Stamp stamp);
  void drive(const OdometryMotion& model, const Pose2& motion, Stamp until,
             const std::optional<Vector<3>>& variance);
  void propagate_particles();
  [[nodiscard]] std::optional<LaserScan> propagate_particles(const LaserScan& scan);
  [[nodiscard]] bool has_scan() const { return !tracking_.since_scan.empty(); }
  [[nodiscard]] Outcome watch(const PoseObservation& z);
  [[nodiscard]] bool has_moved(const LaserScan& scan) const;
  [[nodiscard]] ScanEvidence evidence_of_prediction(const LaserScan& z) const;
  Outcome take(const LaserScan& z);
  [[nodiscard]] Outcome verdict_on(const LaserScan& scan, const EndPoints& points,
                                   const ScanEvidence& evidence) const;
  internal::UsedScan weigh_and_resample(const LaserScan& scan, const EndPoints& points,
                                        const std::optional<LaserScan>& rest);
  void update_tracking(const LaserScan& scan);
  void report_scan(const LaserScan& z, const ScanEvidence& before);
  void sharpen_map(const EndPoints& points);
  void recover(const internal::UsedScan& scan);
  void start_health();
  void resample(double max_share);
  template <class Model, class Message, class Why>
  Outcome weigh_by(const Model& model, const Message& z, const Why& why);

  std::shared_ptr<const internal::MclRecipe> recipe_;
  internal::ParticleFilter filter_;
  internal::MapSharpness sharpness_;
  internal::ParticleRecovery recovery_;
  internal::MclHealth health_;
  std::optional<PoseWatch> watch_;
  internal::RandomKeys keys_;
  HeldMotion odometry_;
  Tracking tracking_;
};

}  // namespace locfuse
