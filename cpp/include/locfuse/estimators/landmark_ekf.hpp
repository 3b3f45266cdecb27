// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/filters/association.hpp"
#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// A landmark that is known before the first message.
struct KnownLandmark {
  Id id = 0;
  Vector<2> position = Vector<2>::Zero();  ///< in world [m]
  std::optional<Matrix<2, 2>> covariance;  ///< [m^2]; without it the position is exact
};

/// What a LandmarkEkf says of a landmark.
struct LandmarkEstimate {
  Id id = 0;
  Vector<2> position = Vector<2>::Zero();          ///< in world [m]
  Matrix<2, 2> covariance = Matrix<2, 2>::Zero();  ///< [m^2]; zero if it is exact
  int sightings = 0;                               ///< of it, fused or counted
  bool confirmed = false;                          ///< whether it corrects the pose
};

/// Extended Kalman filter over the pose and the landmarks it sees: it maps while it localizes
/// (Smith et al., 1990). Derivation: docs/models/landmarks.md.
///
/// A sighting that no landmark explains puts a new one into the state. It is tentative at first:
/// it takes part in the belief with all its correlations, but its sightings are only counted. A
/// sighting with a name needs no count, for the name says that it was recognized.
///
/// Copying it is a snapshot. Every `on` throws std::invalid_argument for a message that is not
/// valid and NumericalError where numbers break. A message that is not fused, for whatever reason,
/// changes no bit of the estimator.
class LandmarkEkf {
 public:
  struct Config {
    OdometryMotion::Config odometry;
    RangeBearingModel::Config landmark;
    PositionModel::Config position;
    Limits limits;
    /// The same, wider: only a sighting that is outside this gate of every landmark is of a new
    /// one. Between the two gates it is ambiguous, and dropped.
    double gate_new = 0.999999;
    int min_sightings = 3;          ///< that make a tentative landmark a confirmed one
    double confirm_within_s = 2.0;  ///< a tentative one is dropped this long after its first [s]
    int max_landmarks = 500;        ///< in the state; further ones are not added
    double correlation_s = 10.0;    ///< as of a PoseEkf [s]
    double hold_s = 1.0;            ///< as of a PoseEkf [s]
    double sigma_lost_xy_per_sqrt_s = 0.5;       ///< as of a PoseEkf [m / sqrt(s)]
    double sigma_lost_heading_per_sqrt_s = 0.5;  ///< as of a PoseEkf [rad / sqrt(s)]
    std::vector<KnownLandmark> known;            ///< that it begins with
  };

  /// Starts from `start`; of the world it takes where the landmark sensor sits. Throws
  /// std::invalid_argument on a config out of range, a start that is not finite and positive
  /// definite, or landmarks that are given twice or have no valid position or covariance.
  LandmarkEkf(const Config& config, const World& world, const PoseEstimate& start);

  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  Outcome on(const PositionFix& z);
  /// One sighting by itself; without a name it is of the nearest landmark.
  Outcome on(const RangeBearing& z);
  /// Checked, and kNotModelled: it has no height.
  Outcome on(const Altitude& z);
  Outcome on(const Heading& z);
  /// Ranges, poses and scans are kIgnored.
  Outcome on(const Message& message);

  /// Sightings of one instant. Those that landmarks explain are fused first; the others are then of
  /// tentative landmarks, of new ones, or kGated. A new or tentative landmark makes it kFused.
  /// kNotModelled: range or bearing alone of an unknown landmark, no room for it, or numbers that
  /// leave no finite result.
  std::vector<Outcome> on_joint(const std::vector<RangeBearing>& sightings,
                                Association association = Association::kJoint);

  /// Carries the belief to `stamp` with what odometry says. Earlier stamps change nothing. Throws
  /// std::invalid_argument if the stamp is beyond kStampLimit.
  void advance_to(Stamp stamp);

  /// The same map and the same pose, that of `estimate`, on a clock that now shows `stamp`. Throws
  /// std::invalid_argument if the stamp is beyond kStampLimit.
  [[nodiscard]] LandmarkEkf continued_at(Stamp stamp) const;

  /// The pose at the belief's own stamp.
  [[nodiscard]] PoseEstimate current() const;
  /// The pose now: carried to the end of the received odometry.
  [[nodiscard]] PoseEstimate estimate() const;
  /// The pose carried to `stamp`, which must not lie before the belief.
  [[nodiscard]] PoseEstimate estimate(Stamp stamp) const;
  /// All landmarks, in the order in which they came in.
  [[nodiscard]] std::vector<LandmarkEstimate> landmarks() const;

  [[nodiscard]] const GaussianBelief& belief() const { return belief_; }
  /// How often a variance left its bounds and was put back, or P was made positive definite again.
  [[nodiscard]] std::uint64_t interventions() const { return belief_.interventions; }
  [[nodiscard]] Pose2 pose() const { return {belief_.x(0), belief_.x(1), belief_.x(2)}; }

 private:
  struct Recipe {  // what never changes, shared by all snapshots
    Config config;
    OdometryMotion motion;
    OdometryMotion lost;
    RangeBearingModel landmark;
    PositionModel position;
    Gate landmark_gate;
    Gate position_gate;
    Gate new_gate;
    Stamp hold;
    Stamp confirm_within;
  };
  struct Track {
    Id id;
    std::optional<Slot> slot;  // without one it is exact
    Vector<2> exact;
    int sightings;
    bool confirmed;
    Stamp first_seen;
  };
  struct Match {
    int track = -1;  // or none
    Outcome outcome;
  };
  using Sighting = Linearization<Eigen::Dynamic, 5, 2>;

  static Recipe recipe_of(const Config& config, const Pose2& T_body_sensor);
  void add_known(const KnownLandmark& landmark);
  [[nodiscard]] int find(Id id) const;
  [[nodiscard]] Vector<2> position_of(const Track& track) const;
  [[nodiscard]] Matrix<5, 5> covariance_with(const Track& track) const;
  [[nodiscard]] bool in_reach(const Track& track, const RangeBearing& z) const;
  [[nodiscard]] std::optional<Sighting> linearize(const Track& track, const RangeBearing& z) const;
  [[nodiscard]] Outcome compare(const Track& track, const Sighting& lin) const;
  std::vector<Outcome> fuse_together(const std::vector<RangeBearing>& sightings,
                                     Association association);
  [[nodiscard]] std::vector<int> associated(const std::vector<RangeBearing>& sightings,
                                            Association association) const;
  [[nodiscard]] Pairings candidates(const std::vector<RangeBearing>& sightings) const;
  [[nodiscard]] Match nearest(const RangeBearing& z) const;
  Outcome correct(Track& track, const RangeBearing& z);
  Outcome unexplained(const RangeBearing& z, std::vector<bool>& seen);
  Outcome count(Track& track, const RangeBearing& z, Outcome outcome);
  Outcome add(const RangeBearing& z);
  void drop_tentative();

  std::shared_ptr<const Recipe> recipe_;
  GaussianBelief belief_;
  Slot body_;
  HeldMotion odometry_;
  std::vector<Track> tracks_;
  Id unnamed_ = -1;  // id of the next landmark without a name
};

}  // namespace locfuse
