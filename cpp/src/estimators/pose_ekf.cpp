// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/pose_ekf.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimators/innovation.hpp"
#include "estimators/recipe.hpp"

namespace locfuse {
using internal::Transaction;

namespace {

/// A sighting of the landmark with the smallest NIS under the belief, if there is one.
template <class Linearize>
auto nearest(const GaussianBelief& belief, const LandmarkMap& map, const Linearize& linearize) {
  using Lin = std::decay_t<decltype(*linearize(std::declval<const Landmark&>()))>;
  std::optional<Lin> found;
  double least = std::numeric_limits<double>::infinity();
  const Matrix<Lin::kVariables, Lin::kVariables> P = belief.P;
  for (const Landmark& landmark : map.landmarks()) {
    const auto lin = linearize(landmark);
    if (!lin) {
      continue;
    }
    if (const double nis = internal::nis_of(*lin, P); nis < least) {
      least = nis;
      found = lin;
    }
  }
  return found;
}

/// Means of as many variables as a measurement has columns for, of which the first are the body.
template <int N>
Vector<N> mean_of(const GaussianBelief& belief, Slots slots) {
  if constexpr (N == 3) {
    return belief.x.head<3>();  // allocates nothing
  } else {
    return belief.mean(slots);
  }
}

/// Of two of them.
template <int N>
Vector<N> difference(const Vector<N>& a, const Vector<N>& b) {
  Vector<N> off = a - b;
  off(2) = wrap_angle(off(2));
  return off;
}

template <class Noise>
double determinant_of(const Noise& noise) {
  if constexpr (Noise::RowsAtCompileTime == Eigen::Dynamic) {
    return internal::determinant_of(noise);
  } else {
    return noise.determinant();
  }
}

}  // namespace

PoseEkf::PoseEkf(const Config& config, const World& world, const PoseEstimate& start)
    : recipe_(std::make_shared<const Recipe>(Recipe{
          config, OdometryMotion(config.odometry), internal::lost_motion(config),
          RangeModel(config.range, internal::anchors_of(world), world.tags),
          PositionModel(config.position, world.tags), PoseModel(config.pose),
          HeadingModel(config.heading),
          RangeBearingModel(config.landmark, world.landmarks.T_body_sensor),
          Calibration(config.calibration, *internal::anchors_of(world)),
          internal::landmarks_of(world), Gate(config.range.gate), Gate(config.position.gate),
          Gate(config.pose.gate), Gate(config.heading.gate), Gate(config.landmark.gate),
          internal::noise_of("range.noise", config.range.noise, config),
          internal::noise_of("position.noise", config.position.noise, config),
          internal::noise_of("pose.noise", config.pose.noise, config), internal::hold_of(config)})),
      belief_(GaussianBelief::of_pose(start.stamp, start.pose, start.covariance)),
      body_(belief_.slot("body")),
      odometry_(start.stamp),
      adaptive_(config.adaptive) {
  check_stamp(start.stamp);
  validate(config.limits);
  recipe_->calibration.add_to(belief_);
  internal::expect_correlated(belief_, config.correlation_s);
}

PoseEkf PoseEkf::restarted(const PoseEstimate& start) const {
  check_stamp(start.stamp);
  PoseEkf other = *this;
  other.belief_ = GaussianBelief::of_pose(start.stamp, start.pose, start.covariance);
  other.body_ = other.belief_.slot("body");
  recipe_->calibration.add_to(other.belief_);
  other.belief_.correlated = belief_.correlated.restarted();
  other.without_poses_.reset();
  other.readings_ = {};
  other.odometry_ = odometry_.restarted(start.stamp);
  return other;
}

template <class Noise, class Linearize, class Why>
Outcome PoseEkf::correct(std::optional<Source> source, Stamp stamp, const Gate& gate,
                         const Noise& noise, Slots slots, const Linearize& linearize,
                         const Why& why, bool turns) {
  if (stamp < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  Transaction<3> transaction(belief_, stamp);
  advance_to(stamp);
  auto lin = linearize(pose());
  if (!lin) {
    return transaction.close({Verdict::kNotModelled, why()});
  }
  const auto fuse = [&] {
    return without_poses_ ? fuse_with_both(*lin, slots, gate, noise, turns)
                          : fuse_with(belief_, *lin, slots, gate, noise, turns);
  };
  if (!source || !adaptive_.is_on()) {
    return transaction.close(fuse());
  }
  lin->noise *= adaptive_.factor(*source);
  const Outcome outcome = transaction.close(fuse());
  const auto rows = static_cast<double>(lin->noise.rows());
  adaptive_.record(*source, outcome,
                   std::pow(std::max(determinant_of(lin->noise), 0.0), 1.0 / rows));
  return outcome;
}

template <class Lin, class Noise>
Outcome PoseEkf::fuse_with(GaussianBelief& belief, const Lin& lin, Slots slots, const Gate& gate,
                           const Noise& noise, bool turns) const {
  if (!turns) {
    return internal::fuse(belief, lin, slots, gate, noise);
  }
  const Vector<2> before = belief.x.head<2>();
  const Outcome outcome = internal::fuse(belief, lin, slots, gate, noise);
  if (outcome.verdict == Verdict::kFused) {
    turn_with_mean(belief, body_, before);
  }
  return outcome;
}

/// The same for the belief without poses, from the residual that it would have seen. Kept out of
/// the path of a filter that has no poses.
template <class Lin, class Noise>
[[gnu::noinline]] Outcome PoseEkf::fuse_with_both(Lin& lin, Slots slots, const Gate& gate,
                                                  const Noise& noise, bool turns) {
  constexpr int kVariables = Lin::kVariables;
  const Vector<kVariables> linearized_at = mean_of<kVariables>(belief_, slots);
  const Outcome outcome = fuse_with(belief_, lin, slots, gate, noise, turns);
  if (outcome.verdict == Verdict::kFused) {
    change_without_poses([&](GaussianBelief& belief) {
      internal::advance(*recipe_, odometry_, body_, belief, belief_.stamp);
      lin.residual +=
          lin.jacobian * difference<kVariables>(linearized_at, mean_of<kVariables>(belief, slots));
      (void)fuse_with(belief, lin, slots, Gate(), noise, turns);
    });
  }
  return outcome;
}

/// A direction in which the world is seen turns the covariance with the mean.
template <class Linearize>
Outcome PoseEkf::correct_by(const RangeBearing& z, Slots slots, const Linearize& linearize) {
  return correct(
      Source::kSightings, z.stamp, recipe_->landmark_gate, internal::kGaussian, slots, linearize,
      [&] { return internal::why_not(*recipe_->landmarks, z); }, z.bearing.has_value());
}

Outcome PoseEkf::on(const Velocity& u) { return take(u); }

Outcome PoseEkf::on(const Increment& u) { return take(u); }

template <class Motion>
Outcome PoseEkf::take(const Motion& u) {
  const bool reads = readings_[0] || readings_[1];
  const double turn = reads ? turn_of(u) : 0.0;
  const Outcome outcome = without_poses_
                              ? take_with_both(u)
                              : internal::take<3>(*recipe_, odometry_, body_, belief_, u);
  if (reads && outcome.verdict == Verdict::kFused) {
    count_turn(turn);
  }
  return outcome;
}

/// How far the body turns by what a message of odometry adds: a motion, or that until it came.
double PoseEkf::turn_of(const Velocity& u) const {
  const double seconds = seconds_between(odometry_.end(), u.stamp);
  const double held = static_cast<double>(recipe_->hold) / kNanosecondsPerSecond;
  return odometry_.is_received() ? odometry_.rate().heading * std::clamp(seconds, 0.0, held) : 0.0;
}
double PoseEkf::turn_of(const Increment& u) { return u.motion.heading; }

template <class Motion>
[[gnu::noinline]] Outcome PoseEkf::take_with_both(const Motion& u) {
  HeldMotion odometry = odometry_;
  const Outcome outcome = internal::take<3>(*recipe_, odometry_, body_, belief_, u);
  if (outcome.verdict == Verdict::kFused) {
    change_without_poses([&](GaussianBelief& belief) {
      (void)internal::take<3>(*recipe_, odometry, body_, belief, u);
    });
  }
  return outcome;
}

/// Does to the belief without poses what was done to the other. Where its numbers break it begins
/// anew: the message was fused, and an exception would hide that.
template <class Change>
void PoseEkf::change_without_poses(const Change& change) {
  try {
    change(*without_poses_);
  } catch (const NumericalError&) {
    without_poses_ = belief_;
  }
}

Outcome PoseEkf::on(const Range& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  const auto why = [&] { return internal::why_not(recipe_->range, z); };
  const Calibration& calibration = recipe_->calibration;
  if (const std::vector<Slot>* slots = calibration.slots_of(z.anchor)) {
    return correct(
        Source::kRanges, z.stamp, recipe_->range_gate, recipe_->range_noise, *slots,
        [&](const Pose2& /*pose*/) {
          return internal::of_source(
              recipe_->config, calibration.linearize(belief_, recipe_->range, z, odometry_.rate()),
              Source::kRanges, internal::link_of(z));
        },
        why);
  }
  return correct(
      Source::kRanges, z.stamp, recipe_->range_gate, recipe_->range_noise, body_,
      [&](const Pose2& pose) {
        auto lin = recipe_->range.linearize(pose, z);  // not copied: it is short of time
        internal::name_source(recipe_->config, lin, Source::kRanges, internal::link_of(z));
        return lin;
      },
      why);
}

Outcome PoseEkf::on(const PositionFix& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  return correct(
      Source::kPositions, z.stamp, recipe_->position_gate, recipe_->position_noise, body_,
      [&](const Pose2& pose) {
        return internal::of_source(recipe_->config, recipe_->position.linearize(pose, z),
                                   Source::kPositions);
      },
      [&] { return internal::why_not(recipe_->position, z); });
}

Outcome PoseEkf::on(const PoseObservation& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (recipe_->config.correlation_s > 0.0 && recipe_->pose_noise.is_gaussian()) {
    return fuse_localizer(z);
  }
  return correct(
      Source::kPoses, z.stamp, recipe_->pose_gate, recipe_->pose_noise, body_,
      [&](const Pose2& pose) {
        return internal::of_source(recipe_->config, recipe_->pose.linearize(pose, z),
                                   Source::kPoses);
      },
      [] { return Reason::kNoSigma; });
}

/// Fuses the pose of a localizer whose errors may stay: with what everything else says, and in
/// place of its poses before; docs/models/poses.md.
Outcome PoseEkf::fuse_localizer(const PoseObservation& z) {
  if (z.stamp < belief_.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  if (!without_poses_) {
    without_poses_ = belief_;
    without_poses_->correlated.reserve(belief_.dimension());
  }
  Transaction<3> transaction(belief_, z.stamp);
  Transaction<3> without_poses(*without_poses_, z.stamp);
  advance_to(z.stamp);
  internal::advance(*recipe_, odometry_, body_, *without_poses_, z.stamp);
  auto lin = recipe_->pose.linearize(pose(), z);
  if (!lin) {
    return transaction.close({Verdict::kNotModelled, Reason::kNoSigma});
  }
  if (pose_source_.is_frozen(z.pose, pose())) {
    return transaction.close({Verdict::kImplausible, Reason::kFrozen});
  }
  const bool is_whole = lin->residual.size() == 3;
  const Vector<3> place = without_poses_->x.head<3>();
  const bool shares = recipe_->config.pose.shares_odometry;
  // One that goes by this odometry is as late as it.
  const Vector<3> rate = shares ? Vector<3>::Zero() : world_rate();
  PoseSource::Compared compared{z.stamp,
                                Vector<3>::Zero(),
                                rate,
                                shares ? rate : pose_source_.changed(z.stamp, place, rate),
                                Matrix<3, 3>::Zero(),
                                Matrix<3, 3>::Zero()};
  if (is_whole) {
    compared.off = lin->residual;
    compared.R = lin->noise;
  }
  const double variance = make_honest(*lin, compared);
  Outcome outcome = update(belief_, *lin, body_, Gate::closed());
  const Vector<3> shift = difference<3>(belief_.x.head<3>(), place);
  auto anew = *lin;
  anew.residual += lin->jacobian * shift;
  bool is_white = pose_source_.is_white();
  outcome.limit = recipe_->pose_gate.limit(outcome.dof);
  if (outcome.nis > outcome.limit && is_overdue(z.stamp)) {
    outcome = update(*without_poses_, anew, body_, Gate::closed());
    outcome.limit = recipe_->pose_gate.limit(outcome.dof);
    is_white = false;
  }
  if (outcome.nis > outcome.limit) {
    return transaction.close(outcome);
  }
  outcome.verdict = Verdict::kFused;
  outcome.reason = Reason::kNone;
  pose_source_.take(z.stamp, z.pose, pose(), place);
  if (is_whole) {
    PoseSource::Compared with = compared;
    with.off += shift;
    with.P = without_poses_->marginal_of_first<3>();
    pose_source_.learn(with);
    if (is_white) {
      compared.P = belief_.marginal_of_first<3>();
      pose_source_.learn_scale(compared);
    }
  }
  if (!is_white) {
    const std::uint64_t interventions = belief_.interventions;
    belief_ = *without_poses_;
    belief_.interventions = interventions;
    *lin = anew;
  }
  (void)update(belief_, *lin, body_, Gate());
  (void)without_poses.close({Verdict::kFused});
  keep_without_poses_linear();
  if (adaptive_.is_on()) {
    adaptive_.record(Source::kPoses, outcome, variance);
  }
  return transaction.close(outcome);
}

/// Corrects a pose by what is learnt of its source. Returns its mean variance without that.
double PoseEkf::make_honest(Linearization<Eigen::Dynamic, 3, 3>& lin,
                            const PoseSource::Compared& z) const {
  lin.noise *= adaptive_.factor(Source::kPoses);
  const double variance =
      std::pow(std::max(lin.noise.determinant(), 0.0), 1.0 / static_cast<double>(lin.noise.rows()));
  for (Eigen::Index row = 0; row < lin.residual.size(); ++row) {
    Eigen::Index axis = 0;
    lin.jacobian.row(row).maxCoeff(&axis);
    const double root = std::sqrt(pose_source_.factor(axis));
    lin.noise.row(row) *= root;
    lin.noise.col(row) *= root;
  }
  const Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 3, 1> way =
      lin.jacobian * (pose_source_.delay() * z.rate);
  lin.residual += way;
  const Matrix<3, 3> of_way = pose_source_.way_variance(z.rate, z.changed);
  const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, 3, 3> half =
      lin.jacobian * of_way;
  lin.noise += half * lin.jacobian.transpose();
  return variance;
}

/// Whether no pose was fused for longer than errors of a source stay, so that the belief, which its
/// last pose is in, is no reason to reject another.
bool PoseEkf::is_overdue(Stamp stamp) const {
  const double lasts = recipe_->config.correlation_s;
  return pose_source_.stamp() && seconds_between(*pose_source_.stamp(), stamp) > lasts;
}

/// What everything else says of the heading is linear in its error only while that is small. Where
/// it says much less than poses do, its mean is of no use, and theirs takes its place: with ten
/// times their covariance added, so that they count as a tenth in it at most.
void PoseEkf::keep_without_poses_linear() {
  constexpr double kMaxVariance = 0.05 * 0.05;
  constexpr double kMuchWorse = 9.0;
  const Matrix<3, 3> worse = without_poses_->P.topLeftCorner<3, 3>();
  const Matrix<3, 3> better = belief_.P.topLeftCorner<3, 3>();
  if (worse(2, 2) > std::max(kMaxVariance, kMuchWorse * better(2, 2)) &&
      worse.topLeftCorner<2, 2>().trace() > kMuchWorse * better.topLeftCorner<2, 2>().trace()) {
    pose_source_.shift(difference<3>(belief_.x.head<3>(), without_poses_->x.head<3>()));
    constexpr double kTimes = 10.0;
    predict(*without_poses_,
            Propagation<Pose2, 3>{pose(), Matrix<3, 3>::Identity(), kTimes * better}, body_);
  }
}

/// How the body moves per second in its own axes, as odometry says; not at all without it.
Pose2 PoseEkf::body_rate() const {
  const bool is_known = odometry_.is_received() && belief_.stamp <= odometry_.end() + recipe_->hold;
  return is_known ? odometry_.rate() : Pose2{};
}

/// How x, y and heading change per second, as odometry says.
Vector<3> PoseEkf::world_rate() const {
  const Pose2 rate = body_rate();
  const double c = std::cos(belief_.x(2));
  const double s = std::sin(belief_.x(2));
  return {c * rate.x - s * rate.y, s * rate.x + c * rate.y, rate.heading};
}

Outcome PoseEkf::on(const RangeBearing& z) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (z.landmark) {
    return on(z, recipe_->landmarks->find(*z.landmark));
  }
  if (!recipe_->calibration.is_empty()) {
    return correct_by(z, recipe_->calibration.slots(), [&](const Pose2& /*pose*/) {
      return nearest(belief_, *recipe_->landmarks,
                     [&](const Landmark& landmark) { return sight(landmark, z); });
    });
  }
  return correct_by(z, body_, [&](const Pose2& pose) {
    return nearest(belief_, *recipe_->landmarks, [&](const Landmark& landmark) {
      return internal::of_source(recipe_->config,
                                 recipe_->landmark.linearize(pose, landmark.position, z),
                                 Source::kSightings, landmark.id);
    });
  });
}

Outcome PoseEkf::on(const RangeBearing& z, const Landmark* landmark) {
  const RangeBearingModel& model = recipe_->landmark;
  if (landmark == nullptr) {
    return z.stamp < belief_.stamp ? Outcome{Verdict::kStale, Reason::kBeforeEstimate}
                                   : Outcome{Verdict::kNotModelled, Reason::kUnknownLandmark};
  }
  if (!recipe_->calibration.is_empty()) {
    return correct_by(z, recipe_->calibration.slots(),
                      [&](const Pose2& /*pose*/) { return sight(*landmark, z); });
  }
  if (z.range && z.bearing) {
    return correct_by(z, body_, [&](const Pose2& pose) {
      return internal::of_source(recipe_->config, model.linearize_both(pose, landmark->position, z),
                                 Source::kSightings, landmark->id);
    });
  }
  return correct_by(z, body_, [&](const Pose2& pose) {
    return internal::of_source(recipe_->config, model.linearize(pose, landmark->position, z),
                               Source::kSightings, landmark->id);
  });
}

/// What a sighting says of the body and of those errors that are states.
std::optional<Linearization<Eigen::Dynamic, Eigen::Dynamic>> PoseEkf::sight(
    const Landmark& landmark, const RangeBearing& z) const {
  if (recipe_->calibration.is_empty()) {
    const auto lin = recipe_->landmark.linearize(pose(), landmark.position, z);
    return lin ? std::optional(internal::any_size(*lin)) : std::nullopt;
  }
  return internal::of_source(recipe_->config,
                             recipe_->calibration.linearize(belief_, recipe_->landmark,
                                                            landmark.position, z, odometry_.rate()),
                             Source::kSightings, landmark.id);
}

std::vector<Outcome> PoseEkf::on_joint(const std::vector<RangeBearing>& sightings,
                                       Association association) {
  internal::validate_together("sightings of one instant", sightings);
  if (!internal::are_plausible(sightings, recipe_->config.limits)) {
    return internal::plausible_only(sightings, recipe_->config.limits,
                                    [&](const auto& rest) { return on_joint(rest, association); });
  }
  std::vector<Outcome> outcomes(sightings.size(),
                                Outcome{Verdict::kStale, Reason::kBeforeEstimate});
  if (sightings.empty() || sightings.front().stamp < belief_.stamp) {
    return outcomes;
  }
  Transaction<3> transaction(belief_, sightings.front().stamp);
  advance_to(sightings.front().stamp);
  const std::vector<const Landmark*> landmarks = associated(sightings, association);
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    const std::optional<Id>& name = sightings[i].landmark;
    const bool known = name ? recipe_->landmarks->find(*name) != nullptr
                            : !recipe_->landmarks->landmarks().empty();
    outcomes[i] = landmarks[i] == nullptr && known
                      ? Outcome{Verdict::kGated, Reason::kUnlikely}
                      : transaction.close(internal::one_of_several(
                            [&] { return on(sightings[i], landmarks[i]); }));
  }
  return outcomes;
}

/// For each sighting the landmark that it is of, or null.
std::vector<const Landmark*> PoseEkf::associated(const std::vector<RangeBearing>& sightings,
                                                 Association association) const {
  const std::vector<Landmark>& known = recipe_->landmarks->landmarks();
  const std::vector<int> rows = belief_.rows(recipe_->calibration.slots());
  Pairings pairings(sightings.size());
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    for (std::size_t k = 0; k < known.size(); ++k) {
      if (sightings[i].landmark.value_or(known[k].id) != known[k].id) {
        continue;
      }
      if (const auto lin = sight(known[k], sightings[i])) {
        pairings[i].push_back({static_cast<int>(k), *lin, rows});
      }
    }
  }
  const double probability = recipe_->config.landmark.gate;
  compare(belief_.P, probability, pairings);
  const Assignment assignment = associate(association, belief_.P, pairings, probability);
  std::vector<const Landmark*> landmarks(sightings.size(), nullptr);
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (assignment[i] >= 0) {
      const Pairing& pairing = pairings[i][static_cast<std::size_t>(assignment[i])];
      landmarks[i] = &known[static_cast<std::size_t>(pairing.landmark)];
    }
  }
  return landmarks;
}

