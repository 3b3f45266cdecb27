// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/recovering_ekf.hpp"

#include <stdexcept>
#include <utility>

#include "estimators/recipe.hpp"

namespace locfuse {
namespace {

template <class Recipe>
const Gate& gate_of(const Recipe& recipe, const Range& /*z*/) {
  return recipe.range_gate;
}
template <class Recipe>
const Gate& gate_of(const Recipe& recipe, const PositionFix& /*z*/) {
  return recipe.position_gate;
}
template <class Recipe>
const Gate& gate_of(const Recipe& recipe, const PoseObservation& /*z*/) {
  return recipe.pose_gate;
}
template <class Recipe>
const Gate& gate_of(const Recipe& recipe, const RangeBearing& /*z*/) {
  return recipe.landmark_gate;
}

}  // namespace

RecoveringEkf::RecoveringEkf(const Config& config, std::shared_ptr<const AnchorMap> anchors,
                             std::vector<Tag> tags, std::shared_ptr<const ScanMatcher> matcher,
                             LandmarkSensor landmarks)
    : recipe_(std::make_shared<const Recipe>(
          Recipe{config, Gate(config.estimator.gate_range), Gate(config.estimator.gate_position),
                 Gate(config.estimator.gate_pose), Gate(config.estimator.gate_landmark),
                 Initializer(config.start, config.estimator, std::move(anchors), std::move(tags),
                             std::move(matcher), std::move(landmarks))})),
      start_(recipe_->fresh),
      health_(config.health) {}

void RecoveringEkf::start_at(const PoseEstimate& start) { start_with(fresh().started_at(start)); }

Initializer RecoveringEkf::fresh() const {
  Initializer anew = recipe_->fresh;
  if (control_) {
    anew.on(*control_);
  }
  return anew;
}

RecoveringEkf RecoveringEkf::restarted(const PoseEstimate& start) const {
  RecoveringEkf other = *this;
  other.start_with(started().restarted(start));
  other.control_.reset();
  return other;
}

const PoseEkf& RecoveringEkf::started() const {
  if (!ekf_) {
    throw std::logic_error("the RecoveringEkf has not started; call start_at before");
  }
  return *ekf_;
}

Outcome RecoveringEkf::on(const Velocity& u) { return drive(u); }
Outcome RecoveringEkf::on(const Increment& u) { return drive(u); }
Outcome RecoveringEkf::on(const Range& z) { return correct(z); }
Outcome RecoveringEkf::on(const PositionFix& z) { return correct(z); }
Outcome RecoveringEkf::on(const PoseObservation& z) { return correct(z); }
Outcome RecoveringEkf::on(const RangeBearing& z) { return correct(z); }

Outcome RecoveringEkf::on(const Message& message) {
  return std::visit([this](const auto& m) { return on(m); }, message);
}

Outcome RecoveringEkf::on(const LaserScan& z) {
  validate(z);
  if (search([&](Initializer& start) { start.on(z); })) {
    decide();
  }
  return {Verdict::kIgnored};
}

template <class M>
Outcome RecoveringEkf::drive(const M& u) {
  Outcome outcome{Verdict::kIgnored};
  if (ekf_) {
    outcome = ekf_->on(u);
    health_.advance(ekf_->belief().stamp);
    listen();
  }
  (void)search([&](Initializer& start) { start.on(u); });
  control_ = u;
  return outcome;
}

template <class M>
Outcome RecoveringEkf::fuse(const M& z) {
  if constexpr (std::is_same_v<M, Range>) {
    if (health_.is_excluded(named_source_of(z))) {
      return ekf_->weigh(z);
    }
  }
  return ekf_->on(z);
}

template <class M>
Outcome RecoveringEkf::correct(const M& z) {
  Outcome outcome{Verdict::kIgnored};
  if (ekf_) {
    outcome = fuse(z);
    record(z, outcome);
    listen();
  }
  if (outcome.verdict != Verdict::kStale && search([&](Initializer& start) { start.on(z); })) {
    decide();
  }
  return outcome;
}

std::vector<Outcome> RecoveringEkf::on_joint(const std::vector<RangeBearing>& sightings,
                                             Association association) {
  internal::validate_together("sightings of one instant", sightings);
  std::vector<Outcome> outcomes(sightings.size(), Outcome{Verdict::kIgnored});
  if (ekf_) {
    outcomes = ekf_->on_joint(sightings, association);
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      record(sightings[i], outcomes[i]);
    }
    listen();
  }
  const bool searches = search([&](Initializer& start) {
    Initializer fed = start;
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      if (outcomes[i].verdict != Verdict::kStale) {
        fed.on(sightings[i]);
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
    if (!ekf_) {
      throw;
    }
    start_ = fresh();
    return false;
  }
}

template <class M>
void RecoveringEkf::record(const M& z, const Outcome& outcome) {
  health_.record(named_source_of(z), z.stamp, outcome,
                 outcome.dof > 0 ? gate_of(*recipe_, z).limit(outcome.dof) : 1.0,
                 health_.outlier_volume(z));
}

/// Lost, another start begins; found again without it, it ends.
void RecoveringEkf::listen() {
  const bool was_lost = std::exchange(was_lost_, health_.is_lost());
  if (was_lost_ && !was_lost) {
    ++alarms_;
    if (recipe_->config.restart) {
      start_ = fresh();
    }
  } else if (!was_lost_) {
    start_.reset();
  }
}

/// Of a place that no filter can start from the search has nothing: another one begins.
void RecoveringEkf::decide() {
  const Initializer::State now = start_->state();
  if (now.status != StartStatus::kReady) {
    return;
  }
  try {
    PoseEkf found = start_->started_at(now.hypotheses.front().estimate);
    restarts_ += ekf_ ? 1 : 0;
    start_with(std::move(found));
    health_.start(ekf_->current().stamp, 1.0 - recipe_->config.start.probability_ready);
  } catch (const std::exception&) {
    start_ = fresh();
  }
}

void RecoveringEkf::start_with(PoseEkf ekf) {
  ekf_ = std::move(ekf);
  health_.start(ekf_->current().stamp);
  start_.reset();
  was_lost_ = false;
}

Initializer::State RecoveringEkf::state() const {
  if (start_) {
    return start_->state();
  }
  return {StartStatus::kReady, {}, {{ekf_->estimate(), 1.0}}};
}

HealthReport RecoveringEkf::health() const {
  if (ekf_) {
    return health_.report(ekf_->current());
  }
  HealthReport report;
  if (start_->state().status == StartStatus::kAmbiguous) {
    report.state = HealthState::kAmbiguous;
    report.reason = HealthReason::kSeveralPlaces;
  }
  return report;
}

}  // namespace locfuse
