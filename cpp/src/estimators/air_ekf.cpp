// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/air_ekf.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/math/symmetric.hpp"
#include "math/sigma.hpp"

namespace locfuse {
namespace {

using AirTransaction = internal::Transaction<3>;

double variance_of(const char* name, double sigma) {
  internal::sigma_in_bounds(name, sigma);
  return sigma * sigma;
}

Matrix<1, 1> scalar(double value) { return Matrix<1, 1>(value); }

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

AirEkf::AirEkf(const Config& config, std::shared_ptr<const AnchorMap> anchors,
               std::vector<Tag> tags, const AirEstimate& start, LandmarkSensor landmarks)
    : recipe_(std::make_shared<const Recipe>(Recipe{
          config,
          OdometryMotion(config.odometry),
          internal::lost_motion(config),
          variance_of("sigma_height_per_sqrt_s", config.sigma_height_per_sqrt_s),
          variance_of("sigma_lost_height_per_sqrt_s",
                      internal::positive("sigma_lost_height_per_sqrt_s",
                                         config.sigma_lost_height_per_sqrt_s)),
          ConstantVelocityMotion(config.constant_velocity),
          RangeModel(config.range, std::move(anchors), tags),
          PositionModel(config.position, std::move(tags)),
          AltitudeModel(config.altitude),
          PoseModel(config.pose),
          RangeBearingModel(config.landmark, landmarks.T_body_sensor, config.landmark_in_space),
          landmarks.map ? std::move(landmarks.map) : std::make_shared<const LandmarkMap>(),
          Gate(config.gate_range),
          Gate(config.gate_position),
          Gate(config.gate_altitude),
          Gate(config.gate_pose),
          Gate(config.gate_landmark),
          internal::noise_of("robust_range", config.robust_range, config),
          internal::noise_of("robust_position", config.robust_position, config),
          internal::noise_of("robust_pose", config.robust_pose, config),
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
    return {Verdict::kImplausible};
  }
  if (recipe_->config.motion == AirMotion::kConstantVelocity) {
    return {Verdict::kIgnored};
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

template <class Noise, class Linearize>
Outcome AirEkf::correct(Stamp stamp, const Gate& gate, const Noise& noise, Slots slots,
                        const Linearize& linearize) {
  if (stamp < belief_.stamp) {
    return {Verdict::kStale};
  }
  AirTransaction transaction(belief_, stamp);
  advance_to(stamp);
  const auto lin = linearize();
  return transaction.close(lin ? internal::fuse(belief_, *lin, slots, gate, noise)
                               : Outcome{Verdict::kNotModelled});
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
    return {Verdict::kImplausible};
  }
  return correct(z.stamp, gate, recipe_->range_noise, place_, [&] {
    return internal::of_source(recipe_->config, recipe_->range.linearize(pose(), height(), z),
                               Source::kRanges, internal::link_of(z));
  });
}

Outcome AirEkf::on(const PositionFix& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible};
  }
  return correct(z.stamp, recipe_->position_gate, recipe_->position_noise, body_, [&] {
    return internal::of_source(recipe_->config, recipe_->position.linearize(pose(), z),
                               Source::kPositions);
  });
}

Outcome AirEkf::on(const Altitude& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible};
  }
  return correct(z.stamp, recipe_->altitude_gate, internal::kGaussian, height_, [&] {
    return internal::of_source(recipe_->config,
                               std::optional(recipe_->altitude.linearize(height(), z)),
                               Source::kAltitudes);
  });
}

Outcome AirEkf::on(const PoseObservation& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible};
  }
  return correct(z.stamp, recipe_->pose_gate, recipe_->pose_noise, body_, [&] {
    return internal::of_source(recipe_->config, recipe_->pose.linearize(pose(), z), Source::kPoses);
  });
}

Outcome AirEkf::on(const RangeBearing& z) {
  validate_in_space(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible};
  }
  const Landmark* landmark = z.landmark ? recipe_->landmarks->find(*z.landmark) : nullptr;
  using Sighting = std::optional<Linearization<Eigen::Dynamic, 4, 3>>;
  Vector<2> before = Vector<2>::Zero();
  const Outcome outcome =
      correct(z.stamp, recipe_->landmark_gate, internal::kGaussian, place_, [&]() -> Sighting {
        if (landmark == nullptr) {
          return std::nullopt;
        }
        before = pose().position();
        const Vector<3> place(landmark->position.x(), landmark->position.y(), landmark->height);
        return internal::of_source(recipe_->config,
                                   recipe_->landmark.linearize(pose(), height(), place, z),
                                   Source::kSightings, landmark->id);
      });
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
    return;
  }
  const double seconds = seconds_between(belief_.stamp, stamp);
  predict(belief_, recipe_->constant_velocity.propagate(belief_.mean(moving_), seconds), moving_);
  belief_.stamp = stamp;
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