Outcome PoseEkf::on(const Altitude& z) { return internal::not_used(z); }

Outcome PoseEkf::on(const Heading& z) {
  validate(z);
  std::optional<Reading>& reading = readings_[z.is_course ? 1 : 0];
  constexpr double kFrozenTurn = 0.1;  // [rad]
  if (reading && reading->is_of(z) && reading->most > kFrozenTurn) {
    return {Verdict::kImplausible, Reason::kFrozen};
  }
  const Calibration& calibration = recipe_->calibration;
  const Outcome outcome = z.is_course || !calibration.learns_heading() ? fuse_direction(z)
                          : calibration.has_heading(belief_)           ? fuse_with_offset(z)
                                                                       : begin_with_offset(z);
  if (outcome.verdict == Verdict::kFused && !(reading && reading->is_of(z))) {
    reading = Reading{z.heading, 0.0, 0.0};
  }
  return outcome;
}

/// Whether a reading is the same again, but for its last digits.
bool PoseEkf::Reading::is_of(const Heading& z) const {
  constexpr double kSame = 1e-4;  // [rad]
  return std::abs(wrap_angle(z.heading - heading)) < kSame;
}

/// Odometry turned the body.
void PoseEkf::count_turn(double turn) {
  for (std::optional<Reading>& reading : readings_) {
    if (reading) {
      reading->turned += turn;
      reading->most = std::max(reading->most, std::abs(reading->turned));
    }
  }
}

