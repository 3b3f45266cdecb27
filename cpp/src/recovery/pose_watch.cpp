// SPDX-License-Identifier: Apache-2.0
#include "locfuse/recovery/pose_watch.hpp"

#include <algorithm>
#include <cmath>

#include "estimators/innovation.hpp"
#include "estimators/recipe.hpp"
#include "recovery/health_tuning.hpp"
#include "recovery/within.hpp"

namespace locfuse {
namespace {

/// Constants that are not settings; table "Constants" of docs/watch.md.
struct WatchTuning {
  static constexpr double kSureWithin = 0.9;           ///< least probability `within` of kOk
  static constexpr double kVagueWithin = 0.5;          ///< least of an estimate that can judge
  static constexpr double kExcessWeight = 1.0 / 16.0;  ///< of a pose in the mean NIS per row
  static constexpr double kMaxExcess = 4.0;            ///< of that mean, for kOk
  static constexpr double kMovedOn = 1.0;     ///< [m], [rad]: without a pose since it is silent
  static constexpr double kReferenceS = 5.0;  ///< age at which another pose becomes the reference
  static constexpr double kDoubtedS = 20.0;   ///< the same while poses are lost: a jump that stays
  static constexpr double kConfidence = 0.999;  ///< of an offset, and of a jump
};

/// Probability that what is off by `offset` is within the limits, if the estimate is right; eq.
/// (2).
double within(double limit, const Vector<3>& offset, const Matrix<3, 3>& P) {
  return internal::probability_within(limit, offset.head<2>(), P.topLeftCorner<2, 2>()) *
         internal::probability_within(PoseWatch::kMaxHeadingError, offset(2), P(2, 2));
}

/// Whether measurements speak against an estimate.
bool contradicts(const HealthReport& health) {
  return health.state == HealthState::kLost && health.reason != HealthReason::kSilence;
}

}  // namespace

PoseWatch::PoseWatch(const Config& config)
    : health_(config.health),
      model_(config.pose),
      gate_(WatchTuning::kConfidence),
      motion_(config.odometry),
      limits_(config.limits),
      hold_(internal::hold_of(config)),
      aiding_lost_(internal::stamps_of("aiding_lost_s", config.health.aiding_lost_s)) {
  (void)Health(health_);  // checks
}

void PoseWatch::on(const Velocity& u) {
  advance(u.stamp);
  odometry_.take(u);
}

void PoseWatch::on(const Increment& u) {
  advance(u.begin);
  if (u.begin == u.stamp) {  // a displacement without duration
    for (std::optional<Carried>* one : {&newest_, &reference_}) {
      if (*one) {
        drive(**one, u.motion, 0.0, u.variance);
      }
    }
  }
  odometry_.take(u, limits_);
}

Outcome PoseWatch::on(const PoseObservation& z, const PoseEstimate& estimate,
                      const HealthReport& health) {
  if (z.stamp < stamp_) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  advance(z.stamp);
  newest_ = Carried{z};
  newest_->is_blind = !odometry_.is_received();
  newest_->pose.pose.heading = wrap_angle(z.pose.heading);
  Outcome outcome = internal::compare(model_, estimate, newest_->pose);
  outcome.verdict = Verdict::kIgnored;
  outcome.reason = Reason::kWatched;
  if (!reference_) {
    reference_ = newest_;
  }
  const WatchReport now = judge(estimate, health);
  parted_ = contradicts(health) && (parted_ || now.reason != WatchReason::kContradicted);
  const bool is_lost = now.state == HealthState::kLost;
  if (outcome.dof > 0 && !is_lost && now.reason != WatchReason::kUnverified) {
    const double ratio = std::min(outcome.nis / outcome.dof, internal::HealthTuning::kMaxMeanNis);
    excess_ += WatchTuning::kExcessWeight * (ratio - excess_);
  }
  doubted_since_ = is_lost ? std::optional(doubted_since_.value_or(z.stamp)) : std::nullopt;
  const Stamp since = doubted_since_.value_or(reference_->pose.stamp);
  if (seconds_between(since, z.stamp) >
      (is_lost ? WatchTuning::kDoubtedS : WatchTuning::kReferenceS)) {
    reference_ = newest_;
    doubted_since_.reset();
  }
  return outcome;
}

void PoseWatch::advance(Stamp stamp) {
  if (newest_ && stamp > stamp_) {
    Stamp at = stamp_;
    odometry_.advance(
        stamp_, stamp, hold_,
        [&](const Pose2& motion, Stamp until, const std::optional<Vector<3>>& variance) {
          const double seconds = seconds_between(at, until);
          drive(*newest_, motion, seconds, variance);
          drive(*reference_, motion, seconds, variance);
          at = until;
        },
        [&](Stamp /*until*/) { newest_->is_blind = reference_->is_blind = true; });
  }
  stamp_ = std::max(stamp_, stamp);
}

void PoseWatch::drive(Carried& pose, const Pose2& motion, double seconds,
                      const std::optional<Vector<3>>& variance) const {
  motion_.append(pose.since, motion, seconds, variance);
  const Pose2& moved = pose.since.motion;
  pose.has_moved_on = pose.has_moved_on || moved.position().norm() > WatchTuning::kMovedOn ||
                      std::abs(moved.heading) > WatchTuning::kMovedOn;
}

WatchReport PoseWatch::report(const PoseEstimate& estimate, const HealthReport& health) const {
  PoseWatch now = *this;
  now.advance(estimate.stamp);
  return now.judge(estimate, health);
}

/// Eq. (1) to (4) of docs/watch.md.
WatchReport PoseWatch::judge(const PoseEstimate& estimate, const HealthReport& health) const {
  WatchReport report;
  report.stamp = std::max(estimate.stamp, stamp_);
  if (!newest_) {
    report.reason = WatchReason::kNoPose;
    return report;
  }
  report.judged = newest_->pose.stamp;
  report.error = local(newest_->now(), estimate.pose);
  report.protection = report.error.cwiseAbs() + health.protection;
  const Matrix<3, 3> P = health.inflation * estimate.covariance;
  const double fits = within(health_.limit_m, report.error, P);
  const double at_best = within(health_.limit_m, Vector<3>::Zero(), P);
  report.within = (1.0 - health.wrong) * fits;
  report.wrong = 1.0 - report.within;

  const bool is_elsewhere = fits < (1.0 - health_.probability_lost) * at_best &&
                            squared_mahalanobis(report.error, P) > gate_.limit(3);
  const bool is_silent = health.reason == HealthReason::kSilence;  // nothing but odometry
  const bool is_lost = contradicts(health);
  const bool is_vague = is_silent || at_best < WatchTuning::kVagueWithin;
  const auto say = [&](HealthState state, WatchReason reason) {
    report.state = state;
    report.reason = reason;
  };
  if (is_lost && !is_elsewhere && !parted_) {
    say(HealthState::kLost, WatchReason::kContradicted);
  } else if (is_elsewhere && !is_lost && !is_silent) {
    say(HealthState::kLost, WatchReason::kFarOff);
  } else if (is_vague && !is_lost && !agrees_with_reference(*newest_)) {
    say(HealthState::kLost, WatchReason::kJumped);
  } else if (is_vague || is_lost || (1.0 - health.wrong) * at_best < WatchTuning::kSureWithin) {
    say(HealthState::kDegraded, WatchReason::kUnverified);
  } else if (report.within < WatchTuning::kSureWithin) {
    say(HealthState::kDegraded, WatchReason::kFarOff);
  } else if (excess_ > WatchTuning::kMaxExcess) {
    say(HealthState::kDegraded, WatchReason::kSigmasTooSmall);
  } else {
    say(HealthState::kOk, WatchReason::kNone);
  }
  if (report.state != HealthState::kLost && newest_->has_moved_on &&
      report.stamp - newest_->pose.stamp > aiding_lost_) {
    say(HealthState::kDeadReckoning, WatchReason::kSilent);
  }
  return report;
}

/// Whether a pose is where odometry has carried the reference: within the limits, or by chance.
bool PoseWatch::agrees_with_reference(const Carried& pose) const {
  if (reference_->is_blind) {
    return true;
  }
  const Pose2 before = reference_->now();
  const Vector<3> off = local(pose.now(), before);
  if (off.head<2>().norm() <= health_.limit_m && std::abs(off(2)) <= kMaxHeadingError) {
    return true;
  }
  PoseObservation now = pose.pose;
  now.pose = pose.now();
  auto lin = model_.linearize(before, now);
  if (!lin) {
    return false;
  }
  lin->noise *= 2.0;  // that of both poses
  const Matrix<3, 3> by_odometry =
      covariance_after(reference_->pose.pose, Matrix<3, 3>::Zero(), reference_->since.motion,
                       reference_->since.covariance);
  const Outcome outcome = internal::compare(*lin, by_odometry);
  return outcome.nis <= gate_.limit(outcome.dof);
}

}  // namespace locfuse
