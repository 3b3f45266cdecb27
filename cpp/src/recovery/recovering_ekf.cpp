// SPDX-License-Identifier: Apache-2.0
#include "locfuse/recovery/recovering_ekf.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/error.hpp"
#include "locfuse/math/angle.hpp"

namespace locfuse {
namespace {

constexpr double kInReach = 13.8;   // chi-squared, two degrees of freedom, 0.999
constexpr double kFarSigmas = 5.0;  // beyond which a fix is not of a place
constexpr double kSlack = 2.0;      // for the arm of an antenna, and odometry since then [m]

const PoseEstimate& planar(const PoseEstimate& estimate) { return estimate; }
PoseEstimate planar(const AirEstimate& estimate) {
  return {estimate.stamp, estimate.pose, estimate.covariance.topLeftCorner<3, 3>()};
}

/// Where three tags are whose heading nobody knows: after a long silence their triangle is lost.
PoseEstimate without_heading(const GaussianBelief& belief) {
  constexpr int kTags = TagTriangleEkf::kTags;
  PoseEstimate estimate{belief.stamp, {}, Matrix<3, 3>::Identity()};
  Vector<2> middle = Vector<2>::Zero();
  for (int tag = 0; tag < kTags; ++tag) {
    middle += belief.x.segment<2>(2 * tag) / kTags;
  }
  const double spread = 1.0 + 2.0 * belief.P.diagonal().head<2 * kTags>().maxCoeff();  // [m^2]
  estimate.pose = {middle.x(), middle.y(), 0.0};
  estimate.covariance.diagonal() << spread, spread, kPi * kPi / 3.0;  // any heading
  return estimate;
}

/// What `estimate` says of an estimator's pose.
template <class Ekf, class Estimate>
PoseEstimate pose_of(const Ekf& ekf, const Estimate& estimate) {
  if constexpr (std::is_same_v<Ekf, TagTriangleEkf>) {
    try {
      return estimate(ekf);
    } catch (const NumericalError&) {
      return without_heading(ekf.belief());
    }
  } else {
    return planar(estimate(ekf));
  }
}

/// The estimate at a stamp that may be that of the belief.
template <class Ekf>
auto estimate_at(const Ekf& ekf, Stamp stamp) {
  return stamp > ekf.belief().stamp ? ekf.estimate(stamp) : ekf.current();
}

/// The estimate at the end of odometry, but not before `stamp`.
template <class Ekf>
auto estimate_from(const Ekf& ekf, Stamp stamp) {
  auto now = ekf.estimate();
  return stamp > now.stamp ? ekf.estimate(stamp) : now;
}

/// What judges poses; nothing where they are fused.
std::optional<PoseWatch> watch_of(const RecoveringEkf::Config& config) {
  if (!config.start.watch_poses) {
    return std::nullopt;
  }
  const PoseEkf::Config& robot = config.start.estimator;
  return PoseWatch({config.health, robot.pose, robot.odometry, robot.limits, robot.hold_s});
}

template <class Call>
auto of(Tracker& tracker, const Call& call) {
  return std::visit(call, tracker);
}
template <class Call>
auto of(const Tracker& tracker, const Call& call) {
  return std::visit(call, tracker);
}

}  // namespace

RecoveringEkf::RecoveringEkf(const Config& config, const World& world)
    : recipe_(std::make_shared<const Recipe>(Recipe{
          config, Initializer(config.start, world), world,
          config.restart && (!config.tracker ||
                             std::holds_alternative<TagTriangleEkf::Config>(*config.tracker))})),
      start_(recipe_->fresh),
      conditioner_(recipe_->fresh.conditioner()),
      health_(config.health),
      watch_(watch_of(config)) {
  (void)tracker_at({0, {}, Matrix<3, 3>::Identity()}, recipe_->fresh);  // checks
}

void RecoveringEkf::start_at(const PoseEstimate& start) { start_with(tracker_at(start, fresh())); }

void RecoveringEkf::start_from(const Initializer& found) {
  start_with(tracker_at(found.estimator().current(), found));
  conditioner_ = found.conditioner();
}

/// A filter that starts at `start`, with the last odometry of a search.
Tracker RecoveringEkf::tracker_at(const PoseEstimate& start, const Initializer& found) const {
  const Config& config = recipe_->config;
  if (!config.tracker) {
    return found.started_at(start);
  }
  Tracker tracker = [&]() -> Tracker {
    if (const auto* mapping = std::get_if<LandmarkEkf::Config>(&*config.tracker)) {
      return LandmarkEkf(*mapping, recipe_->world, start);
    }
    if (const auto* air = std::get_if<AirEkf::Config>(&*config.tracker)) {
      AirEstimate in_space{start.stamp, start.pose, config.start_height};
      in_space.covariance.topLeftCorner<3, 3>() = start.covariance;
      in_space.covariance(3, 3) = config.sigma_start_height * config.sigma_start_height;
      return AirEkf(*air, recipe_->world, in_space);
    }
    return TagTriangleEkf(std::get<TagTriangleEkf::Config>(*config.tracker), recipe_->world, start);
  }();
  if (const std::optional<Message> rest = found.odometry_from(start.stamp)) {
    of(tracker, [&](auto& ekf) { return ekf.on(*rest); });
  }
  return tracker;
}

Initializer RecoveringEkf::fresh() const {
  Initializer anew = recipe_->fresh;
  if (tracker_) {  // lost, it may have no scans
    anew.use_gaussian_sum();
  }
  if (control_) {
    std::visit([&anew](const auto& u) { anew.on(u); }, *control_);
  } else if (tracker_ && !recipe_->config.tracker) {
    anew.expect_motion();
  }
  return anew;
}

RecoveringEkf RecoveringEkf::restarted(const PoseEstimate& start) const {
  RecoveringEkf other = *this;
  other.start_with(of(started(), [&](const auto& ekf) -> Tracker {
    using Ekf = std::decay_t<decltype(ekf)>;
    if constexpr (std::is_same_v<Ekf, LandmarkEkf> || std::is_same_v<Ekf, AirEkf>) {
      return ekf.continued_at(start.stamp);
    } else {
      return ekf.restarted(start);
    }
  }));
  other.control_.reset();
  other.conditioner_ = recipe_->fresh.conditioner();
  other.watch_ = watch_of(recipe_->config);
  return other;
}

const Tracker& RecoveringEkf::started() const {
  if (!tracker_) {
    throw std::logic_error("the RecoveringEkf has not started; call start_at before");
  }
  return *tracker_;
}

Stamp RecoveringEkf::stamp() const {
  const Stamp believed = belief().stamp;
  return newest_ - believed >= kReportEvery ? newest_ : believed;
}

PoseEstimate RecoveringEkf::believed() const { return believed_at(stamp()); }

PoseEstimate RecoveringEkf::believed_at(Stamp stamp) const {
  return of(started(), [stamp](const auto& ekf) {
    return pose_of(ekf, [stamp](const auto& one) { return estimate_at(one, stamp); });
  });
}

PoseEstimate RecoveringEkf::current() const { return doubted(believed()); }

PoseEstimate RecoveringEkf::estimate() const {
  return doubted(of(started(), [at = stamp()](const auto& ekf) {
    return pose_of(ekf, [at](const auto& one) { return estimate_from(one, at); });
  }));
}

PoseEstimate RecoveringEkf::doubted(const PoseEstimate& estimate) const {
  return health_.is_lost() ? health_.doubted(estimate, health_.wrong()) : estimate;
}

std::optional<AirEstimate> RecoveringEkf::current_in_space() const {
  const auto* ekf = std::get_if<AirEkf>(&started());
  return ekf != nullptr ? std::optional(estimate_at(*ekf, stamp())) : std::nullopt;
}

std::optional<AirEstimate> RecoveringEkf::estimate_in_space() const {
  const auto* ekf = std::get_if<AirEkf>(&started());
  return ekf != nullptr ? std::optional(estimate_from(*ekf, stamp())) : std::nullopt;
}

const GaussianBelief& RecoveringEkf::belief() const {
  return *of(started(), [](const auto& ekf) { return &ekf.belief(); });
}

Outcome RecoveringEkf::on(const Velocity& u) { return drive(u); }
Outcome RecoveringEkf::on(const Increment& u) { return drive(u); }
Outcome RecoveringEkf::on(const Range& z) { return correct(z); }
Outcome RecoveringEkf::on(const PositionFix& z) { return correct(z); }
Outcome RecoveringEkf::on(const PoseObservation& z) { return watch_ ? watch(z) : correct(z); }
Outcome RecoveringEkf::on(const RangeBearing& z) { return correct(z); }
Outcome RecoveringEkf::on(const Altitude& z) { return correct(z); }
Outcome RecoveringEkf::on(const Heading& z) { return correct(z); }

Outcome RecoveringEkf::on(const Imu& z) {
  validate(z);
  auto* air = tracker_ ? std::get_if<AirEkf>(&*tracker_) : nullptr;
  if (air == nullptr || !air->is_inertial()) {
    return {Verdict::kIgnored, tracker_ ? Reason::kNotUsed : Reason::kNotStarted};
  }
  const Outcome outcome = track_in_space(*air, z);
  const bool has_heading = places_ ? places_->has_headings() : air->has_heading();
  if (outcome.verdict == Verdict::kFused && !has_heading) {
    places_.emplace(recipe_->places(), *air);
  }
  health_.advance(belief().stamp);
  listen();
  return outcome;
}

Outcome RecoveringEkf::on(const Message& message) { return internal::dispatch(*this, message); }

Outcome RecoveringEkf::on(const LaserScan& z) {
  validate(z);
  if (search([&](Initializer& start) { start.on(z); })) {
    decide();
  }
  return {Verdict::kIgnored, Reason::kNotUsed};
}

/// Judges a pose by the estimate at its stamp.
Outcome RecoveringEkf::watch(const PoseObservation& z) {
  validate(z);
  if (!tracker_) {
    return {Verdict::kIgnored, Reason::kNotStarted};
  }
  if (!is_plausible(z, recipe_->config.start.estimator.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (z.stamp < belief().stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  const PoseEstimate here = believed_at(z.stamp);
  return watch_->on(z, here, health_of(here));
}

std::optional<WatchReport> RecoveringEkf::watched() const {
  if (!watch_) {
    return std::nullopt;
  }
  if (!tracker_) {
    return WatchReport{};
  }
  const PoseEstimate here = believed();
  return watch_->report(here, health_of(here));
}

template <class M>
Outcome RecoveringEkf::drive(const M& u) {
  Outcome outcome{Verdict::kIgnored, Reason::kNotStarted};
  if (tracker_) {
    outcome = track(u);
    if (outcome.verdict != Verdict::kImplausible && outcome.verdict != Verdict::kStale) {
      if (conditioner_) {
        conditioner_->on(u);
      }
      if (watch_) {
        watch_->on(u);
      }
    }
    health_.advance(belief().stamp);
    listen();
  }
  (void)search([&](Initializer& start) { start.on(u); });
  control_ = u;
  return outcome;
}

Outcome RecoveringEkf::fuse_conditioned(const PositionFix& z) {
  if (!is_plausible(z, recipe_->config.start.estimator.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  const ConditionedFix result = conditioner_->on(z);
  if (!result.fix && result.verdict != TagVerdict::kUnknownTag) {
    Outcome rejected =
        result.verdict == TagVerdict::kStale
            ? Outcome{Verdict::kStale, Reason::kBeforeEstimate}
            : Outcome{Verdict::kImplausible,
                      result.verdict == TagVerdict::kFrozen ? Reason::kFrozen : Reason::kJumped};
    rejected.residual = result.distance;
    rejected.limit = result.limit;
    return rejected;
  }
  return fuse_unless_excluded(result.fix.value_or(z));
}

template <class M>
Outcome RecoveringEkf::fuse(const M& z) {
  if constexpr (std::is_same_v<M, PositionFix>) {
    return conditioner_ ? fuse_conditioned(z) : fuse_unless_excluded(z);
  } else if constexpr (std::is_same_v<M, Range>) {
    return fuse_unless_excluded(z);
  } else {
    return track(z);
  }
}

/// What is excluded is compared only.
template <class M>
Outcome RecoveringEkf::fuse_unless_excluded(const M& z) {
  if (!health_.is_excluded(named_source_of(z))) {
    return track(z);
  }
  Outcome compared = of(*tracker_, [&](auto ekf) { return ekf.on(z); });
  if (compared.verdict == Verdict::kFused) {
    compared.verdict = Verdict::kGated;
    compared.reason = Reason::kSourceExcluded;
  }
  return compared;
}

template <class M>
Outcome RecoveringEkf::track(const M& message) {
  if (auto* air = std::get_if<AirEkf>(&*tracker_)) {
    return track_in_space(*air, message);
  }
  return of(*tracker_, [&](auto& ekf) { return ekf.on(message); });
}

/// What all places where a body in space may be make of it.
template <class M>
Outcome RecoveringEkf::track_in_space(AirEkf& air, const M& message) {
  constexpr bool kIsRange = std::is_same_v<M, Range>;
  if constexpr (kIsRange) {
    if (!places_ && AirSum::is_vague(air, message)) {
      places_.emplace(recipe_->places(), air);
    }
  }
  if (!places_) {
    const Outcome outcome = air.on(message);
    if (kIsRange && outcome.verdict == Verdict::kFused) {
      mirror(air);
    }
    return outcome;
  }
  const Outcome outcome = places_->on(message);
  air = places_->mean();
  if (kIsRange && outcome.dof > 0 && places_->decided() != nullptr) {
    if (health_.is_lost() && recipe_->config.restart) {
      restarts_ += places_->has_moved() ? 1 : 0;
      health_.start(belief().stamp, 1.0 - recipe_->config.start.probability_ready);
    }
    places_.reset();
  }
  return outcome;
}

/// Near the plane of its anchors a body in space may be on either side.
void RecoveringEkf::mirror(const AirEkf& air) {
  if (const auto image = air.image()) {
    places_.emplace(recipe_->places(), air);
    places_->add_image(image->first, image->second);
  }
}

/// Gives a search what it has a use for: it knows no height, so no line of sight in space.
template <class M>
void RecoveringEkf::give(Initializer& start, const M& z) const {
  if constexpr (std::is_same_v<M, RangeBearing>) {
    if ((z.elevation || z.sigma_elevation) && is_in_space()) {
      validate_in_space(z);
      return;
    }
  }
  start.on(z);
}

template <class M>
Outcome RecoveringEkf::correct(const M& z) {
  Outcome outcome{Verdict::kIgnored, Reason::kNotStarted};
  if (tracker_) {
    outcome = fuse(z);
    newest_ = std::max(newest_, z.stamp);
    record(z, outcome);
    listen();
  }
  if (outcome.verdict != Verdict::kStale && search([&](Initializer& start) { give(start, z); })) {
    decide();
    if constexpr (std::is_same_v<M, PositionFix>) {
      check_search(z.stamp, z.position, z.covariance);
    } else if constexpr (std::is_same_v<M, PoseObservation>) {
      check_search(z.stamp, {z.pose.x, z.pose.y}, z.covariance.template topLeftCorner<2, 2>());
    }
  }
  return outcome;
}

std::vector<Outcome> RecoveringEkf::on_joint(const std::vector<RangeBearing>& sightings,
                                             Association association) {
  internal::validate_together("sightings of one instant", sightings, [this](const RangeBearing& z) {
    is_in_space() ? validate_in_space(z) : validate(z);
  });
  std::vector<Outcome> outcomes(sightings.size(), Outcome{Verdict::kIgnored, Reason::kNotStarted});
  if (tracker_) {
    outcomes = of(*tracker_, [&](auto& ekf) {
      using Ekf = std::decay_t<decltype(ekf)>;
      if constexpr (std::is_same_v<Ekf, TagTriangleEkf>) {
        return std::vector<Outcome>(sightings.size(), Outcome{Verdict::kIgnored, Reason::kNotUsed});
      } else if constexpr (std::is_same_v<Ekf, AirEkf>) {
        std::transform(sightings.begin(), sightings.end(), outcomes.begin(),
                       [&](const RangeBearing& z) { return track(z); });
        return outcomes;
      } else {
        return ekf.on_joint(sightings, association);
      }
    });
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      newest_ = std::max(newest_, sightings[i].stamp);
      record(sightings[i], outcomes[i]);
    }
    listen();
  }
  const bool searches = search([&](Initializer& start) {
    Initializer fed = start;
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      if (outcomes[i].verdict != Verdict::kStale) {
        give(fed, sightings[i]);
      }
    }
    start = std::move(fed);
  });
  if (searches) {
    decide();
  }
  return outcomes;
}

/// Whether there is a search, and it took what it is given. What it cannot use is fused already
/// where a filter tracks: then another search begins, and the message is good.
template <class Feed>
bool RecoveringEkf::search(const Feed& feed) {
  if (!start_) {
    return false;
  }
  try {
    feed(*start_);
    return true;
  } catch (const std::exception&) {
    if (!tracker_) {
      throw;
    }
    begin_search();
    return false;
  }
}

template <class M>
void RecoveringEkf::record(const M& z, const Outcome& outcome) {
  if (outcome.verdict == Verdict::kFused && outcome.dof == 0) {
    return;  // a landmark that is new says nothing of the pose
  }
  health_.record(named_source_of(z), z.stamp, outcome, outcome.dof > 0 ? outcome.limit : 1.0,
                 health_.outlier_volume(z));
}

/// Lost, another start begins; found again without it, it ends.
void RecoveringEkf::listen() {
  const bool was_lost = std::exchange(was_lost_, health_.is_lost());
  if (was_lost_ && !was_lost) {
    ++alarms_;
    const auto* air = std::get_if<AirEkf>(&*tracker_);
    if (recipe_->restarts) {
      begin_search();
    } else if (air != nullptr && recipe_->config.restart) {
      const double wrong = health_.wrong();
      if (!places_) {
        places_.emplace(recipe_->places(), *air);
      }
      places_->add(air->anywhere(recipe_->config.health.wrong_span_m), wrong / (1.0 - wrong));
    }
  } else if (!was_lost_) {
    start_.reset();
  }
}

void RecoveringEkf::begin_search() {
  start_ = fresh();
  search_fits_ = newest_;
}

/// A search has its places by the first fixes: where those were wrong, and later ones fit none of
/// them, another one begins.
void RecoveringEkf::check_search(Stamp stamp, const Vector<2>& position, const Matrix<2, 2>& R) {
  if (!tracker_ || !start_) {
    return;
  }
  const Initializer::State now = start_->state();
  const double reach = kSlack + kFarSigmas * std::sqrt(std::max(R.trace(), 0.0));
  const auto fits = [&](const Initializer::Hypothesis& one) {
    const PoseEstimate& there = one.estimate;
    return std::hypot(there.pose.x - position.x(), there.pose.y - position.y()) <=
           reach + kFarSigmas * there.sigma_position();
  };
  if (now.hypotheses.empty() || std::any_of(now.hypotheses.begin(), now.hypotheses.end(), fits)) {
    search_fits_ = std::max(search_fits_, stamp);
  } else if (seconds_between(search_fits_, stamp) > recipe_->config.health.faulty_s) {
    begin_search();
  }
}

/// Of a place that no filter can start from the search has nothing: another one begins.
void RecoveringEkf::decide() {
  Initializer::State now = start_->state();
  if (now.status != StartStatus::kReady && tracker_ && !control_ && !recipe_->config.tracker) {
    now = start_->place();  // a heading that nothing measures is not waited for
  }
  if (now.status != StartStatus::kReady) {
    return;
  }
  const PoseEstimate& there = now.hypotheses.front().estimate;
  double wrong = 1.0 - recipe_->config.start.probability_ready;
  if (const auto by_one = health_.wrong_by_one_source();
      tracker_ && by_one && !is_in_reach(there)) {
    if (1.0 - *by_one > recipe_->config.health.risk) {
      begin_search();  // what is believed in the end rests on what was measured last
      return;
    }
    wrong = std::max(wrong, 1.0 - *by_one);
  }
  try {
    Tracker found = tracker_at(there, *start_);
    restarts_ += tracker_ ? 1 : 0;
    start_with(std::move(found));
    health_.start(belief().stamp, wrong);
  } catch (const std::exception&) {
    begin_search();
  }
}

/// Whether a place is one that the belief does not rule out: dead reckoning may have come there.
bool RecoveringEkf::is_in_reach(const PoseEstimate& there) const {
  const PoseEstimate here = believed_at(std::max(there.stamp, belief().stamp));
  const Vector<2> apart(there.pose.x - here.pose.x, there.pose.y - here.pose.y);
  const Matrix<2, 2> S = (here.covariance + there.covariance).topLeftCorner<2, 2>();
  return apart.dot(S.ldlt().solve(apart)) <= kInReach;
}

void RecoveringEkf::start_with(Tracker tracker) {
  tracker_ = std::move(tracker);
  places_.reset();
  newest_ = belief().stamp;
  health_.start(newest_);
  start_.reset();
  was_lost_ = false;
  if (const auto* air = std::get_if<AirEkf>(&*tracker_); air != nullptr && !air->has_heading()) {
    places_.emplace(recipe_->places(), *air);
  }
}

Initializer::State RecoveringEkf::state() const {
  if (start_) {
    return start_->state();
  }
  return {StartStatus::kReady, {}, {{estimate(), 1.0}}};
}

HealthReport RecoveringEkf::health_of(const PoseEstimate& here) const {
  HealthReport report = health_.report(here);
  if (places_ && places_->is_ambiguous() && report.state != HealthState::kLost) {
    report.state = HealthState::kAmbiguous;
    report.reason = HealthReason::kSeveralPlaces;
  }
  return report;
}

HealthReport RecoveringEkf::health() const {
  if (tracker_) {
    return health_of(believed());
  }
  HealthReport report;
  if (start_->state().status == StartStatus::kAmbiguous) {
    report.state = HealthState::kAmbiguous;
    report.reason = HealthReason::kSeveralPlaces;
  }
  return report;
}

}  // namespace locfuse
