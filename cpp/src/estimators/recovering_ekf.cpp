// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/recovering_ekf.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimators/outlier.hpp"
#include "estimators/recipe.hpp"

namespace locfuse {
namespace {

constexpr double kMore = 0.25;  // share of measurements that fit nothing more than expected

double gate_of(const PoseEkf::Config& config, const Range& /*z*/) { return config.gate_range; }
double gate_of(const PoseEkf::Config& config, const PositionFix& /*z*/) {
  return config.gate_position;
}
double gate_of(const PoseEkf::Config& config, const PoseObservation& /*z*/) {
  return config.gate_pose;
}
double gate_of(const PoseEkf::Config& config, const RangeBearing& /*z*/) {
  return config.gate_landmark;
}

double log_of(const char* name, double value) {
  if (!(std::isfinite(value) && value > 1.0)) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                                ", expected a finite number > 1");
  }
  return std::log(value);
}

}  // namespace

RecoveringEkf::RecoveringEkf(const Config& config, std::shared_ptr<const AnchorMap> anchors,
                             std::vector<Tag> tags, std::shared_ptr<const ScanMatcher> matcher,
                             LandmarkSight landmarks)
    : config_(config),
      limit_(log_of("measurements_per_false_alarm", config.measurements_per_false_alarm) +
             std::log(2.0)),  // two tests
      prototype_(config.start, config.estimator, std::move(anchors), std::move(tags),
                 std::move(matcher), std::move(landmarks)),
      start_(prototype_) {}

void RecoveringEkf::start_at(const PoseEstimate& start) {
  ekf_ = fresh().started_at(start);
  trust();
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
  if (ekf_) {
    validate(z);
  } else {
    start_.on(z);
    decide();
  }
  return {Verdict::kIgnored};
}

template <class M>
Outcome RecoveringEkf::drive(const M& u) {
  Outcome outcome{Verdict::kIgnored};
  if (ekf_) {
    outcome = ekf_->on(u);
  } else {
    start_.on(u);
  }
  control_ = u;
  return outcome;
}

template <class M>
Outcome RecoveringEkf::correct(const M& z) {
  if (!ekf_) {
    start_.on(z);
    decide();
    return {Verdict::kIgnored};
  }
  const Outcome outcome = ekf_->on(z);
  judge(outcome, internal::log_anything(z, config_.start.wrong_span_m),
        gate_of(config_.estimator, z));
  if (is_alarming()) {
    raise_alarm();
    start_.on(z);
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
      judge(outcomes[i], internal::log_anything(sightings[i], config_.start.wrong_span_m),
            config_.estimator.gate_landmark);
    }
    if (!is_alarming()) {
      return outcomes;
    }
    raise_alarm();
  }
  for (const RangeBearing& z : sightings) {
    start_.on(z);
  }
  decide();
  return outcomes;
}

/// Eq. (3) and (4) of docs/start.md. What no landmark was found for has no likelihood.
void RecoveringEkf::judge(const Outcome& outcome, double log_anything, double gate) {
  const double wrong = config_.start.wrong_share;
  const bool is_gated = outcome.verdict == Verdict::kGated;
  if (outcome.dof > 0) {
    const double fits = internal::log_density(outcome, wrong, log_anything);
    evidence_ = std::max(0.0, evidence_ + log_anything - fits);
  } else if (is_gated) {
    evidence_ -= std::log(wrong);
  }
  if (is_gated || outcome.dof > 0) {
    const double expected = 1.0 - (1.0 - wrong) * gate;  // share that passes no gate
    const double many = expected + kMore * (1.0 - expected);
    unexplained_ += is_gated ? std::log(many / expected) : std::log1p(-kMore);
    unexplained_ = std::max(0.0, unexplained_);
  }
}

void RecoveringEkf::trust() {
  evidence_ = 0.0;
  unexplained_ = 0.0;
}

void RecoveringEkf::raise_alarm() {
  ekf_.reset();
  ++alarms_;
  start_ = fresh();
}

Initializer RecoveringEkf::fresh() const {
  Initializer anew = prototype_;
  if (control_) {
    anew.on(*control_);
  }
  return anew;
}

void RecoveringEkf::decide() {
  const Initializer::State now = start_.state();
  if (now.status == StartStatus::kReady) {
    ekf_ = start_.started_at(now.hypotheses.front().estimate);
    trust();
  }
}

Initializer::State RecoveringEkf::state() const {
  if (!ekf_) {
    return start_.state();
  }
  return {StartStatus::kReady, {}, {{ekf_->estimate(), 1.0}}};
}

}  // namespace locfuse
