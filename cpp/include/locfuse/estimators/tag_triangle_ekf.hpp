// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/geometry/rigid_fit.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/models/measurement/point_distance.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/measurement/velocity.hpp"
#include "locfuse/models/motion/constant_velocity.hpp"

namespace locfuse {

/// Extended Kalman filter over the positions and velocities of three tags in world (celan2017,
/// section III.D): fixes of the tags, the velocities that wheel odometry gives them, and the sides
/// of their triangle; docs/models/poses.md. Ranges to anchors where there is no RTLS.
///
/// Slots: `tag0.position` to `tag2.position`, `tag0.velocity` to `tag2.velocity`, in the order in
/// which the tags are given. A cheap value: copying it is a snapshot. Every `on` throws
/// std::invalid_argument for a message that is not valid and NumericalError where numbers break. A
/// message that is not fused changes no bit of the estimator.
class TagTriangleEkf {
 public:
  struct Config {
    PointMotion::Config motion;
    VelocityModel::Config velocity;
    PointDistanceModel::Config side;
    RangeModel::Config range;
    PositionModel::Config position;  ///< sigmas of fixes; it has no antenna
    Limits limits;
    /// From tag 0 to 1, 1 to 2, 2 to 0 by tape measure [m]: refused unless the tags in body agree.
    std::optional<Vector<3>> sides_m = {};
    /// Whether wheels turn to velocities in world by a heading without error, as in the paper; else
    /// by that of the tags, with its Jacobian.
    bool heading_is_known = false;
    /// Whether fixes and ranges are followed by the sides, once for all of a stamp, where there has
    /// been no odometry for a second; else only odometry is.
    bool holds_sides = false;
    double sigma_start_velocity_mps = 0.5;  ///< of each tag, each axis [m/s]
    double correlation_s = 10.0;            ///< of fixes and ranges, as of a PoseEkf [s]
  };

  static constexpr int kTags = 3;
  static constexpr int kVariables = 12;

  /// Starts from a pose, at rest but for what its sigma says. Throws std::invalid_argument on a
  /// config out of range, anything but three tags that make a triangle, or a start that is not
  /// finite and positive definite.
  TagTriangleEkf(const Config& config, const World& world, const PoseEstimate& start);

  /// Starts from a fix of each tag, of one stamp, and fuses the sides. Throws as above, and if the
  /// fixes do not fit the triangle: then it names the order of ids that would.
  TagTriangleEkf(const Config& config, const World& world, const std::vector<PositionFix>& start);

  /// Of a tag that it names; kNotModelled without one.
  Outcome on(const PositionFix& z);
  /// The velocities of the three tags, as one measurement, then the sides; see `sides`.
  Outcome on(const Velocity& u);
  /// Its mean velocity, from its beginning on, or from where the belief is within its time. One
  /// without duration is kNotModelled.
  Outcome on(const Increment& u);
  /// Of a tag to an anchor.
  Outcome on(const Range& z);
  /// Checked, and kNotModelled: it has no height.
  Outcome on(const Altitude& z);
  Outcome on(const Heading& z);
  /// Poses, sightings and scans are kIgnored.
  Outcome on(const Message& message);

  /// Fuses the three sides at the belief's own stamp, as one measurement: for who has no odometry,
  /// which does so by itself, and does not let `holds_sides` do it.
  Outcome hold_sides();

  /// Carries the belief to `stamp`. Earlier stamps change nothing. Throws std::invalid_argument if
  /// the stamp is beyond kStampLimit.
  void advance_to(Stamp stamp);

  /// The body on the tags, weighted with their covariance. Its nis measures how rigid they are.
  [[nodiscard]] RigidFit fit() const;
  /// The pose of that. Throws NumericalError if the tags prefer no heading, as does `estimate`.
  [[nodiscard]] Pose2 pose() const { return current().pose; }
  /// The belief at its own stamp.
  [[nodiscard]] PoseEstimate current() const;
  /// The belief carried to the end of the received odometry: the pose now.
  [[nodiscard]] PoseEstimate estimate() const;
  /// The belief carried to `stamp`, which must not lie before it.
  [[nodiscard]] PoseEstimate estimate(Stamp stamp) const;

  /// The same filter, started anew; what it has learnt of correlated errors stays. Throws as the
  /// constructor does.
  [[nodiscard]] TagTriangleEkf restarted(const PoseEstimate& start) const;

  /// What became of the sides the last time.
  [[nodiscard]] const Outcome& sides() const { return sides_; }

  [[nodiscard]] const GaussianBelief& belief() const { return belief_; }
  /// How often a variance left its bounds and was put back, or P was made positive definite again.
  [[nodiscard]] std::uint64_t interventions() const { return belief_.interventions; }
  [[nodiscard]] const std::vector<Tag>& tags() const;

 private:
  struct Recipe;  // what never changes, shared by all snapshots
  class Transaction;

  TagTriangleEkf(std::shared_ptr<const Recipe> recipe, Stamp stamp, const Vector<6>& positions,
                 const Matrix<6, 6>& covariance);
  TagTriangleEkf(const std::shared_ptr<const Recipe>& recipe, const PoseEstimate& start);
  template <class Linearize, class Why>
  Outcome correct(Stamp stamp, const Gate& gate, const Linearize& linearize, const Why& why);
  Outcome take(Stamp begin, Stamp end, const Vector<3>& twist);
  [[nodiscard]] bool lacks_odometry() const;
  [[nodiscard]] Matrix<3, 6> pose_by_tags(const Pose2& pose) const;
  [[nodiscard]] Vector<2> position(int tag) const { return belief_.x.segment<2>(2 * tag); }

  std::shared_ptr<const Recipe> recipe_;
  GaussianBelief belief_;
  Outcome sides_;
  bool sides_due_ = false;               // before time moves on
  std::optional<Stamp> odometry_until_;  // end of the last motion
  double speed_ = 0.0;                   // of that [m/s + rad/s]
};

}  // namespace locfuse