/// Fuses what says the heading of the body, or the course of its antenna, by itself.
Outcome PoseEkf::fuse_direction(const Heading& z) {
  return correct(
      Source::kHeadings, z.stamp, recipe_->heading_gate, internal::kGaussian, body_,
      [&](const Pose2& pose) {
        return internal::of_source(recipe_->config,
                                   recipe_->heading.linearize(pose, z, body_rate()),
                                   Source::kHeadings, z.is_course ? 1 : 0);
      },
      [] { return Reason::kNoDirection; });
}

/// Fuses a heading of which it is learnt what it reads more than the body's.
Outcome PoseEkf::fuse_with_offset(const Heading& z) {
  const std::vector<Slot>& slots = recipe_->calibration.heading_slots();
  return correct(
      Source::kHeadings, z.stamp, recipe_->heading_gate, internal::kGaussian, slots,
      [&](const Pose2& pose) {
        const double offset = belief_.x(belief_.offset(slots.back()));
        return internal::of_source(recipe_->config,
                                   recipe_->heading.linearize(pose, offset, z, Pose2{}),
                                   Source::kHeadings);
      },
      [] { return Reason::kNone; });
}

/// The same of the first one, which what it reads more becomes a state for.
Outcome PoseEkf::begin_with_offset(const Heading& z) {
  PoseEkf before = *this;
  recipe_->calibration.add_heading_to(belief_);
  if (without_poses_) {
    recipe_->calibration.add_heading_to(*without_poses_);
  }
  try {
    const Outcome outcome = fuse_with_offset(z);
    if (outcome.verdict != Verdict::kFused) {
      *this = std::move(before);
    }
    return outcome;
  } catch (...) {
    *this = std::move(before);
    throw;
  }
}

