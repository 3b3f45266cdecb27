// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/estimators/adaptive_noise.hpp"
#include "locfuse/estimators/calibration.hpp"
#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/estimators/pose_source.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/filters/association.hpp"
#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/filters/noise_shape.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/maps/landmark_map.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/models/measurement/heading.hpp"
#include "locfuse/models/measurement/pose.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// Extended Kalman filter over (x, y, heading) in world: odometry predicts; ranges, positions,
/// poses, headings and landmarks correct (ekim2020, section 2.1; wells, eq. 12 to 14). Errors of
/// odometry, of headings and of the sensor of landmarks that stay may be learnt on the way:
/// Config::calibration.
///
/// A cheap value: copying it is a snapshot. Every `on` throws std::invalid_argument for a message
/// that is not valid and NumericalError where numbers break. A message that is not fused, for
/// whatever reason, changes no bit of the estimator.
class PoseEkf {
 public:
  struct Config {
    OdometryMotion::Config odometry;
    RangeModel::Config range;
    PositionModel::Config position;
    PoseModel::Config pose;
    HeadingModel::Config heading;
    RangeBearingModel::Config landmark;
    Calibration::Config calibration;
    Limits limits;
    AdaptiveNoise::Config adaptive;
    double robust_dof = 4.0;          ///< degrees of freedom of kStudentT
    double robust_late_share = 0.05;  ///< share of ranges that are too long, for kOneSided
    /// Correlation time of the errors of an anchor, a landmark or any other source; how much of
    /// them is correlated is learnt. 0: they are independent [s].
    double correlation_s = 10.0;
    double hold_s = 1.0;  ///< odometry timeout: the last motion is held this long [s]
    double sigma_lost_xy_per_sqrt_s = 0.5;       ///< process noise after the timeout [m / sqrt(s)]
    double sigma_lost_heading_per_sqrt_s = 0.5;  ///< [rad / sqrt(s)]
  };

  /// Largest number of ranges that `on_joint` fuses.
  static constexpr int kMaxJoint = 32;

  /// Starts from `start`. Throws std::invalid_argument on a config out of range or a start that is
  /// not finite and positive definite.
  PoseEkf(const Config& config, const World& world, const PoseEstimate& start);

  /// The same filter, started anew: models and gates are shared, so this is cheap. Throws as the
  /// constructor does.
  [[nodiscard]] PoseEkf restarted(const PoseEstimate& start) const;

  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  Outcome on(const PoseObservation& z);
  /// One without a name is of the nearest landmark; kNotModelled if there is no landmark.
  Outcome on(const RangeBearing& z);
  /// Checked, and kNotModelled: it has no height.
  Outcome on(const Altitude& z);
  /// A course needs odometry, which says in what direction the body travels.
  Outcome on(const Heading& z);
  /// Scans are kIgnored.
  Outcome on(const Message& message);

  /// Ranges of one instant fused as one measurement: one linearization, one gate. Those that are
  /// not modelled or not plausible are left out. All stamps must be equal; at most kMaxJoint.
  /// Throws std::invalid_argument if their noise is not Gaussian: each has tails of its own.
  Outcome on_joint(const std::vector<Range>& epoch);

  /// Sightings of one instant; those without a name are put together with landmarks before any is
  /// fused. One that fits none is kGated, one whose numbers leave no finite result kNotModelled.
  std::vector<Outcome> on_joint(const std::vector<RangeBearing>& sightings,
                                Association association = Association::kJoint);

  /// Fuses what somebody else's model says of the pose at `stamp`: a Jacobian of any rows x 3.
  Outcome fuse(Stamp stamp, const Linearization<Eigen::Dynamic, 3>& lin, const Gate& gate);

  /// Carries the belief to `stamp` with what odometry says. Earlier stamps change nothing. Throws
  /// std::invalid_argument if the stamp is beyond kStampLimit.
  void advance_to(Stamp stamp);

  /// The belief at its own stamp.
  [[nodiscard]] PoseEstimate current() const;
  /// The belief carried to the end of the received odometry: the pose now.
  [[nodiscard]] PoseEstimate estimate() const;
  /// The belief carried to `stamp`, which must not lie before it.
  [[nodiscard]] PoseEstimate estimate(Stamp stamp) const;

  /// What it has learnt of the errors that are states.
  [[nodiscard]] std::vector<CalibratedError> errors() const {
    return recipe_->calibration.errors(belief_);
  }

