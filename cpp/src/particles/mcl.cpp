// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/mcl.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include "estimators/innovation.hpp"
#include "estimators/recipe.hpp"
#include "locfuse/error.hpp"
#include "particles/mcl_tuning.hpp"
#include "recovery/health_tuning.hpp"
#include "recovery/outlier.hpp"

namespace locfuse {
namespace {

using internal::HealthTuning;
using internal::ParticleFilterTuning;
using internal::TrackingTuning;

/// Particles are kept in single precision, in which more is infinite.
void check_start(const PoseEstimate& start, const Limits& limits) {
  const Vector<3> mean(start.pose.x, start.pose.y, start.pose.heading);
  if (!mean.allFinite() || !start.covariance.allFinite() ||
      start.covariance.llt().info() != Eigen::Success) {
    throw std::invalid_argument(
        "a start has a pose that is not finite or a covariance that is not positive definite");
  }
  const double farthest = std::max(start.pose.position().norm(), start.sigma_position());
  if (!(farthest <= limits.distance_m)) {
    throw std::invalid_argument("a start has a position or its sigma of " +
                                std::to_string(farthest) + " m, expected at most " +
                                std::to_string(limits.distance_m) + " m (limits.distance_m)");
  }
}

void check_starts(const std::vector<PoseHypothesis>& hypotheses, const Limits& limits) {
  double total = 0.0;
  for (const PoseHypothesis& h : hypotheses) {
    check_stamp(h.estimate.stamp);
    check_start(h.estimate, limits);
    total += h.probability;
    if (!(h.probability > 0.0 && std::isfinite(total)) ||
        h.estimate.stamp != hypotheses.front().estimate.stamp) {
      throw std::invalid_argument("starts need finite probabilities > 0 and one stamp");
    }
  }
  if (hypotheses.empty()) {
    throw std::invalid_argument("there is no pose to start at");
  }
}

/// What judges poses; nothing where they weigh particles.
std::optional<PoseWatch> watch_of(const MclConfig& config) {
  if (!config.watch_poses) {
    return std::nullopt;
  }
  return PoseWatch({config.health, config.pose, config.odometry, config.limits, config.hold_s});
}

double returns_of(const LaserScan& scan) {
  return static_cast<double>(
      std::count_if(scan.ranges.begin(), scan.ranges.end(),
                    [&](double range) { return scan.geometry->is_return(range); }));
}

/// The landmark that fits a pose best, or the one that is named.
struct BestLandmark {
  const RangeBearingModel& model;
  const LandmarkMap& map;
  using Lin = Linearization<Eigen::Dynamic, 3, 2>;
  [[nodiscard]] std::optional<Lin> linearize(const Pose2& pose, const RangeBearing& z) const {
    if (z.landmark) {
      const Landmark* landmark = map.find(*z.landmark);
      return landmark == nullptr ? std::nullopt : model.linearize(pose, landmark->position, z);
    }
    std::optional<Lin> best;
    double min_nis = 0.0;
    for (const Landmark& landmark : map.landmarks()) {
      const std::optional<Lin> lin = model.linearize(pose, landmark.position, z);
      if (!lin) {
        continue;
      }
      const double nis = squared_mahalanobis(lin->residual, lin->noise);
      if (!best || nis < min_nis) {
        best = lin;
        min_nis = nis;
      }
    }
    return best;
  }
};

}  // namespace

Mcl::Mcl(const Config& config, const World& world, Stamp start)
    : recipe_(internal::make_mcl_recipe(config, world)),
      filter_(recipe_),
      sharpness_(recipe_),
      recovery_(recipe_),
      health_(recipe_),
      watch_(watch_of(recipe_->config)),
      keys_(config.seed),
      odometry_(start) {
  start_anywhere(start);
}

void Mcl::start_anywhere(Stamp stamp) {
  filter_.start_anywhere(stamp, keys_);
  restart(stamp, true);
}

void Mcl::start_at(const std::vector<PoseHypothesis>& hypotheses) {
  check_starts(hypotheses, recipe_->config.limits);
  filter_.start_at(hypotheses, keys_);
  restart(hypotheses.front().estimate.stamp, false);
}

void Mcl::start_with(Stamp stamp, const Matrix<4, Eigen::Dynamic>& particles) {
  const double total = particles.row(3).sum();
  const double farthest = recipe_->config.limits.distance_m;
  if (!particles.allFinite() || particles.cols() == 0 || particles.row(3).minCoeff() < 0.0 ||
      !(total > 0.0 && std::isfinite(total)) ||
      particles.topRows<2>().cwiseAbs().maxCoeff() > farthest) {
    throw std::invalid_argument(
        "particles need finite x, y, heading and weight >= 0, some weight > 0, and x and y of at "
        "most " +
        std::to_string(farthest) + " m (limits.distance_m)");
  }
  filter_.start_with(stamp, particles, total, keys_);
  restart(stamp, false);
}

/// Forgets everything but the particles and the seed.
void Mcl::restart(Stamp stamp, bool anywhere) {
  odometry_ = HeldMotion(stamp);
  tracking_ = {};
  tracking_.is_searching = anywhere;
  tracking_.stationary_scans = TrackingTuning::kStationaryScans;
  sharpness_.reset();
  recovery_.reset();
  health_.stop();
}

void Mcl::inject(const PoseEstimate& pose, double share) {
  if (!(share >= 1e-9 && share <= 1.0)) {
    throw std::invalid_argument("Mcl.inject.share is " + std::to_string(share) +
                                ", expected 1e-9 to 1");
  }
  if (pose.stamp < filter_.stamp()) {
    throw std::invalid_argument("a pose is injected at " + std::to_string(pose.stamp) +
                                " ns, before the last message at " +
                                std::to_string(filter_.stamp()) + " ns");
  }
  check_start(pose, recipe_->config.limits);
  advance_to(pose.stamp);
  if (share == 1.0) {
    const HeldMotion odometry = odometry_;
    const bool has_health = health_.is_active();
    start_at({{pose, 1.0}});
    odometry_ = odometry;
    health_.restart(pose.stamp, has_health);
    return;
  }
  propagate_particles();
  filter_.inject(pose, share, keys_);
  sharpness_.widen();
  tracking_.is_tracking = false;
  tracking_.stationary_scans = TrackingTuning::kStationaryScans;
}

void Mcl::advance_to(Stamp stamp) {
  check_stamp(stamp);
  odometry_.advance(
      filter_.stamp(), stamp, recipe_->hold,
      [&](const Pose2& motion, Stamp until, const std::optional<Vector<3>>& variance) {
        drive(recipe_->motion, motion, until, variance);
      },
      [&](Stamp until) { drive(recipe_->lost, Pose2{}, until, {}); });
}

bool Mcl::advance_unless_stale(Stamp stamp) {
  const bool is_stale = stamp < filter_.stamp();
  if (!is_stale) {
    advance_to(stamp);
  }
  return !is_stale;
}

void Mcl::drive(const OdometryMotion& model, const Pose2& motion, Stamp until,
                const std::optional<Vector<3>>& variance) {
  filter_.add_motion(model, motion, until, variance);
  tracking_.since_scan.for_each([&](Way& way) {
    way.travelled += motion.position().norm();
    way.turned += std::abs(motion.heading);
  });
  health_.add_motion(motion);
  if (filter_.is_propagation_due()) {
    propagate_particles();
  }
}

void Mcl::propagate_particles() {
  if (filter_.has_pending_motion()) {
    const Pose2 motion = filter_.pending_in_cells().motion;
    filter_.propagate(keys_);
    recovery_.propagate(motion, keys_);
  }
}

/// Draws particles from where the scan says, too, if one cluster is tracked. Returns the scan
/// without the beams by which that has weighed them, if there are any.
std::optional<LaserScan> Mcl::propagate_particles(const LaserScan& scan) {
  const Proposal proposal = recipe_->config.proposal;
  if (!filter_.has_pending_motion() || !tracking_.is_tracking || proposal == Proposal::kOdometry) {
    propagate_particles();
    return std::nullopt;
  }
  const Pose2 motion = filter_.pending_in_cells().motion;
  std::optional<LaserScan> rest;
  if (proposal != Proposal::kScanMatch) {
    rest = filter_.propagate_by_lines(scan, sigma_hit(), keys_);
  } else if (!filter_.propagate_by_match(scan, sigma_hit(), keys_)) {
    filter_.propagate(keys_);
  }
  recovery_.propagate(motion, keys_);
  return rest;
}

Outcome Mcl::on(const Velocity& u) {
  validate(u);
  if (!is_plausible(u, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (!advance_unless_stale(u.stamp)) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  odometry_.take(u);
  if (watch_) {
    watch_->on(u);
  }
  return {Verdict::kFused};
}

Outcome Mcl::on(const Increment& u) {
  validate(u);
  if (!is_plausible(u, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (u.stamp < filter_.stamp()) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  advance_to(u.begin);
  if (u.begin == u.stamp) {  // a displacement without duration
    drive(recipe_->motion, u.motion, u.stamp, u.variance);
  }
  odometry_.take(u, recipe_->config.limits);
  if (watch_) {
    watch_->on(u);
  }
  return {Verdict::kFused};
}

Outcome Mcl::on(const LaserScan& z) {
  validate(z);
  if (!advance_unless_stale(z.stamp)) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  const std::optional<LaserScan> turned = as_of_stamp(z, odometry_.rate().heading);
  return take(turned ? *turned : z);
}

Outcome Mcl::take(const LaserScan& z) {
  const ScanEvidence before = evidence_of_prediction(z);
  const std::optional<LaserScan> uncovered = internal::MclHealth::without_cover(z, before);
  const LaserScan& scan = uncovered ? *uncovered : z;
  const EndPoints points = recipe_->fields.front().end_points(scan, recipe_->config.beams);
  if (const Outcome refused = verdict_on(scan, points, before);
      refused.verdict != Verdict::kFused) {
    health_.report_scan(z, before);
    return refused;
  }
  const std::optional<LaserScan> rest = propagate_particles(scan);
  const internal::UsedScan used = weigh_and_resample(scan, points, rest);
  report_scan(z, before);
  sharpen_map(points);
  recover(used);
  start_health();
  return {Verdict::kFused};
}

/// Whether the robot has moved far enough for a scan to be new information beside the last one of
/// the same laser; others look elsewhere.
bool Mcl::has_moved(const LaserScan& scan) const {
  const Way* way = tracking_.since_scan.find(scan);
  return way == nullptr || way->travelled >= recipe_->config.spacing_m ||
         way->turned >= recipe_->config.spacing_heading_rad;
}

ScanEvidence Mcl::evidence_of_prediction(const LaserScan& z) const {
  return health_.is_active() ? health_.evidence_of(z, filter_.predicted(filter_.best().estimate))
                             : ScanEvidence{};
}

/// Whether a scan weighs particles; if not, it still counts for health.
Outcome Mcl::verdict_on(const LaserScan& scan, const EndPoints& points,
                        const ScanEvidence& evidence) const {
  if (evidence.covered >= HealthTuning::kBlindingCover) {
    return {Verdict::kGated, Reason::kCovered};
  }
  if (points.x.empty()) {
    return {Verdict::kNotModelled, Reason::kNoReturns};
  }
  const bool may_repeat = tracking_.is_tracking && tracking_.stationary_scans > 0;
  return has_moved(scan) || may_repeat ? Outcome{Verdict::kFused}
                                       : Outcome{Verdict::kNotModelled, Reason::kNoNews};
}

/// Weighs particles by a scan, or by what is left of it to do so; eq. (2.1) of
/// docs/models/particles.md.
internal::UsedScan Mcl::weigh_and_resample(const LaserScan& scan, const EndPoints& points,
                                           const std::optional<LaserScan>& rest) {
  const Config& config = recipe_->config;
  filter_.weigh(sharpness_.field(), points);
  const double best = filter_.best_log_likelihood();
  const bool was_tracking = tracking_.is_tracking;
  update_tracking(scan);
  const double independent =
      tracking_.is_tracking ? config.independent_beams : config.independent_beams_searching;
  const double share = std::min(1.0, independent / static_cast<double>(points.x.size()));
  if (recipe_->beams) {
    filter_.weigh(*recipe_->beams, rest ? *rest : scan);
  } else if (rest) {
    const double part = returns_of(*rest) / returns_of(scan);
    filter_.weigh(sharpness_.field(), recipe_->fields.front().end_points(
                                          *rest, static_cast<int>(std::ceil(part * config.beams))));
  }
  resample(share);
  return {points, share, best, was_tracking && !tracking_.is_tracking};
}

/// A cluster that has converged stays the tracked one until another is likelier than all others.
void Mcl::update_tracking(const LaserScan& scan) {
  tracking_.stationary_scans -= has_moved(scan) ? 0 : 1;
  tracking_.since_scan.set(scan, {});
  tracking_.is_tracking =
      sharpness_.fit_is_nominal() && !health_.is_lost() &&
      (ready() ||
       (tracking_.is_tracking && filter_.best().probability > TrackingTuning::kMinProbability));
}

/// Reports how a scan fits the updated estimate, as new as it was `before` the update.
void Mcl::report_scan(const LaserScan& z, const ScanEvidence& before) {
  if (health_.is_active()) {
    ScanEvidence after = health_.evidence_of(z, filter_.best().estimate);
    after.novelty = before.novelty;
    health_.report_scan(z, after);
  }
}

void Mcl::sharpen_map(const EndPoints& points) {
  tracking_.is_searching = tracking_.is_searching && !tracking_.is_tracking;
  const bool is_sharp = sharpness_.update(
      points, filter_.best().estimate, tracking_.is_searching ? filter_.particle_spacing() : 0.0);
  if (tracking_.is_tracking && is_sharp) {
    tracking_.stationary_scans = 0;
  }
}

void Mcl::recover(const internal::UsedScan& scan) {
  if (tracking_.is_tracking) {
    recovery_.pause();
  } else {
    recovery_.update(scan, sharpness_, filter_, keys_);
  }
}

void Mcl::start_health() {
  if (!health_.is_active() && ready()) {
    health_.start(filter_.stamp(), std::max(1.0 - filter_.best().probability, 0.0));
  }
}

void Mcl::resample(double max_share) {
  filter_.resample({max_share, tracking_.is_searching, ready()}, keys_);
}

template <class Model, class Message, class Why>
Outcome Mcl::weigh_by(const Model& model, const Message& z, const Why& why) {
  validate(z);
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (z.stamp < filter_.stamp()) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  // One pose may have no direction to an anchor; two have none only if the anchor is unknown.
  const Pose2 here = filter_.best().estimate.pose;
  const Pose2 beside{here.x + 1.0, here.y, here.heading};
  if (!model.linearize(here, z) && !model.linearize(beside, z)) {
    return {Verdict::kNotModelled, why()};
  }
  advance_to(z.stamp);
  propagate_particles();
  const Outcome outcome = internal::compare(model, filter_.best().estimate, z);
  if (outcome.dof > 0) {
    health_.record(z, outcome);
  }
  const double log_inlier = std::log1p(-recipe_->config.outlier_share);
  const double log_outlier = std::log(recipe_->config.outlier_share);
  filter_.weigh_poses([&](const Pose2& pose) {
    const auto lin = model.linearize(pose, z);
    const double floor = ParticleFilterTuning::kOutlierLogLikelihood *
                         static_cast<double>(lin ? lin->residual.size() : 1);
    const double fit = lin ? -0.5 * squared_mahalanobis(lin->residual, lin->noise) : floor;
    return internal::log_sum(log_inlier + fit, log_outlier + floor);
  });
  resample(1.0);
  return outcome;
}

Outcome Mcl::on(const RangeBearing& z) {
  if (!recipe_->landmarks) {
    validate(z);
    return {Verdict::kNotModelled, Reason::kUnknownLandmark};
  }
  return weigh_by(BestLandmark{recipe_->landmark, *recipe_->landmarks}, z,
                  [&] { return internal::why_not(*recipe_->landmarks, z); });
}

Outcome Mcl::on(const Range& z) {
  if (!recipe_->range) {
    validate(z);
    return {Verdict::kNotModelled, Reason::kUnknownAnchor};
  }
  return weigh_by(*recipe_->range, z, [&] { return internal::why_not(*recipe_->range, z); });
}

Outcome Mcl::on(const PositionFix& z) {
  return weigh_by(recipe_->position, z, [&] { return internal::why_not(recipe_->position, z); });
}

Outcome Mcl::on(const PoseObservation& z) {
  return watch_ ? watch(z) : weigh_by(recipe_->pose, z, [] { return Reason::kNoSigma; });
}

/// Judges a pose by the estimate at its stamp.
Outcome Mcl::watch(const PoseObservation& z) {
  validate(z);
  if (!has_started()) {
    return {Verdict::kIgnored, Reason::kNotStarted};
  }
  if (!is_plausible(z, recipe_->config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (z.stamp < filter_.stamp()) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  const PoseEstimate here = believed_at(z.stamp);
  return watch_->on(z, here, report_of(here));
}

std::optional<WatchReport> Mcl::watched() const {
  if (!watch_) {
    return std::nullopt;
  }
  const PoseEstimate here = believed();
  if (!has_started()) {
    WatchReport report;
    report.stamp = here.stamp;
    return report;
  }
  return watch_->report(here, report_of(here));
}

Outcome Mcl::on(const Altitude& z) { return internal::not_used(z); }
Outcome Mcl::on(const Heading& z) { return internal::not_used(z); }

Outcome Mcl::on(const Message& message) { return internal::dispatch(*this, message); }

Mcl Mcl::restarted(const PoseEstimate& pose) const {
  Mcl again = *this;
  again.start_at({{pose, 1.0}});
  again.watch_ = watch_of(recipe_->config);
  return again;
}

PoseEstimate Mcl::estimate() const {
  const PoseEstimate here = believed();
  const HealthReport report = report_of(here);
  return report.state == HealthState::kLost ? health_.doubted(here, report.wrong) : here;
}

PoseEstimate Mcl::believed() const { return believed_at(odometry_.end()); }

PoseEstimate Mcl::believed_at(Stamp stamp) const {
  return filter_.predicted(filter_.best().estimate, odometry_, stamp);
}

PoseEstimate Mcl::overall_estimate() const {
  return filter_.predicted(filter_.overall(), odometry_, odometry_.end());
}

HealthReport Mcl::health() const { return report_of(believed()); }

HealthReport Mcl::report_of(const PoseEstimate& here) const {
  return health_.report(filter_.best().probability, here, has_scan());
}

}  // namespace locfuse
