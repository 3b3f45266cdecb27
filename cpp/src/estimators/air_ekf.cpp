// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/air_ekf.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/frontends/multilateration.hpp"
#include "locfuse/geometry/rotation.hpp"
#include "locfuse/math/angle.hpp"
#include "locfuse/math/symmetric.hpp"
#include "math/sigma.hpp"

namespace locfuse {
namespace {

using Whole = Vector<InertialMotion::kVariables>;

double variance_of(const char* name, double sigma) {
  internal::sigma_in_bounds(name, sigma);
  return sigma * sigma;
}

/// Docs/air.md.
struct AirTuning {
  /// Time in which a belief grows by so little that its bend is that of before [s].
  static constexpr double kFlatSeconds = 0.1;
  /// Ranges of which any one is left out for a place; of more an outlier has less weight.
  static constexpr Eigen::Index kMaxSpare = 12;
  /// Share of the variance along anchors that they have across, or they are in a line.
  static constexpr double kMinBreadth = 1e-3;
  /// Sigmas of the distance to the anchors' plane between which an image is another place.
  static constexpr double kMinImage = 0.6;
  static constexpr double kMaxImage = 2.5;
  /// Probability of being inside the room below which an image is no other place.
  static constexpr double kMinInside = 1e-3;
  /// How long a sample of an inertial sensor holds [ns].
  static constexpr Stamp kHoldsSample = 100'000'000;
  /// Forces of a sensor that may be right [m/s^2].
  static constexpr double kMaxForce = 1e3;
  /// Differences of two samples that only the next one may confirm.
  static constexpr double kLeapOfForce = 100.0;  ///< [m/s^2]
  static constexpr double kLeapOfRate = 10.0;    ///< [rad/s]
  /// Samples that are the same, after which they are those of a sensor that hangs if it moves.
  static constexpr int kFrozen = 10;
  static constexpr double kFrozenRate = 0.05;  ///< [rad/s]
  static constexpr double kFrozenForce = 0.5;  ///< off gravity's [m/s^2]
  /// Silence after which nobody knows the attitude any more [ns].
  static constexpr Stamp kForgets = 1'000'000'000;
  /// Time over which samples are watched [s].
  static constexpr double kWatched = 1.0;
  /// Times the power of noise that shows in differences: they miss some of it, and vary.
  static constexpr double kNoiseOverDifferences = 2.0;
  /// A body stands still that shakes less than this beyond noise, whose noise is less than that.
  static constexpr double kStillPush = 0.05;   ///< [m/s^2]
  static constexpr double kStillRate = 0.003;  ///< [rad/s]
  static constexpr double kCalmPush = 0.3;     ///< [m/s^2]
  static constexpr double kCalmRate = 0.05;    ///< [rad/s]
  /// Sigma of its rate then, once a second [rad/s]; no bias is known better than by a part of it.
  static constexpr double kSigmaStill = 0.005;
  static constexpr double kLeastBias = 0.001;
  static constexpr double kStillGate = 0.999;
  /// Mean rate of a second from which on a body turns [rad/s].
  static constexpr double kTurning = 0.1;
  /// Forces by which a body knows which way is up, over gravity's.
  static constexpr double kLeastUp = 0.5;
  static constexpr double kMostUp = 1.5;
  /// Sigma of the tilt then: a body that starts accelerates by about this share of gravity [rad].
  static constexpr double kSigmaTilt = 0.15;
  /// Horizontal part of the x axis below which it has no heading.
  static constexpr double kLeastLevel = 0.1;
  /// Sigma of a heading beyond which it is split [rad]; into so many, each of such a sigma.
  static constexpr double kAnyHeading = 0.6;
  static constexpr int kHeadings = 8;
  static constexpr double kSigmaHeading = 0.3;
};

constexpr double kUnbounded = 1e9;  // [m]

Matrix<1, 1> scalar(double value) { return Matrix<1, 1>(value); }

/// The plane in which anchors are.
AirEkf::Plane plane_of(const AnchorMap& anchors) {
  AirEkf::Plane plane;
  if (anchors.anchors().size() < 3) {
    return plane;
  }
  const double share = 1.0 / static_cast<double>(anchors.anchors().size());
  for (const Anchor& anchor : anchors.anchors()) {
    plane.centre += share * anchor.position;
  }
  Matrix<3, 3> moments = Matrix<3, 3>::Zero();
  for (const Anchor& anchor : anchors.anchors()) {
    const Vector<3> off = anchor.position - plane.centre;
    moments += share * off * off.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix<3, 3>> eigen(moments);
  plane.exists = eigen.eigenvalues()(1) > AirTuning::kMinBreadth * eigen.eigenvalues()(2);
  plane.normal = eigen.eigenvectors().col(0);
  return plane;
}

/// Probability that a standard normal variable is less.
double normal_below(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

/// The height of a start, with what it shares with the pose.
Slot add_height(GaussianBelief& belief, Slot body, const AirEstimate& start) {
  const Matrix<4, 4>& P = start.covariance;
  if (!is_covariance(P) || !std::isfinite(start.height)) {
    throw std::invalid_argument(
        "a start has height " + std::to_string(start.height) +
        " m, expected a finite one with a symmetric positive definite covariance");
  }
  const Vector<3> shared = P.topRightCorner<3, 1>();
  const Matrix<1, 3> J = P.topLeftCorner<3, 3>().llt().solve(shared).transpose();
  return augment(belief, "height", SlotKind::kScalar, scalar(start.height), J,
                 scalar(P(3, 3) - J * shared), body);
}

/// What a measurement says of (x, y, heading, height), of (x, y, heading) or of the height, and of
/// an inertial body its derivative with respect to a rotation about the axes of the world.
template <class Lin>
struct Seen {
  Lin lin;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, 3, 3> by_rotation;
};

/// Of a point of the body at `arm` from its origin, in the axes of the world; `gradient` is by its
/// place in space, a row for each of the measurement.
template <class Lin, class Gradient>
Seen<Lin> seen_at(const Lin& lin, const Vector<3>& arm, const Gradient& gradient) {
  Seen<Lin> seen{lin, gradient};
  for (Eigen::Index i = 0; i < gradient.rows(); ++i) {
    seen.by_rotation.row(i) = arm.cross(Vector<3>(gradient.row(i)));
  }
  return seen;
}

/// The same of all variables of an inertial body.
template <int M, int N, int MaxM>
auto widened(const Seen<Linearization<M, N, MaxM>>& seen) {
  constexpr int kMost = M == 1 ? 1 : 3;
  Linearization<M, InertialMotion::kVariables, kMost> lin;
  const Linearization<M, N, MaxM>& lean = seen.lin;
  lin.residual = lean.residual;
  lin.noise = lean.noise;
  lin.jacobian.setZero(lean.residual.size(), InertialMotion::kVariables);
  if constexpr (N == 1) {
    lin.jacobian.col(3) = lean.jacobian;
  } else {
    lin.jacobian.template leftCols<N>() = lean.jacobian;
  }
  for (int axis = 0; axis < 3; ++axis) {
    lin.jacobian.col(InertialMotion::kRotation[static_cast<std::size_t>(axis)]) =
        seen.by_rotation.col(axis);
  }
  lin.correlation.time_s = lean.correlation.time_s;
  lin.correlation.kind = lean.correlation.kind;
  std::copy_n(lean.correlation.sources.begin(),
              std::min(lean.correlation.sources.size(), lin.correlation.sources.size()),
              lin.correlation.sources.begin());
  return lin;
}

}  // namespace

struct AirEkf::Recipe {
  Config config;
  Plane plane;  // of the anchors
  OdometryMotion motion;
  OdometryMotion lost;
  double height_per_s;
  double lost_height_per_s;
  ConstantVelocityMotion constant_velocity;
  InertialMotion inertial;
  RangeModel range;
  PositionModel position;
  AltitudeModel altitude;
  PoseModel pose;
  RangeBearingModel landmark;
  std::shared_ptr<const LandmarkMap> landmarks;  // never null
  Gate range_gate;
  Gate position_gate;
  Gate altitude_gate;
  Gate pose_gate;
  Gate landmark_gate;
  NoiseShape range_noise;
  NoiseShape position_noise;
  NoiseShape pose_noise;
  Stamp hold;
};

AirEkf::AirEkf(const Config& config, const World& world, const AirEstimate& start)
    : recipe_(std::make_shared<const Recipe>(
          Recipe{config,
                 plane_of(*internal::anchors_of(world)),
                 OdometryMotion(config.odometry),
                 internal::lost_motion(config),
                 variance_of("sigma_height_per_sqrt_s", config.sigma_height_per_sqrt_s),
                 variance_of("sigma_lost_height_per_sqrt_s",
                             internal::positive("sigma_lost_height_per_sqrt_s",
                                                config.sigma_lost_height_per_sqrt_s)),
                 ConstantVelocityMotion(config.constant_velocity),
                 InertialMotion(config.inertial),
                 RangeModel(config.range, internal::anchors_of(world), world.tags),
                 PositionModel(config.position, world.tags),
                 AltitudeModel(config.altitude),
                 PoseModel(config.pose),
                 RangeBearingModel(config.landmark, world.landmarks.T_body_sensor,
                                   config.landmark_in_space),
                 internal::landmarks_of(world),
                 Gate(config.range.gate),
                 Gate(config.position.gate),
                 Gate(config.altitude.gate),
                 Gate(config.pose.gate),
                 Gate(config.landmark.gate),
                 internal::noise_of("range.noise", config.range.noise, config),
                 internal::noise_of("position.noise", config.position.noise, config),
                 internal::noise_of("pose.noise", config.pose.noise, config),
                 internal::hold_of(config)})),
      belief_(
          GaussianBelief::of_pose(start.stamp, start.pose, start.covariance.topLeftCorner<3, 3>())),
      body_(belief_.slot("body")),
      height_(add_height(belief_, body_, start)),
      place_{body_, height_},
      moving_(place_),
      odometry_(start.stamp),
      arm_heading_(belief_.x(2)) {
  check_stamp(start.stamp);
  validate(config.limits);
  const double velocity =
      internal::positive("sigma_start_velocity_mps", config.sigma_start_velocity_mps);
  const double climb = internal::positive("sigma_start_climb_mps", config.sigma_start_climb_mps);
  if (!(config.min_height_m < config.max_height_m)) {
    throw std::invalid_argument("min_height_m is " + std::to_string(config.min_height_m) +
                                " and max_height_m is " + std::to_string(config.max_height_m) +
                                ", expected min_height_m < max_height_m");
  }
  if (config.motion != AirMotion::kOdometry) {
    moving_.push_back(belief_.add("velocity", SlotKind::kPoint2, Vector<2>::Zero(),
                                  velocity * velocity * Matrix<2, 2>::Identity()));
    moving_.push_back(belief_.add("climb", SlotKind::kScalar, scalar(0.0), scalar(climb * climb)));
  }
  if (is_inertial()) {
    const auto add = [this](const char* name, SlotKind kind, double sigma) {
      const int size = dimension_of(kind);
      moving_.push_back(belief_.add(name, kind, Eigen::VectorXd::Zero(size),
                                    sigma * sigma * Eigen::MatrixXd::Identity(size, size)));
    };
    add("tilt", SlotKind::kPoint2, AirTuning::kSigmaTilt);
    add("rate_bias", SlotKind::kPoint3, config.inertial.sigma_bias_radps);
    add("force_bias", SlotKind::kPoint3, config.inertial.sigma_bias_mps2);
  }
  internal::expect_correlated(belief_, config.correlation_s);
}

/// Puts belief and attitude back, bit for bit, unless the message that they were moved for is
/// fused.
class AirEkf::Undo {
 public:
  Undo(AirEkf& ekf, Stamp until)
      : belief_(ekf.belief_, until), upright_(ekf.upright_), before_(ekf.upright_) {}
  Undo(const Undo&) = delete;
  Undo& operator=(const Undo&) = delete;
  ~Undo() {
    if (!is_fused_) {
      upright_ = before_;
    }
  }
  [[nodiscard]] Outcome close(const Outcome& outcome) {
    is_fused_ = outcome.verdict == Verdict::kFused;
    return belief_.close(outcome);
  }

 private:
  internal::Transaction<3> belief_;
  Matrix<3, 3>& upright_;
  Matrix<3, 3> before_;
  bool is_fused_ = false;
};

AirMotion AirEkf::recipe_motion() const { return recipe_->config.motion; }

Vector<3> AirEkf::position() const { return {pose().x, pose().y, height()}; }

Matrix<3, 3> AirEkf::attitude() const { return rotation_by({0.0, 0.0, pose().heading}) * upright_; }

/// Splits an attitude into heading and what is left of it.
void AirEkf::turn_to(const Matrix<3, 3>& attitude) {
  const bool has_heading = attitude.col(0).head<2>().norm() > AirTuning::kLeastLevel;
  const double heading = has_heading ? yaw_of(attitude) : belief_.x(2);
  upright_ = orthonormal(rotation_by({0.0, 0.0, -heading}) * attitude);
  belief_.x(2) = wrap_angle(heading);
}

/// The heading is that of the x axis, eq. (8) of docs/air.md.
Matrix<1, 3> AirEkf::heading_by_rotation() const {
  const Vector<3> ahead = attitude().col(0);
  const double level =
      std::max(ahead.head<2>().squaredNorm(), AirTuning::kLeastLevel * AirTuning::kLeastLevel);
  return {-ahead.z() * ahead.x() / level, -ahead.z() * ahead.y() / level, 1.0};
}

/// The attitude takes up the mean of its error, which is 0 then.
void AirEkf::take_up_tilt() {
  const int tilt = InertialMotion::kRotation[0];
  const Vector<3> error(belief_.x(tilt), belief_.x(tilt + 1), 0.0);
  turn_to(rotation_by(error) * attitude());
  belief_.x(tilt) = belief_.x(tilt + 1) = 0.0;
}

/// Which way is up, of a body of which nobody knows: where gravity's support points.
bool AirEkf::look_up(const Vector<3>& force) {
  const double share = force.norm() / InertialMotion::kGravity;
  if (!(share > AirTuning::kLeastUp && share < AirTuning::kMostUp)) {
    return false;
  }
  const Matrix<3, 3> up = rotation_up(force);
  upright_ = orthonormal(rotation_by({0.0, 0.0, -yaw_of(up)}) * up);
  Eigen::MatrixXd P = belief_.P;
  for (const int row : {InertialMotion::kRotation[0], InertialMotion::kRotation[1]}) {
    P.row(row).setZero();
    P.col(row).setZero();
    P(row, row) = AirTuning::kSigmaTilt * AirTuning::kSigmaTilt;
  }
  belief_.P = P;
  has_up_ = true;
  return true;
}

/// After a silence the next force shows again which way is up.
void AirEkf::forget_attitude() {
  has_up_ = false;
  sample_.reset();
  shaking_ = {};
}

/// Why a sample says nothing of the motion of the body.
std::optional<Reason> AirEkf::distrusted(const Sample& now) {
  const bool repeats = received_ && now.rate == received_->rate && now.force == received_->force;
  repeated_ = repeats ? repeated_ + 1 : 0;
  received_ = now;
  const double beside_gravity = std::abs(now.force.norm() - InertialMotion::kGravity);
  const bool may_rest =
      now.rate.norm() < AirTuning::kFrozenRate && beside_gravity < AirTuning::kFrozenForce;
  if (repeated_ >= AirTuning::kFrozen && !may_rest) {
    return Reason::kFrozen;
  }
  const bool leaps = sample_ && ((now.rate - sample_->rate).norm() > AirTuning::kLeapOfRate ||
                                 (now.force - sample_->force).norm() > AirTuning::kLeapOfForce);
  has_leapt_ = leaps && !has_leapt_;
  return has_leapt_ ? std::optional(Reason::kJumped) : std::nullopt;
}

/// Sees how much of what the sensor measures is noise, as neighbours do not have it in common.
void AirEkf::watch(const Sample& now) {
  const Vector<3> bias = belief_.x(InertialMotion::kForceBias);
  const Vector<3> pushed = attitude() * (now.force - bias);
  const Vector<2> push = pushed.head<2>();
  if (!sample_ || shaking_.seconds == 0.0) {
    shaking_ = {};
    shaking_.push = push;
    shaking_.rate = now.rate;
    shaking_.seconds = 1e-9;
    return;
  }
  const double seconds = seconds_between(sample_->stamp, now.stamp);
  shaking_.seconds = std::min(shaking_.seconds + seconds, AirTuning::kWatched);
  const double news = std::min(seconds / shaking_.seconds, 1.0);
  const auto follow = [news](double& mean, double value) { mean += news * (value - mean); };
  follow(shaking_.pushes, push.squaredNorm());
  shaking_.mean += news * (push - shaking_.mean);
  follow(shaking_.noise, 0.5 * (push - shaking_.push).squaredNorm());
  follow(shaking_.rate_noise, 0.5 * (now.rate - sample_->rate).squaredNorm());
  shaking_.rate += news * (now.rate - shaking_.rate);
  follow(shaking_.rates, (now.rate - shaking_.rate).squaredNorm());
  shaking_.push = push;
  const Vector<3> turning = shaking_.rate - belief_.x(InertialMotion::kRateBias);
  if (heading_share() > 0.0 || turning.norm() > AirTuning::kTurning) {
    arm_heading_ = belief_.x(2);
  }
  learn_at_rest(seconds);
}

/// A body that stands still does not turn: then its gyro reads its bias; eq. (9) of docs/air.md.
void AirEkf::learn_at_rest(double seconds) {
  const auto square = [](double value) { return value * value; };
  const double doubt = AirTuning::kNoiseOverDifferences;
  const bool is_still =
      shaking_.seconds >= AirTuning::kWatched && shaking_.noise < square(AirTuning::kCalmPush) &&
      shaking_.rate_noise < square(AirTuning::kCalmRate) &&
      shaking_.pushes - shaking_.mean.squaredNorm() <
          doubt * shaking_.noise + square(AirTuning::kStillPush) &&
      shaking_.rates < doubt * shaking_.rate_noise + square(AirTuning::kStillRate);
  shaking_.still_s = is_still ? shaking_.still_s + seconds : 0.0;
  if (shaking_.still_s < AirTuning::kWatched) {
    return;
  }
  shaking_.still_s = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const int row = InertialMotion::kRateBias[static_cast<std::size_t>(axis)];
    if (belief_.P(row, row) < square(AirTuning::kLeastBias)) {
      continue;
    }
    Linearization<1, InertialMotion::kVariables> lin;
    lin.residual(0) = shaking_.rate(axis) - belief_.x(row);
    lin.jacobian.setZero();
    lin.jacobian(row) = 1.0;
    lin.noise(0) = square(AirTuning::kSigmaStill);
    (void)update(belief_, lin, moving_, Gate(AirTuning::kStillGate));
  }
  take_up_tilt();
}

/// Root of the share of the horizontal acceleration that is neither noise nor unknown: of the rest
/// a heading must not be learnt; see InertialMotion::propagate.
double AirEkf::heading_share() const {
  const double g = InertialMotion::kGravity;
  const std::array<int, 2> tilt{InertialMotion::kRotation[0], InertialMotion::kRotation[1]};
  double unknown = AirTuning::kNoiseOverDifferences * shaking_.noise;
  for (const int row : tilt) {
    unknown += g * g * belief_.P(row, row);
  }
  for (const int row : {InertialMotion::kForceBias[0], InertialMotion::kForceBias[1]}) {
    unknown += belief_.P(row, row);
  }
  const bool is_seen = shaking_.seconds >= AirTuning::kWatched && shaking_.pushes > unknown;
  return is_seen ? std::sqrt(1.0 - unknown / shaking_.pushes) : 0.0;
}

InertialMotion::State AirEkf::inertial_state() const {
  const Eigen::VectorXd& x = belief_.x;
  return {position(), x(InertialMotion::kVelocity), attitude(), x(InertialMotion::kRateBias),
          x(InertialMotion::kForceBias)};
}

/// Moves an inertial body by what its sensor measured on the way.
void AirEkf::integrate(Stamp stamp, const Vector<3>& rate, const Vector<3>& force) {
  const double seconds = seconds_between(belief_.stamp, stamp);
  const InertialMotion::Step step =
      recipe_->inertial.propagate(inertial_state(), rate, force, seconds, heading_share());
  Propagation<Whole, InertialMotion::kVariables> moved{belief_.x, step.jacobian, step.noise};
  moved.moved(InertialMotion::kPosition) = step.moved.position;
  moved.moved(InertialMotion::kVelocity) = step.moved.velocity;
  predict(belief_, moved, moving_);
  turn_to(step.moved.attitude);
  belief_.stamp = stamp;
}

/// Moves an inertial body without its sensor: nobody knows how it turns or speeds up.
void AirEkf::coast(Stamp stamp) {
  const double T = seconds_between(belief_.stamp, stamp);
  const ConstantVelocityMotion::Config& noise = recipe_->config.constant_velocity;
  Propagation<Whole, InertialMotion::kVariables> step;
  step.moved = belief_.x;
  step.jacobian.setIdentity();
  step.noise.setZero();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int place = InertialMotion::kPosition[axis];
    const int rate = InertialMotion::kVelocity[axis];
    const int turn = InertialMotion::kRotation[axis];
    const double sigma = axis < 2 ? noise.sigma_velocity_per_sqrt_s : noise.sigma_climb_per_sqrt_s;
    step.moved(place) += T * belief_.x(rate);
    step.jacobian(place, rate) = T;
    step.noise(place, place) = sigma * sigma * T * T * T / 3.0;
    step.noise(place, rate) = step.noise(rate, place) = sigma * sigma * T * T / 2.0;
    step.noise(rate, rate) = sigma * sigma * T;
    step.noise(turn, turn) = noise.sigma_heading_per_sqrt_s * noise.sigma_heading_per_sqrt_s * T;
  }
  predict(belief_, step, moving_);
  belief_.stamp = stamp;
}

Outcome AirEkf::on(const Imu& z) {
  validate(z);
  if (!is_inertial()) {
    return {Verdict::kIgnored, Reason::kNotUsed};
  }
  if (!z.specific_force || z.specific_force->isZero(0.0)) {
    return {Verdict::kNotModelled, Reason::kNotUsed};
  }
  if (!(z.angular_rate.norm() <= recipe_->config.limits.turn_rate_radps &&
        z.specific_force->norm() <= AirTuning::kMaxForce)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (z.stamp < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  const Sample now{z.stamp, recipe_->inertial.in_body(z.angular_rate),
                   recipe_->inertial.in_body(*z.specific_force)};
  if (sample_ && z.stamp - sample_->stamp > AirTuning::kForgets) {
    forget_attitude();
  }
  if (const std::optional<Reason> why = distrusted(now)) {
    return {Verdict::kImplausible, *why};
  }
  Undo undo(*this, z.stamp);
  if (sample_ && z.stamp - sample_->stamp <= AirTuning::kHoldsSample) {
    if (z.stamp > belief_.stamp) {
      integrate(z.stamp, 0.5 * (sample_->rate + now.rate), 0.5 * (sample_->force + now.force));
      stay_inside();
    }
  } else {
    advance_to(z.stamp);
  }
  if (!has_up_ && !look_up(now.force)) {
    return undo.close({Verdict::kImplausible, Reason::kBeyondLimits});
  }
  watch(now);
  sample_ = now;
  return undo.close({Verdict::kFused});
}

Outcome AirEkf::on(const Velocity& u, double climb_rate) { return take(u, climb_rate); }

Outcome AirEkf::on(const Increment& u, double climb_rate) { return take(u, climb_rate); }

template <class Motion>
Outcome AirEkf::take(const Motion& u, double climb_rate) {
  validate(u);
  if (!std::isfinite(climb_rate)) {
    throw std::invalid_argument("climb_rate is " + std::to_string(climb_rate) +
                                " m/s, expected a finite number");
  }
  const bool plausible = is_plausible(u, recipe_->config.limits) &&
                         std::abs(climb_rate) <= recipe_->config.limits.speed_mps;
  if (!plausible) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (recipe_->config.motion != AirMotion::kOdometry) {
    return {Verdict::kIgnored, Reason::kNotUsed};
  }
  internal::Transaction<3> transaction(belief_, u.stamp);
  lift(effective_stamp(u));
  const Outcome outcome =
      transaction.close(internal::take<Eigen::Dynamic>(*recipe_, odometry_, body_, belief_, u));
  if (outcome.verdict == Verdict::kFused) {
    climb_rate_ = climb_rate;
  }
  return outcome;
}

template <class Noise, class See, class Why>
Outcome AirEkf::correct(Stamp stamp, const Gate& gate, const Noise& noise, const See& see,
                        const Why& why) {
  if (stamp < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  Undo undo(*this, stamp);
  advance_to(stamp);
  const auto seen = see();
  if (!seen) {
    return undo.close({Verdict::kNotModelled, why()});
  }
  if (!is_inertial()) {
    constexpr int kColumns = std::decay_t<decltype(seen->lin)>::kVariables;
    const Slots slots = kColumns == 4 ? Slots(place_) : kColumns == 3 ? Slots(body_) : height_;
    return undo.close(internal::fuse(belief_, seen->lin, slots, gate, noise));
  }
  const Outcome outcome = internal::fuse(belief_, widened(*seen), moving_, gate, noise);
  if (outcome.verdict == Verdict::kFused) {
    take_up_tilt();
  }
  return undo.close(outcome);
}

/// The arm by which a rotation moves a point. While nothing shows the heading it is that of one
/// heading: of its changes by noise a filter would learn what none of them knows.
Vector<3> AirEkf::jacobian_arm(const Vector<3>& arm) const {
  return rotation_by({0.0, 0.0, arm_heading_ - pose().heading}) * arm;
}

/// Of a tag, in the axes of the world.
Vector<3> AirEkf::arm_of(const std::vector<Tag>& tags, Id id) const {
  const auto tag =
      std::find_if(tags.begin(), tags.end(), [&](const Tag& one) { return one.id == id; });
  return attitude() * tag->position;
}

/// A range to a body at a place.
std::optional<Linearization<1, 4>> AirEkf::look(const Vector<3>& place, const Range& z) const {
  const RangeModel& model = recipe_->range;
  if (!is_inertial() || !internal::has_tag(model.tags(), z.tag)) {
    return model.linearize({place.x(), place.y(), pose().heading}, place.z(), z);
  }
  // A level body whose tag is where that of the tilted one is; its turn is another.
  const Vector<3> arm = arm_of(model.tags(), z.tag);
  const Vector<3> level = place + arm - attitude().transpose() * arm;
  return model.linearize({level.x(), level.y(), 0.0}, level.z(), z);
}

Outcome AirEkf::on(const Range& z) { return correct_by(z, recipe_->range_gate); }

Outcome AirEkf::weigh(const Range& z) {
  Outcome outcome = correct_by(z, Gate::closed());
  if (outcome.dof > 0) {
    outcome.limit = recipe_->range_gate.limit(outcome.dof);
  }
  return outcome;
}

Outcome AirEkf::correct_by(const Range& z, const Gate& gate) {
  return correct_at(z, gate, nullptr);
}

Outcome AirEkf::correct_at(const Range& z, const Gate& gate, const Vector<3>* place) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return correct(
      z.stamp, gate, recipe_->range_noise,
      [&]() -> std::optional<Seen<Linearization<1, 4>>> {
        auto lin = internal::of_source(recipe_->config, look(place ? *place : position(), z),
                                       Source::kRanges, internal::link_of(z));
        if (!lin) {
          return std::nullopt;
        }
        const Matrix<1, 3> gradient(lin->jacobian(0), lin->jacobian(1), lin->jacobian(3));
        if (place != nullptr) {
          lin->residual(0) -= gradient.dot((position() - *place).transpose());
        }
        if (!is_inertial()) {
          return Seen<Linearization<1, 4>>{*lin, {}};
        }
        return seen_at(*lin, jacobian_arm(arm_of(recipe_->range.tags(), z.tag)), gradient);
      },
      [&] { return internal::why_not(recipe_->range, z); });
}

Outcome AirEkf::on(const PositionFix& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  using Lin = Linearization<Eigen::Dynamic, 3, 2>;
  return correct(
      z.stamp, recipe_->position_gate, recipe_->position_noise,
      [&]() -> std::optional<Seen<Lin>> {
        const PositionModel& model = recipe_->position;
        const std::optional<Vector<2>> lever = model.lever(z.tag);
        Pose2 at = pose();
        Vector<3> arm = Vector<3>::Zero();
        if (is_inertial() && lever) {
          arm = z.tag ? arm_of(model.tags(), *z.tag)
                      : Vector<3>(attitude() * Vector<3>(lever->x(), lever->y(), 0.0));
          at = {at.x + arm.x() - lever->x(), at.y + arm.y() - lever->y(), 0.0};
        }
        const auto lin =
            internal::of_source(recipe_->config, model.linearize(at, z), Source::kPositions);
        if (!lin) {
          return std::nullopt;
        }
        if (!is_inertial()) {
          return Seen<Lin>{*lin, {}};
        }
        auto gradient = lin->jacobian;
        gradient.col(2).setZero();
        return seen_at(*lin, jacobian_arm(arm), gradient);
      },
      [&] { return internal::why_not(recipe_->position, z); });
}

Outcome AirEkf::on(const Altitude& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return correct(
      z.stamp, recipe_->altitude_gate, internal::kGaussian,
      [&] {
        const auto look_from = [&](double height) {
          return *internal::of_source(recipe_->config,
                                      std::optional(recipe_->altitude.linearize(height, z)),
                                      Source::kAltitudes);
        };
        if (!is_inertial()) {
          return std::optional(Seen<Linearization<1, 1>>{look_from(height()), {}});
        }
        const double up = recipe_->config.altitude.altimeter_up_m;
        const Vector<3> arm = up * attitude().col(2);
        return std::optional(seen_at(look_from(height() + arm.z() - up), jacobian_arm(arm),
                                     Matrix<1, 3>(0.0, 0.0, 1.0)));
      },
      [] { return Reason::kNone; });
}

Outcome AirEkf::on(const Heading& z) { return internal::not_used(z); }

Outcome AirEkf::on(const PoseObservation& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  using Lin = Linearization<Eigen::Dynamic, 3, 3>;
  return correct(
      z.stamp, recipe_->pose_gate, recipe_->pose_noise,
      [&]() -> std::optional<Seen<Lin>> {
        const auto lin = internal::of_source(recipe_->config, recipe_->pose.linearize(pose(), z),
                                             Source::kPoses);
        if (!lin) {
          return std::nullopt;
        }
        Seen<Lin> seen{*lin, {}};
        if (is_inertial()) {
          seen.by_rotation = lin->jacobian.col(2) * heading_by_rotation();
        }
        return seen;
      },
      [] { return Reason::kNoSigma; });
}

Outcome AirEkf::on(const RangeBearing& z) {
  validate_in_space(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  const Landmark* landmark = z.landmark ? recipe_->landmarks->find(*z.landmark) : nullptr;
  using Lin = Linearization<Eigen::Dynamic, 4, 3>;
  Vector<2> before = Vector<2>::Zero();
  const Outcome outcome = correct(
      z.stamp, recipe_->landmark_gate, internal::kGaussian,
      [&]() -> std::optional<Seen<Lin>> {
        if (landmark == nullptr) {
          return std::nullopt;
        }
        before = pose().position();
        const Vector<3> place(landmark->position.x(), landmark->position.y(), landmark->height);
        const auto named = [&](std::optional<Lin> lin) {
          return internal::of_source(recipe_->config, std::move(lin), Source::kSightings,
                                     landmark->id);
        };
        if (!is_inertial()) {
          const auto lin = named(recipe_->landmark.linearize(pose(), height(), place, z));
          return lin ? std::optional(Seen<Lin>{*lin, {}}) : std::nullopt;
        }
        // In its own axes: as if it were level, at the origin.
        const Matrix<3, 3> R = attitude();
        const Vector<3> d = place - position();
        const auto lin = named(recipe_->landmark.linearize(Pose2{}, 0.0, R.transpose() * d, z));
        if (!lin) {
          return std::nullopt;
        }
        const std::array<int, 3> columns{0, 1, 3};
        const Matrix<Eigen::Dynamic, 3> by_place =
            Matrix<Eigen::Dynamic, 3>(lin->jacobian(Eigen::all, columns)) * R.transpose();
        Seen<Lin> seen{*lin, -by_place * cross_matrix(d)};
        seen.lin.jacobian(Eigen::all, columns) = by_place;
        return seen;
      },
      [&] { return z.landmark ? internal::why_not(*recipe_->landmarks, z) : Reason::kUnnamed; });
  if (outcome.verdict == Verdict::kFused && z.bearing && !is_inertial()) {
    turn_with_mean(belief_, body_, before);
  }
  return outcome;
}

Outcome AirEkf::on(const Message& message) { return internal::dispatch<LaserScan>(*this, message); }

/// Carries the height, alone, to `stamp` with the last climb rate.
void AirEkf::lift(Stamp stamp) {
  if (stamp <= belief_.stamp) {
    return;
  }
  const Stamp held = std::clamp(odometry_.end() + recipe_->hold, belief_.stamp, stamp);
  const double rising = seconds_between(belief_.stamp, held);
  const double lost = seconds_between(held, stamp);
  const double noise = recipe_->height_per_s * rising + recipe_->lost_height_per_s * lost;
  predict(belief_,
          Propagation<Eigen::VectorXd, Eigen::Dynamic>{scalar(height() + climb_rate_ * rising),
                                                       scalar(1.0), scalar(noise)},
          height_);
}

void AirEkf::advance_to(Stamp stamp) {
  check_stamp(stamp);
  if (stamp <= belief_.stamp) {
    return;
  }
  if (recipe_->config.motion == AirMotion::kOdometry) {
    lift(stamp);
    internal::advance(*recipe_, odometry_, body_, belief_, stamp);
    stay_inside();
    return;
  }
  if (is_inertial()) {
    const Stamp held = sample_ ? std::min(stamp, sample_->stamp + AirTuning::kHoldsSample) : 0;
    if (sample_ && held > belief_.stamp) {
      integrate(held, sample_->rate, sample_->force);
    }
    if (stamp > belief_.stamp) {
      coast(stamp);
    }
    stay_inside();
    return;
  }
  const double seconds = seconds_between(belief_.stamp, stamp);
  predict(belief_, recipe_->constant_velocity.propagate(belief_.mean(moving_), seconds), moving_);
  belief_.stamp = stamp;
  stay_inside();
}

double AirEkf::bend(const Range& z) const {
  validate(z);
  if (seconds_between(belief_.stamp, z.stamp) > AirTuning::kFlatSeconds) {
    AirEkf carried = *this;
    carried.advance_to(z.stamp);
    return carried.bend({carried.belief_.stamp, z.tag, z.anchor, z.range, z.sigma});
  }
  const auto lin = look(position(), z);
  if (!lin) {
    return 0.0;
  }
  const Matrix<3, 3> P = spread();
  const Vector<3> along(lin->jacobian(0), lin->jacobian(1), lin->jacobian(3));
  const double across = P.trace() - along.dot(P * along) / along.squaredNorm();
  const double sigma = std::sqrt(lin->noise(0));
  return across / (2.0 * std::max({z.range, z.range - lin->residual(0), sigma}) * sigma);
}

std::optional<std::pair<AirEkf, double>> AirEkf::image() const {
  const AirEkf::Plane& plane = recipe_->plane;
  if (!plane.exists || recipe_->range.tags().empty() || is_inertial()) {
    return std::nullopt;
  }
  const Vector<3>& normal = plane.normal;
  const std::vector<Tag>& tags = recipe_->range.tags();
  const Vector<3> tag = position() + arm_of(tags, tags.front().id);
  const double beside = normal.dot(tag - plane.centre);
  const double sigma = std::sqrt(normal.dot(spread() * normal));
  if (!(std::abs(beside) > AirTuning::kMinImage * sigma &&
        std::abs(beside) < AirTuning::kMaxImage * sigma)) {
    return std::nullopt;
  }
  const Vector<3> mirrored = tag - 2.0 * beside * normal;
  const double noise = recipe_->config.range.sigma_m;
  const std::vector<Anchor>& anchors = recipe_->range.anchors().anchors();
  if (std::any_of(anchors.begin(), anchors.end(), [&](const Anchor& anchor) {
        const double there = (mirrored - anchor.position).norm();
        return std::abs(there - (tag - anchor.position).norm()) > noise;
      })) {
    return std::nullopt;
  }
  AirEkf other = *this;
  const int up = belief_.offset(height_);
  Matrix<3, 3> reflection = Matrix<3, 3>::Identity() - 2.0 * normal * normal.transpose();
  Eigen::MatrixXd turn = Eigen::MatrixXd::Identity(belief_.x.size(), belief_.x.size());
  const auto reflect = [&](const std::array<int, 3>& rows) { turn(rows, rows) = reflection; };
  reflect({0, 1, up});
  if (moving_.size() > place_.size()) {
    reflect(velocity_rows());
  }
  other.belief_.x = turn * belief_.x;
  const Vector<3> moved = mirrored - tag;
  other.belief_.x(0) = belief_.x(0) + moved.x();
  other.belief_.x(1) = belief_.x(1) + moved.y();
  other.belief_.x(up) = belief_.x(up) + moved.z();
  const Eigen::MatrixXd P = turn * Eigen::MatrixXd(belief_.P) * turn.transpose();
  other.belief_.P = 0.5 * (P + P.transpose());
  const double below = normal_below(-std::abs(beside) / sigma);
  if (other.log_inside() < std::log(AirTuning::kMinInside)) {
    return std::nullopt;
  }
  return std::pair(std::move(other), below / (1.0 - below));
}

double AirEkf::log_inside() const {
  const Config& config = recipe_->config;
  if (config.min_height_m <= -kUnbounded && config.max_height_m >= kUnbounded) {
    return 0.0;
  }
  const double sigma = std::sqrt(current().covariance(3, 3));
  const double inside = normal_below((config.max_height_m - height()) / sigma) -
                        normal_below((config.min_height_m - height()) / sigma);
  return std::log(std::max(inside, 1e-100));
}

/// A belief is no vaguer than the room: eq. (5) of docs/air.md.
void AirEkf::stay_inside() {
  const Config& config = recipe_->config;
  const double room = config.max_height_m - config.min_height_m;
  if (room >= kUnbounded) {
    return;
  }
  const double most = room * room / 12.0;
  const double P = belief_.P(belief_.offset(height_), belief_.offset(height_));
  if (P <= most) {
    return;
  }
  Linearization<1, 1> lin;
  lin.residual(0) = 0.5 * (config.min_height_m + config.max_height_m) - height();
  lin.jacobian(0) = 1.0;
  lin.noise(0) = P * most / (P - most);
  (void)update(belief_, lin, height_, Gate());
  if (is_inertial()) {
    take_up_tilt();
  }
}

/// Rows of the velocity in space, where it is a state.
std::array<int, 3> AirEkf::velocity_rows() const {
  const int velocity = belief_.offset(moving_[2]);
  return {velocity, velocity + 1, belief_.offset(moving_[3])};
}

/// Covariance of (x, y, height), as gains have it.
Matrix<3, 3> AirEkf::spread() const {
  const std::array<int, 3> rows{0, 1, belief_.offset(height_)};
  return belief_.P(rows, rows);
}

Vector<3> AirEkf::place_at(Stamp at) const {
  Vector<3> place = position();
  if (recipe_->config.motion != AirMotion::kOdometry) {
    place += seconds_between(belief_.stamp, at) * Vector<3>(belief_.x(velocity_rows()));
  } else {
    const Vector<2> moved = Pose2{0.0, 0.0, pose().heading}.act(odometry_.rate().position());
    place += seconds_between(belief_.stamp, at) * Vector<3>(moved.x(), moved.y(), climb_rate_);
  }
  return place;
}

/// Second moment of the velocity along a direction; by odometry its bound, whatever the heading.
double AirEkf::squared_speed(const Vector<3>& along) const {
  if (recipe_->config.motion == AirMotion::kOdometry) {
    const double speed = odometry_.rate().position().norm();
    const double most = along.head<2>().norm() * speed + std::abs(along.z() * climb_rate_);
    return most * most;
  }
  const std::array<int, 3> rows = velocity_rows();
  const Matrix<3, 3> P = belief_.P(rows, rows);
  const Vector<3> mean = belief_.x(rows);
  return along.dot(P * along) + std::pow(along.dot(mean), 2);
}

std::vector<Vector<3>> AirEkf::places(const std::vector<Range>& ranges) const {
  std::vector<double> rows;
  std::vector<double> distances;
  std::vector<double> sigmas;
  for (const Range& z : ranges) {
    const Anchor* anchor = recipe_->range.anchors().find(z.anchor);
    const auto lin = look(position(), z);
    const double distance = anchor != nullptr ? (z.range - anchor->offset) / anchor->scale : 0.0;
    if (!lin || !(distance > 0.0) || static_cast<int>(distances.size()) == kMaxRanges) {
      continue;
    }
    const Vector<3> arm = arm_of(recipe_->range.tags(), z.tag);
    rows.insert(rows.end(), {anchor->position.x() - arm.x(), anchor->position.y() - arm.y(),
                             anchor->position.z() - arm.z()});
    distances.push_back(distance);
    sigmas.push_back(std::sqrt(lin->noise(0)) / anchor->scale);
  }
  if (distances.empty()) {
    return {};
  }
  const auto size = static_cast<Eigen::Index>(distances.size());
  const Eigen::Map<const Eigen::VectorXd> measured(distances.data(), size);
  const Eigen::Map<const Eigen::VectorXd> noise(sigmas.data(), size);
  const AnchorTable table{RowsView(rows.data(), size, 3)};
  const RangeLayout<3> layout(table, noise);
  const Vector<3> mean = position() - layout.centre;
  const PositionPrior<3> prior{mean, spread().diagonal().cwiseInverse()};
  std::vector<Vector<3>> starts{mean};
  const auto start_without = [&](Eigen::Index left_out) {
    RangeIndices chosen(size - (left_out < size ? 1 : 0));
    for (Eigen::Index i = 0; i < chosen.size(); ++i) {
      chosen(i) = static_cast<int>(i < left_out ? i : i + 1);
    }
    const RangeLayout<3> others(table, noise, chosen);
    if (others.size < 3 || others.within(1)) {
      return;
    }
    const Ranges kept =
        Ranges::NullaryExpr(chosen.size(), [&](Eigen::Index i) { return measured(chosen(i)); });
    const RangeMinima<3> minima = internal::find_minima<3>(others, kept, RangeLoss{}, -1.0);
    for (std::size_t i = 0; i < static_cast<std::size_t>(minima.count); ++i) {
      starts.emplace_back(minima.fit[i].position + others.centre - layout.centre);
    }
  };
  start_without(size);
  for (Eigen::Index i = 0; size <= AirTuning::kMaxSpare && i < size; ++i) {
    start_without(i);  // any of them may be wrong
  }
  RangeMinima<3> found;
  for (const Vector<3>& start : starts) {
    const RangeFit<3> fit =
        fit_ranges<3>(layout, measured, start, {RangeLossKind::kCauchy, 0.0}, prior);
    if (fit.converged && !fit.saddle) {
      found.add(fit, layout.largest_sigma);
    }
  }
  std::vector<Vector<3>> places;
  for (std::size_t i = 0; i < static_cast<std::size_t>(found.count); ++i) {
    places.emplace_back(found.fit[i].position + layout.centre);
  }
  return places;
}

Outcome AirEkf::on_at(const Range& z, const Vector<3>& place, Stamp at) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (const auto lin = look(place, z)) {
    const Vector<3> along(lin->jacobian(0), lin->jacobian(1), lin->jacobian(3));
    const double seconds = seconds_between(at, z.stamp);
    const double moved = seconds * seconds * squared_speed(along);
    const double nis = lin->residual.squaredNorm() / (lin->noise(0) + moved);
    if (nis > recipe_->range_gate.limit(1)) {
      Outcome outcome{Verdict::kGated, Reason::kUnlikely};
      outcome.nis = nis;
      outcome.limit = recipe_->range_gate.limit(1);
      return outcome;
    }
  }
  return correct_at(z, recipe_->range_gate, &place);
}

/// How far another one is off, in the error state.
Eigen::VectorXd AirEkf::off(const AirEkf& other) const {
  Eigen::VectorXd apart = other.belief_.x - belief_.x;
  if (is_inertial()) {
    apart(InertialMotion::kRotation) = rotation_vector(other.attitude() * attitude().transpose());
  } else {
    apart(2) = wrap_angle(apart(2));
  }
  return apart;
}

AirEkf AirEkf::mixed(double weight,
                     const std::vector<std::pair<const AirEkf*, double>>& others) const {
  AirEkf sum = *this;
  std::vector<AirEkf> rest;
  for (const auto& other : others) {
    sum.advance_to(other.first->belief_.stamp);
    rest.push_back(*other.first);
  }
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(sum.belief_.x.size());
  Eigen::MatrixXd P = weight * Eigen::MatrixXd(sum.belief_.P);
  const AirEkf about = sum;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    rest[i].advance_to(sum.belief_.stamp);
    mean += others[i].second * about.off(rest[i]);
  }
  P += weight * mean * mean.transpose();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Eigen::VectorXd apart = about.off(rest[i]) - mean;
    P += others[i].second * (Eigen::MatrixXd(rest[i].belief_.P) + apart * apart.transpose());
  }
  sum.belief_.x += mean;
  sum.belief_.x(2) = wrap_angle(sum.belief_.x(2));
  sum.belief_.P = 0.5 * (P + P.transpose());
  if (is_inertial()) {
    sum.take_up_tilt();
  }
  return sum;
}

AirEkf AirEkf::anywhere(double span) const {
  AirEkf other = *this;
  Eigen::VectorXd variance = Eigen::MatrixXd(belief_.P).diagonal();
  variance.head<2>().setConstant(span * span / 3.0);
  variance(2) = kPi * kPi / 3.0;
  variance(belief_.offset(height_)) = span * span / 3.0;
  if (recipe_->config.motion != AirMotion::kOdometry) {
    const double velocity = recipe_->config.sigma_start_velocity_mps;
    const double climb = recipe_->config.sigma_start_climb_mps;
    const std::array<int, 3> rows = velocity_rows();
    variance(rows) << velocity * velocity, velocity * velocity, climb * climb;
    other.belief_.x(rows).setZero();
  }
  if (is_inertial()) {
    const InertialMotion::Config& sensor = recipe_->config.inertial;
    other.belief_.x.tail<6>().setZero();
    variance.segment<3>(InertialMotion::kRateBias[0])
        .setConstant(sensor.sigma_bias_radps * sensor.sigma_bias_radps);
    variance.segment<3>(InertialMotion::kForceBias[0])
        .setConstant(sensor.sigma_bias_mps2 * sensor.sigma_bias_mps2);
    other.forget_attitude();
  }
  other.belief_.P = Eigen::MatrixXd(variance.asDiagonal());
  other.belief_.correlated = belief_.correlated.restarted();
  return other;
}

bool AirEkf::has_heading() const {
  return !is_inertial() || belief_.P(2, 2) <= AirTuning::kAnyHeading * AirTuning::kAnyHeading;
}

std::vector<AirEkf> AirEkf::by_heading() const {
  if (has_heading()) {
    return {*this};
  }
  std::vector<AirEkf> all;
  for (int i = 0; i < AirTuning::kHeadings; ++i) {
    AirEkf one = *this;
    one.belief_.x(2) = wrap_angle(belief_.x(2) + 2.0 * kPi * i / AirTuning::kHeadings);
    Eigen::MatrixXd P = belief_.P;
    P.row(2).setZero();
    P.col(2).setZero();
    P(2, 2) = AirTuning::kSigmaHeading * AirTuning::kSigmaHeading;
    one.belief_.P = P;
    one.arm_heading_ = one.belief_.x(2);
    all.push_back(std::move(one));
  }
  return all;
}

AirEkf AirEkf::continued_at(Stamp stamp) const {
  check_stamp(stamp);
  AirEkf other = *this;
  other.advance_to(std::max(belief_.stamp, odometry_.end()));
  other.belief_.stamp = stamp;
  other.odometry_ = odometry_.restarted(stamp);
  other.sample_.reset();
  other.shaking_ = {};
  other.climb_rate_ = 0.0;
  return other;
}

AirEstimate AirEkf::current() const {
  AirEstimate now{belief_.stamp, pose(), height(), {}};
  if (!is_inertial()) {
    now.covariance = belief_.marginal(place_);
    return now;
  }
  const std::vector<Slot> turned{body_, height_, moving_[4]};  // and the tilt
  const Matrix<6, 6> P = belief_.marginal(turned);
  const std::array<int, 3> rotation{4, 5, 2};
  now.attitude = Attitude{quaternion_of(attitude()), P(rotation, rotation)};
  Matrix<4, 6> J = Matrix<4, 6>::Identity();
  J(2, rotation) = heading_by_rotation();
  now.covariance = J * P * J.transpose();
  now.covariance = (0.5 * (now.covariance + now.covariance.transpose())).eval();
  return now;
}

AirEstimate AirEkf::estimate() const { return estimate(std::max(belief_.stamp, odometry_.end())); }

AirEstimate AirEkf::estimate(Stamp stamp) const {
  internal::check_not_before(belief_.stamp, stamp);
  AirEkf ahead = *this;
  ahead.advance_to(stamp);
  ahead.belief_.stamp = stamp;
  return ahead.current();
}

}  // namespace locfuse
