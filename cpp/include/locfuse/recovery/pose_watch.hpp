// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/geometry/uncertain_motion.hpp"
#include "locfuse/models/measurement/pose.hpp"
#include "locfuse/models/motion/odometry.hpp"
#include "locfuse/recovery/health.hpp"

namespace locfuse {

/// Why poses of another localizer are not kOk.
enum class WatchReason : std::uint8_t {
  kNone,
  kNoEstimate,      ///< there is no estimate to judge them by yet
  kNoPose,          ///< no pose that could be judged has been received yet
  kFarOff,          ///< too far from the estimate
  kContradicted,    ///< measurements contradict the place on which both agree
  kJumped,          ///< moved as odometry did not
  kSigmasTooSmall,  ///< near, but farther off than their covariance says
  kSilent,          ///< no pose for some time, though the robot has moved on
  kUnverified,      ///< the estimate cannot judge: lost elsewhere, vague, or by odometry alone
};

/// How far the poses of another localizer may be trusted, in numbers.
struct WatchReport {
  Stamp stamp = 0;
  HealthState state = HealthState::kInitializing;
  WatchReason reason = WatchReason::kNoEstimate;
  std::optional<Stamp> judged;  ///< the last pose that was judged [ns]
  double wrong = 1.0;           ///< probability that it is not `within`
  double within = 0.0;  ///< probability that its position error is below limit_m, and its heading's
                        ///< below kMaxHeadingError
  /// Its last pose, carried on by odometry, less the estimate: x [m], y [m], heading [rad].
  Vector<3> error = Vector<3>::Constant(std::numeric_limits<double>::quiet_NaN());
  /// |error| of x [m], y [m] and heading [rad] exceeds these with probability `risk` at most;
  /// infinite where no level holds.
  Vector<3> protection = Vector<3>::Constant(std::numeric_limits<double>::infinity());
};

/// Judges the poses of another localizer by an estimate that does not use them.
///
/// Between its poses the other localizer is where odometry carries the last one, as a robot that
/// uses it is. Where the estimate is too vague to judge, poses are compared with one another by
/// odometry alone. Derivation: docs/watch.md. A cheap value; allocates nothing.
class PoseWatch {
 public:
  struct Config {
    Health::Config health;  ///< limit_m, risk, probability_lost and aiding_lost_s
    PoseModel::Config pose;
    OdometryMotion::Config odometry;
    Limits limits;
    double hold_s = 1.0;  ///< odometry timeout [s]
  };

  static constexpr double kMaxHeadingError = 0.5;  ///< [rad]

  /// Throws std::invalid_argument on a config out of range.
  explicit PoseWatch(const Config& config);

  /// Takes odometry that an estimator has taken.
  void on(const Velocity& u);
  void on(const Increment& u);
  /// Takes a pose, with the estimate at its stamp and that estimate's health. Returns kIgnored with
  /// kWatched and the numbers of its innovation; kStale for one from before odometry or another.
  Outcome on(const PoseObservation& z, const PoseEstimate& estimate, const HealthReport& health);

  /// What is to be said of it at the stamp of `estimate`. Both throw NumericalError unless the
  /// covariance of the estimate is positive definite.
  [[nodiscard]] WatchReport report(const PoseEstimate& estimate, const HealthReport& health) const;

 private:
  struct Carried {  // a pose, and the motion since
    PoseObservation pose;
    UncertainMotion since = {};
    bool has_moved_on = false;  // so far that another pose was due
    bool is_blind = false;      // for some of the time there was no odometry

    [[nodiscard]] Pose2 now() const { return pose.pose * since.motion; }
  };

  void advance(Stamp stamp);
  void drive(Carried& pose, const Pose2& motion, double seconds,
             const std::optional<Vector<3>>& variance) const;
  [[nodiscard]] WatchReport judge(const PoseEstimate& estimate, const HealthReport& health) const;
  [[nodiscard]] bool agrees_with_reference(const Carried& pose) const;

  Health::Config health_;
  PoseModel model_;
  Gate gate_;
  OdometryMotion motion_;
  Limits limits_;
  Stamp hold_;
  Stamp aiding_lost_;
  HeldMotion odometry_{0};
  Stamp stamp_ = std::numeric_limits<Stamp>::min();  // up to which poses are carried
  std::optional<Carried> newest_;
  std::optional<Carried> reference_;  // one of some seconds ago, from before a jump
  std::optional<Stamp> doubted_since_;
  bool parted_ = false;  // a pose was elsewhere since measurements contradict the estimate
  double excess_ = 1.0;  // mean NIS per row of poses
};

}  // namespace locfuse
