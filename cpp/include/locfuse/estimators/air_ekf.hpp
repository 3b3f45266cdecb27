// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/filters/noise_shape.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/models/measurement/altitude.hpp"
#include "locfuse/models/measurement/pose.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/constant_velocity.hpp"
#include "locfuse/models/motion/inertial.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// How a body is turned in space.
struct Attitude {
  Vector<4> quaternion = Vector<4>::UnitX();  ///< (w, x, y, z) of R_world_body, w >= 0
  /// Of its error, a rotation about the axes of the world [rad^2].
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();
};

/// Where a body that flies is at one instant. Its heading is that of its x axis in the plane, which
/// is unknown where that axis is vertical.
struct AirEstimate {
  Stamp stamp = 0;
  Pose2 pose;
  double height = 0.0;                             ///< over z = 0 of the world [m]
  Matrix<4, 4> covariance = Matrix<4, 4>::Zero();  ///< of (x, y, heading, height)
  std::optional<Attitude> attitude = {};           ///< empty for a body that is taken as level
};

/// What carries an AirEkf from one measurement to the next.
enum class AirMotion : std::uint8_t {
  kOdometry,          ///< Velocity or Increment, and a climb rate
  kConstantVelocity,  ///< nobody measures it
  kInertial,          ///< Imu
};

/// Extended Kalman filter over (x, y, heading, height) of a body that flies, and without odometry
/// over its velocity and climb rate; with an inertial sensor also over its attitude and the biases
/// of the sensor. Without one the body is taken as level: docs/air.md.
///
/// Its belief is that of a PoseEkf, slot `body`, with `height` and, without odometry, `velocity`
/// (in world, m/s) and `climb` (m/s). Inertial, it has `tilt` as well, the error of the attitude
/// about x and y of the world, whose mean is 0 as the attitude takes it up, `rate_bias` and
/// `force_bias`. The first Imu shows which way is up.
///
/// A cheap value: copying it is a snapshot. Every `on` throws std::invalid_argument for a message
/// that is not valid and NumericalError where numbers break. A message that is not fused changes no
/// bit of the estimator, but that a sample which is rejected is remembered, to judge the next.
class AirEkf {
 public:
  struct Config {
    AirMotion motion = AirMotion::kOdometry;
    OdometryMotion::Config odometry;
    double sigma_height_per_sqrt_s = 0.1;  ///< beside the reported climb rate [m / sqrt(s)]
    ConstantVelocityMotion::Config constant_velocity;
    double sigma_start_velocity_mps = 1.0;  ///< of each axis, with constant velocity [m/s]
    double sigma_start_climb_mps = 0.5;     ///< [m/s]
    InertialMotion::Config inertial;
    RangeModel::Config range;
    PositionModel::Config position;
    PoseModel::Config pose;
    AltitudeModel::Config altitude;
    RangeBearingModel::Config landmark;
    RangeBearingModel::InSpace landmark_in_space;
    Limits limits;
    double min_height_m = -1e9;       ///< of the room, floor and ceiling, in which the body is [m]
    double max_height_m = 1e9;        ///< [m]
    double robust_dof = 4.0;          ///< degrees of freedom of kStudentT
    double robust_late_share = 0.05;  ///< share of ranges that are too long, for kOneSided
    double correlation_s = 10.0;      ///< as of PoseEkf [s]
    double hold_s = 1.0;              ///< odometry timeout: the last motion is held this long [s]
    double sigma_lost_xy_per_sqrt_s = 0.5;       ///< process noise after the timeout [m / sqrt(s)]
    double sigma_lost_heading_per_sqrt_s = 0.5;  ///< [rad / sqrt(s)]
    double sigma_lost_height_per_sqrt_s = 0.5;   ///< [m / sqrt(s)]
  };

  /// The plane in which anchors are; none where they are in a line, or fewer than three.
  struct Plane {
    bool exists = false;
    Vector<3> centre = Vector<3>::Zero();
    Vector<3> normal = Vector<3>::UnitZ();
  };

  /// Starts from `start`, with constant velocity at rest but for what its sigmas say. Throws
  /// std::invalid_argument on a config out of range or a start that is not finite and positive
  /// definite.
  AirEkf(const Config& config, const World& world, const AirEstimate& start);