Outcome PoseEkf::on(const Message& message) {
  return internal::dispatch<LaserScan>(*this, message);
}

Outcome PoseEkf::fuse(Stamp stamp, const Linearization<Eigen::Dynamic, 3>& lin, const Gate& gate) {
  return correct(
      std::nullopt, stamp, gate, internal::kGaussian, body_,
      [&](const Pose2& /*pose*/) { return std::optional(lin); }, [] { return Reason::kNone; });
}

Outcome PoseEkf::on_joint(const std::vector<Range>& epoch) {
  if (epoch.empty() || epoch.size() > kMaxJoint) {
    throw std::invalid_argument("an epoch has " + std::to_string(epoch.size()) +
                                " ranges, expected 1 to " + std::to_string(kMaxJoint));
  }
  internal::validate_together("ranges of one epoch", epoch);
  const bool has_states = std::any_of(epoch.begin(), epoch.end(), [&](const Range& z) {
    return recipe_->calibration.slots_of(z.anchor) != nullptr;
  });
  if (has_states || !recipe_->range_noise.is_gaussian()) {
    throw std::invalid_argument(
        "ranges are fused jointly as the map has them and with Gaussian noise only; with "
        "range.noise, or errors of anchors as states, fuse them one by one");
  }
  return correct(
      Source::kRanges, epoch.front().stamp, recipe_->range_gate, internal::kGaussian, body_,
      [&](const Pose2& pose) {
        using Joint = Linearization<Eigen::Dynamic, 3, kMaxJoint>;
        const auto n = static_cast<Eigen::Index>(epoch.size());
        Joint joint;
        joint.residual.resize(n);
        joint.jacobian.resize(n, 3);
        joint.noise.setZero(n, n);
        joint.correlation.time_s = recipe_->config.correlation_s;
        joint.correlation.kind = static_cast<std::size_t>(Source::kRanges);
        Eigen::Index rows = 0;
        for (const Range& z : epoch) {
          const bool plausible = is_plausible(z, recipe_->config.limits);
          if (const auto lin = plausible ? recipe_->range.linearize(pose, z) : std::nullopt) {
            joint.residual(rows) = lin->residual(0);
            joint.jacobian.row(rows) = lin->jacobian;
            joint.noise(rows, rows) = lin->noise(0);
            joint.correlation.sources[static_cast<std::size_t>(rows)] =
                internal::source_of(Source::kRanges, internal::link_of(z));
            ++rows;
          }
        }
        joint.residual.conservativeResize(rows);
        joint.jacobian.conservativeResize(rows, 3);
        joint.noise.conservativeResize(rows, rows);
        return rows > 0 ? std::optional(joint) : std::nullopt;
      },
      [&] { return internal::why_not(recipe_->range, epoch.front()); });
}

void PoseEkf::advance_to(Stamp stamp) {
  internal::advance(*recipe_, odometry_, body_, belief_, stamp);
}

PoseEstimate PoseEkf::current() const {
  return {belief_.stamp, pose(), belief_.marginal_of_first<3>()};
}

PoseEstimate PoseEkf::estimate() const {
  return estimate(std::max(belief_.stamp, odometry_.end()));
}

PoseEstimate PoseEkf::estimate(Stamp stamp) const {
  internal::check_not_before(belief_.stamp, stamp);
  GaussianBelief ahead = belief_;
  internal::advance(*recipe_, odometry_, body_, ahead, stamp);
  return {ahead.stamp, ahead.pose(body_), ahead.marginal_of_first<3>()};
}

}  // namespace locfuse
