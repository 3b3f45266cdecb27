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
#include "locfuse/math/angle.hpp"
#include "locfuse/math/symmetric.hpp"
#include "math/sigma.hpp"

namespace locfuse {
namespace {

using AirTransaction = internal::Transaction<3>;

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

}  // namespace

struct AirEkf::Recipe {
  Config config;
  Plane plane;  // of the anchors
  OdometryMotion motion;
  OdometryMotion lost;
  double height_per_s;
  double lost_height_per_s;
  ConstantVelocityMotion constant_velocity;
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
      odometry_(start.stamp) {
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
  if (config.motion == AirMotion::kConstantVelocity) {
    moving_.push_back(belief_.add("velocity", SlotKind::kPoint2, Vector<2>::Zero(),
                                  velocity * velocity * Matrix<2, 2>::Identity()));
    moving_.push_back(belief_.add("climb", SlotKind::kScalar, scalar(0.0), scalar(climb * climb)));
  }
  internal::expect_correlated(belief_, config.correlation_s);
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
  if (recipe_->config.motion == AirMotion::kConstantVelocity) {
    return {Verdict::kIgnored, Reason::kNotUsed};
  }
  AirTransaction transaction(belief_, u.stamp);
  lift(effective_stamp(u));
  const Outcome outcome =
      transaction.close(internal::take<Eigen::Dynamic>(*recipe_, odometry_, body_, belief_, u));
  if (outcome.verdict == Verdict::kFused) {
    climb_rate_ = climb_rate;
  }
  return outcome;
}

template <class Noise, class Linearize, class Why>
Outcome AirEkf::correct(Stamp stamp, const Gate& gate, const Noise& noise, Slots slots,
                        const Linearize& linearize, const Why& why) {
  if (stamp < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  AirTransaction transaction(belief_, stamp);
  advance_to(stamp);
  const auto lin = linearize();
  return transaction.close(lin ? internal::fuse(belief_, *lin, slots, gate, noise)
                               : Outcome{Verdict::kNotModelled, why()});
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
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return correct(
      z.stamp, gate, recipe_->range_noise, place_,
      [&] {
        return internal::of_source(recipe_->config, recipe_->range.linearize(pose(), height(), z),
                                   Source::kRanges, internal::link_of(z));
      },
      [&] { return internal::why_not(recipe_->range, z); });
}

Outcome AirEkf::on(const PositionFix& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return correct(
      z.stamp, recipe_->position_gate, recipe_->position_noise, body_,
      [&] {
        return internal::of_source(recipe_->config, recipe_->position.linearize(pose(), z),
                                   Source::kPositions);
      },
      [&] { return internal::why_not(recipe_->position, z); });
}

Outcome AirEkf::on(const Altitude& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return correct(
      z.stamp, recipe_->altitude_gate, internal::kGaussian, height_,
      [&] {
        return internal::of_source(recipe_->config,
                                   std::optional(recipe_->altitude.linearize(height(), z)),
                                   Source::kAltitudes);
      },
      [] { return Reason::kNone; });
}

Outcome AirEkf::on(const Heading& z) { return internal::not_used(z); }

Outcome AirEkf::on(const PoseObservation& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return correct(
      z.stamp, recipe_->pose_gate, recipe_->pose_noise, body_,
      [&] {
        return internal::of_source(recipe_->config, recipe_->pose.linearize(pose(), z),
                                   Source::kPoses);
      },
      [] { return Reason::kNoSigma; });
}

Outcome AirEkf::on(const RangeBearing& z) {
  validate_in_space(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  const Landmark* landmark = z.landmark ? recipe_->landmarks->find(*z.landmark) : nullptr;
  using Sighting = std::optional<Linearization<Eigen::Dynamic, 4, 3>>;
  Vector<2> before = Vector<2>::Zero();
  const Outcome outcome = correct(
      z.stamp, recipe_->landmark_gate, internal::kGaussian, place_,
      [&]() -> Sighting {
        if (landmark == nullptr) {
          return std::nullopt;
        }
        before = pose().position();
        const Vector<3> place(landmark->position.x(), landmark->position.y(), landmark->height);
        return internal::of_source(recipe_->config,
                                   recipe_->landmark.linearize(pose(), height(), place, z),
                                   Source::kSightings, landmark->id);
      },
      [&] { return z.landmark ? internal::why_not(*recipe_->landmarks, z) : Reason::kUnnamed; });
  if (outcome.verdict == Verdict::kFused && z.bearing) {
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
  const auto lin = recipe_->range.linearize(pose(), height(), z);
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
  if (!plane.exists || recipe_->range.tags().empty()) {
    return std::nullopt;
  }
  const Vector<3>& normal = plane.normal;
  const Vector<3> arm = recipe_->range.tags().front().position;
  const Vector<2> turned = pose().act(arm.head<2>());
  const Vector<3> tag(turned.x(), turned.y(), height() + arm.z());
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
    const int first = belief_.offset(moving_[2]);
    reflect({first, first + 1, belief_.offset(moving_[3])});
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
}

/// Covariance of (x, y, height), as gains have it.
Matrix<3, 3> AirEkf::spread() const {
  const std::array<int, 3> rows{0, 1, belief_.offset(height_)};
  return belief_.P(rows, rows);
}

Vector<3> AirEkf::place_at(Stamp at) const {
  Vector<3> place(pose().x, pose().y, height());
  if (recipe_->config.motion == AirMotion::kConstantVelocity) {
    const int velocity = belief_.offset(moving_[2]);
    const std::array<int, 3> rows{velocity, velocity + 1, belief_.offset(moving_[3])};
    place += seconds_between(belief_.stamp, at) * Vector<3>(belief_.x(rows));
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
  const int velocity = belief_.offset(moving_[2]);
  const std::array<int, 3> rows{velocity, velocity + 1, belief_.offset(moving_[3])};
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
    const auto lin = recipe_->range.linearize(pose(), height(), z);
    const double distance = anchor != nullptr ? (z.range - anchor->offset) / anchor->scale : 0.0;
    if (!lin || !(distance > 0.0) || static_cast<int>(distances.size()) == kMaxRanges) {
      continue;
    }
    const std::vector<Tag>& tags = recipe_->range.tags();
    const auto tag =
        std::find_if(tags.begin(), tags.end(), [&](const Tag& one) { return one.id == z.tag; });
    const Vector<2> arm = Pose2{0.0, 0.0, pose().heading}.act(tag->position.head<2>());
    rows.insert(rows.end(), {anchor->position.x() - arm.x(), anchor->position.y() - arm.y(),
                             anchor->position.z() - tag->position.z()});
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
  const Vector<3> mean = Vector<3>(pose().x, pose().y, height()) - layout.centre;
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
  auto lin = recipe_->range.linearize({place.x(), place.y(), pose().heading}, place.z(), z);
  if (lin) {
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
  return correct(
      z.stamp, recipe_->range_gate, recipe_->range_noise, place_,
      [&] {
        if (lin) {
          const Vector<4> off(pose().x - place.x(), pose().y - place.y(), 0.0,
                              height() - place.z());
          lin->residual -= lin->jacobian * off;
        }
        return internal::of_source(recipe_->config, std::move(lin), Source::kRanges,
                                   internal::link_of(z));
      },
      [&] { return internal::why_not(recipe_->range, z); });
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
  const Eigen::VectorXd x = sum.belief_.x;
  const auto off_of = [&](const GaussianBelief& other) {
    Eigen::VectorXd off = other.x - x;
    off(2) = wrap_angle(off(2));
    return off;
  };
  for (std::size_t i = 0; i < rest.size(); ++i) {
    rest[i].advance_to(sum.belief_.stamp);
    mean += others[i].second * off_of(rest[i].belief_);
  }
  P += weight * mean * mean.transpose();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Eigen::VectorXd off = off_of(rest[i].belief_) - mean;
    P += others[i].second * (Eigen::MatrixXd(rest[i].belief_.P) + off * off.transpose());
  }
  sum.belief_.x += mean;
  sum.belief_.x(2) = wrap_angle(sum.belief_.x(2));
  sum.belief_.P = 0.5 * (P + P.transpose());
  return sum;
}

AirEkf AirEkf::anywhere(double span) const {
  AirEkf other = *this;
  Eigen::VectorXd variance = Eigen::VectorXd::Constant(belief_.x.size(), span * span / 3.0);
  variance(2) = kPi * kPi / 3.0;
  if (recipe_->config.motion == AirMotion::kConstantVelocity) {
    const double velocity = recipe_->config.sigma_start_velocity_mps;
    const double climb = recipe_->config.sigma_start_climb_mps;
    variance.tail<3>() << velocity * velocity, velocity * velocity, climb * climb;
    other.belief_.x.tail<3>().setZero();
  }
  other.belief_.P = Eigen::MatrixXd(variance.asDiagonal());
  other.belief_.correlated = belief_.correlated.restarted();
  return other;
}

AirEkf AirEkf::continued_at(Stamp stamp) const {
  check_stamp(stamp);
  AirEkf other = *this;
  other.advance_to(std::max(belief_.stamp, odometry_.end()));
  other.belief_.stamp = stamp;
  other.odometry_ = odometry_.restarted(stamp);
  other.climb_rate_ = 0.0;
  return other;
}

AirEstimate AirEkf::current() const {
  return {belief_.stamp, pose(), height(), belief_.marginal(place_)};
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