  /// Odometry in the plane, and the climb rate [m/s] that goes with it for as long. Ignored with
  /// constant velocity.
  Outcome on(const Velocity& u, double climb_rate = 0.0);
  Outcome on(const Increment& u, double climb_rate = 0.0);
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  Outcome on(const Altitude& z);
  Outcome on(const Heading& z);
  Outcome on(const PoseObservation& z);
  /// Holds until the next one, or for 0.1 s. Ignored unless inertial; kNotModelled without a force,
  /// or with one of 0, as of a sensor without an accelerometer. kImplausible if it leaps alone, if
  /// it repeats itself while the body moves, or if it begins with a force that is no gravity.
  Outcome on(const Imu& z);
  static constexpr bool kTakesImu = true;
  /// Of a landmark that it names, at its height; kNotModelled without a name.
  Outcome on(const RangeBearing& z);

  /// Odometry as one that does not climb. Scans are kIgnored.
  Outcome on(const Message& message);

  /// Carries the belief to `stamp`. Earlier stamps change nothing. Throws std::invalid_argument if
  /// the stamp is beyond kStampLimit.
  void advance_to(Stamp stamp);

  /// What `on` would compare, but fuses nothing: kGated in place of kFused.
  Outcome weigh(const Range& z);

  /// How far ranges like this one are from flat over the belief, once that is carried to its stamp:
  /// what one sigma across the line of sight changes, in sigmas of its noise; eq. (3) of
  /// docs/air.md. 0 for one that is not modelled.
  [[nodiscard]] double bend(const Range& z) const;
  /// The places (x, y, height) that ranges of about one moment and the belief allow: the minima of
  /// their costs, the likeliest first.
  [[nodiscard]] std::vector<Vector<3>> places(const std::vector<Range>& ranges) const;
  /// The same as `on`, but linearized at `place`, (x, y, height), where the body is at stamp `at`:
  /// kGated also if it does not fit there.
  Outcome on_at(const Range& z, const Vector<3>& place, Stamp at);
  /// (x, y, height) at a stamp beside that of the belief, by the velocity if that is a state.
  [[nodiscard]] Vector<3> place_at(Stamp at) const;
  /// The mirror image across the plane of the anchors, where ranges cannot tell it from this: about
  /// as near to that plane as the belief reaches, and inside the room. Its odds, eq. (4). None of
  /// an inertial body, whose sensor knows which way it moves.
  [[nodiscard]] std::optional<std::pair<AirEkf, double>> image() const;
  /// Log of the probability that the height is one of the room.
  [[nodiscard]] double log_inside() const;
  /// The mixture of this, with its weight, and others of the same recipe with theirs, as one
  /// Gaussian at the stamp of the newest; the weights sum to 1.
  [[nodiscard]] AirEkf mixed(double weight,
                             const std::vector<std::pair<const AirEkf*, double>>& others) const;
  /// The same that may be anywhere within about `span` [m] to either side, at any heading, with
  /// the velocity of a start.
  [[nodiscard]] AirEkf anywhere(double span) const;
  /// The same at headings all around, each known well enough to be linearized about; itself alone
  /// where its heading is, or where nothing depends on it.
  [[nodiscard]] std::vector<AirEkf> by_heading() const;
  /// Whether its heading is known well enough for that, or nothing depends on it.
  [[nodiscard]] bool has_heading() const;

  /// The same place and velocity, those of `estimate`, on a clock that now shows `stamp`. Throws
  /// std::invalid_argument if the stamp is beyond kStampLimit.
  [[nodiscard]] AirEkf continued_at(Stamp stamp) const;

  /// The belief at its own stamp.
  [[nodiscard]] AirEstimate current() const;
  /// The belief carried to the end of the received odometry: where it is now.
  [[nodiscard]] AirEstimate estimate() const;
  /// The belief carried to `stamp`, which must not lie before it.
  [[nodiscard]] AirEstimate estimate(Stamp stamp) const;