  /// What it has learnt of the localizer whose poses it fuses.
  [[nodiscard]] const PoseSource& pose_source() const { return pose_source_; }

  /// Factors of the reported variances, learnt from innovations.
  [[nodiscard]] const AdaptiveNoise& adaptive() const { return adaptive_; }

  [[nodiscard]] const GaussianBelief& belief() const { return belief_; }
  /// How often a variance left its bounds and was put back, or P was made positive definite again.
  [[nodiscard]] std::uint64_t interventions() const { return belief_.interventions; }
  [[nodiscard]] Pose2 pose() const { return {belief_.x(0), belief_.x(1), belief_.x(2)}; }
  [[nodiscard]] const RangeModel& range_model() const { return recipe_->range; }
  [[nodiscard]] const RangeBearingModel& landmark_model() const { return recipe_->landmark; }
  [[nodiscard]] const LandmarkMap& landmark_map() const { return *recipe_->landmarks; }
  [[nodiscard]] const OdometryMotion& motion_model() const { return recipe_->motion; }

 private:
  struct Recipe {  // what never changes, shared by all snapshots
    Config config;
    OdometryMotion motion;
    OdometryMotion lost;
    RangeModel range;
    PositionModel position;
    PoseModel pose;
    HeadingModel heading;
    RangeBearingModel landmark;
    Calibration calibration;
    std::shared_ptr<const LandmarkMap> landmarks;  // never null
    Gate range_gate;
    Gate position_gate;
    Gate pose_gate;
    Gate heading_gate;
    Gate landmark_gate;
    NoiseShape range_noise;
    NoiseShape position_noise;
    NoiseShape pose_noise;
    Stamp hold;
  };

  template <class Noise, class Linearize, class Why>
  Outcome correct(std::optional<Source> source, Stamp stamp, const Gate& gate, const Noise& noise,
                  Slots slots, const Linearize& linearize, const Why& why, bool turns = false);
  template <class Lin, class Noise>
  Outcome fuse_with(GaussianBelief& belief, const Lin& lin, Slots slots, const Gate& gate,
                    const Noise& noise, bool turns) const;
  template <class Lin, class Noise>
  Outcome fuse_with_both(Lin& lin, Slots slots, const Gate& gate, const Noise& noise, bool turns);
  template <class Motion>
  Outcome take(const Motion& u);
  template <class Motion>
  Outcome take_with_both(const Motion& u);
  template <class Change>
  void change_without_poses(const Change& change);
  [[nodiscard]] double turn_of(const Velocity& u) const;
  [[nodiscard]] static double turn_of(const Increment& u);
  void count_turn(double turn);
  Outcome fuse_direction(const Heading& z);
  Outcome fuse_with_offset(const Heading& z);
  Outcome begin_with_offset(const Heading& z);
  Outcome fuse_localizer(const PoseObservation& z);
  [[nodiscard]] double make_honest(Linearization<Eigen::Dynamic, 3, 3>& lin,
                                   const PoseSource::Compared& z) const;
  [[nodiscard]] Pose2 body_rate() const;
  [[nodiscard]] Vector<3> world_rate() const;
  [[nodiscard]] bool is_overdue(Stamp stamp) const;
  void keep_without_poses_linear();
  template <class Linearize>
  Outcome correct_by(const RangeBearing& z, Slots slots, const Linearize& linearize);
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, Eigen::Dynamic>> sight(
      const Landmark& landmark, const RangeBearing& z) const;
  [[nodiscard]] std::vector<const Landmark*> associated(const std::vector<RangeBearing>& sightings,
                                                        Association association) const;
  Outcome on(const RangeBearing& z, const Landmark* landmark);

  std::shared_ptr<const Recipe> recipe_;
  GaussianBelief belief_;
  std::optional<GaussianBelief> without_poses_;  // the same, from the first pose on
  PoseSource pose_source_;
  struct Reading {
    double heading;
    double turned;  // by odometry, since it was read first
    double most;    // of that to either side
    [[nodiscard]] bool is_of(const Heading& z) const;
  };
  std::array<std::optional<Reading>, 2> readings_;  // the last heading and the last course
  Slot body_;
  HeldMotion odometry_;
  AdaptiveNoise adaptive_;
};

}  // namespace locfuse