  [[nodiscard]] const GaussianBelief& belief() const { return belief_; }
  /// How often a variance left its bounds and was put back, or P was made positive definite again.
  [[nodiscard]] std::uint64_t interventions() const { return belief_.interventions; }
  [[nodiscard]] static constexpr bool is_in_space() { return true; }  ///< as of RecoveringEkf
  [[nodiscard]] Pose2 pose() const { return belief_.pose(body_); }
  [[nodiscard]] double height() const { return belief_.x(belief_.offset(height_)); }
  [[nodiscard]] bool is_inertial() const { return recipe_motion() == AirMotion::kInertial; }
  [[nodiscard]] Matrix<3, 3> attitude() const;  ///< R_world_body

 private:
  struct Recipe;   // what never changes, shared by all snapshots
  struct Sample {  // of the inertial sensor, in the axes of the body
    Stamp stamp;
    Vector<3> rate;
    Vector<3> force;
  };
  /// What samples of the last second say: powers, of the differences between successive ones half.
  struct Shaking {
    double seconds = 0.0;                ///< how long, at most one
    Vector<2> push = Vector<2>::Zero();  ///< last horizontal acceleration [m/s^2]
    double pushes = 0.0;                 ///< of it
    Vector<2> mean = Vector<2>::Zero();  ///< of the same
    double noise = 0.0;                  ///< of its differences
    Vector<3> rate = Vector<3>::Zero();  ///< mean [rad/s]
    double rates = 0.0;                  ///< about that
    double rate_noise = 0.0;             ///< of differences
    double still_s = 0.0;                ///< how long the body has stood still
  };
  class Undo;

  template <class Motion>
  Outcome take(const Motion& u, double climb_rate);
  [[nodiscard]] AirMotion recipe_motion() const;
  void lift(Stamp stamp);
  void integrate(Stamp stamp, const Vector<3>& rate, const Vector<3>& force);
  void coast(Stamp stamp);
  [[nodiscard]] std::optional<Reason> distrusted(const Sample& now);
  void watch(const Sample& now);
  void learn_at_rest(double seconds);
  [[nodiscard]] double heading_share() const;
  [[nodiscard]] Matrix<1, 3> heading_by_rotation() const;
  void forget_attitude();
  [[nodiscard]] bool look_up(const Vector<3>& force);
  void turn_to(const Matrix<3, 3>& attitude);
  void take_up_tilt();
  void stay_inside();
  [[nodiscard]] Vector<3> position() const;
  [[nodiscard]] InertialMotion::State inertial_state() const;
  [[nodiscard]] std::array<int, 3> velocity_rows() const;
  [[nodiscard]] std::optional<Linearization<1, 4>> look(const Vector<3>& place,
                                                        const Range& z) const;
  [[nodiscard]] Vector<3> jacobian_arm(const Vector<3>& arm) const;
  [[nodiscard]] Vector<3> arm_of(const std::vector<Tag>& tags, Id tag) const;
  [[nodiscard]] Eigen::VectorXd off(const AirEkf& other) const;
  [[nodiscard]] Matrix<3, 3> spread() const;
  [[nodiscard]] double squared_speed(const Vector<3>& along) const;
  Outcome correct_by(const Range& z, const Gate& gate);
  Outcome correct_at(const Range& z, const Gate& gate, const Vector<3>* place);
  template <class Noise, class See, class Why>
  Outcome correct(Stamp stamp, const Gate& gate, const Noise& noise, const See& see,
                  const Why& why);

  std::shared_ptr<const Recipe> recipe_;
  GaussianBelief belief_;
  Slot body_;
  Slot height_;
  std::vector<Slot> place_;   // body, height
  std::vector<Slot> moving_;  // and, without odometry, velocity and climb; inertial: all there is
  HeldMotion odometry_;
  double arm_heading_ = 0.0;  // of `jacobian_arm`
  Shaking shaking_;
  std::optional<Sample> received_;                   // the last one, trusted or not
  int repeated_ = 0;                                 // samples that are the one before
  bool has_leapt_ = false;                           // the last one, which was left out for that
  std::optional<Sample> sample_;                     // the last one that was trusted
  bool has_up_ = false;                              // whether a force has shown which way it is
  Matrix<3, 3> upright_ = Matrix<3, 3>::Identity();  // the attitude less the heading
  double climb_rate_ = 0.0;                          // [m/s], held as long as odometry is
};

}  // namespace locfuse
