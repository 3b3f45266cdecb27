// SPDX-License-Identifier: Apache-2.0
// How far an Mcl's estimate may be trusted: what scans say to its Health.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "locfuse/estimators/mcl.hpp"
#include "locfuse/math/counter_random.hpp"

namespace locfuse {
namespace {

constexpr double kNear = 0.3;    // from the laser: what covers it is nearer [m]
constexpr double kStands = 1.0;  // after which a scan is news though nothing moved [s]
constexpr double kChosen = 0.9;  // probability of a cluster below which others fit, too
constexpr int kElsewhere = 2;    // poses from which a scan is explained by chance
constexpr std::uint64_t kKey = 0x6865616C7468ULL;  // of their draws, which no other shares

}  // namespace

/// What a scan says of a pose; shares by as many beams as weigh particles.
ScanEvidence Mcl::evidence_of(const LaserScan& z, const PoseEstimate& here) const {
  const Config& config = recipe_->config;
  const LaserGeometry& geometry = *z.geometry;
  // Sharp enough to tell places apart, wider than a cluster that is found.
  const LikelihoodField& field =
      recipe_->fields[std::min<std::size_t>(1, recipe_->fields.size() - 1)];
  const double per_cell = 1.0 / grid().resolution();
  std::array<Pose2, 1 + kElsewhere> eyes{to_cells(here.pose)};
  const std::uint64_t key = random_bits(config.seed ^ kKey, static_cast<std::uint64_t>(z.stamp));
  for (std::uint64_t k = 1; k < eyes.size(); ++k) {
    const auto cell = recipe_->free[static_cast<std::size_t>(
        random_uniform(key, 2 * k) * static_cast<double>(recipe_->free.size()))];
    const std::int32_t row = cell / grid().width();
    eyes[k] = {cell % grid().width() + 0.5, row + 0.5, 2.0 * kPi * random_uniform(key, 2 * k + 1)};
  }
  const Pose2 mount{geometry.pose_in_body.x * per_cell, geometry.pose_in_body.y * per_cell,
                    geometry.pose_in_body.heading};
  for (Pose2& eye : eyes) {
    eye = eye * mount;
  }
  const double longest = std::min(geometry.range_max, config.field.max_range_m);
  const std::size_t step = std::max<std::size_t>(
      z.ranges.size() / static_cast<std::size_t>(std::max(config.beams, 1)), 1);
  std::array<int, 1 + kElsewhere> explained{};
  double squares = 0.0;  // of ranges [m^2]
  int returns = 0;
  int covered = 0;
  for (std::size_t i = 0; i < z.ranges.size(); i += step) {
    const double range = z.ranges[i];
    if (!(range > 0.0 && range < longest)) {
      continue;
    }
    ++returns;
    squares += range * range;
    const bool is_near = range < std::max(kNear, geometry.range_min);
    const double angle = geometry.angle_min + static_cast<double>(i) * geometry.angle_increment;
    const Vector<2> end = range * per_cell * Vector<2>(std::cos(angle), std::sin(angle));
    for (std::size_t k = 0; k < eyes.size(); ++k) {
      const Vector<2> seen = eyes[k].act(end);
      const bool fits = field.explains(seen.x(), seen.y());
      if (k == 0 && is_near && (range < geometry.range_min || !fits)) {
        ++covered;
        break;
      }
      explained[k] += fits ? 1 : 0;
    }
  }
  ScanEvidence evidence;
  evidence.stamp = z.stamp;
  const auto clear = static_cast<double>(std::max(returns - covered, 1));
  evidence.explained = explained[0] / clear;
  for (std::size_t k = 1; k < eyes.size(); ++k) {
    evidence.by_chance += explained[k] / (clear * kElsewhere);
  }
  evidence.covered = returns > 0 ? static_cast<double>(covered) / returns : 0.0;
  // From a pose that is vaguely known a scan says little: its ends are as vague.
  const Matrix<3, 3>& P = here.covariance;
  const double vague = std::max(P(0, 0), P(1, 1)) + P(2, 2) * squares / std::max(returns, 1);
  const double reach = 1.25 * field.config().sigma_hit_m;
  evidence.news = reach * reach / (reach * reach + vague);
  evidence.independent = std::min(config.independent_beams, static_cast<double>(returns));
  return evidence;
}

/// Lets health hear a scan, as far as it is news.
void Mcl::tell(ScanEvidence evidence) {
  if (evidence.independent > 0.0) {
    const double waited = judged_ ? seconds_between(*judged_, evidence.stamp) / kStands : 1.0;
    evidence.news *= std::min(since_judged_ + std::max(waited, 0.0), 1.0);
    judged_ = evidence.stamp;
    since_judged_ = 0.0;
    health_.hear(evidence);
  }
}

/// A scan without what is right before the laser.
LaserScan Mcl::uncovered(LaserScan z) {
  for (double& range : z.ranges) {
    range = range < kNear ? std::numeric_limits<double>::quiet_NaN() : range;
  }
  return z;
}

/// What health knows of the likeliest cluster, and that the body may be in another.
HealthReport Mcl::health() const {
  const double chosen = std::min(hypotheses_.front().probability, 1.0);  // sums of floats
  HealthReport report;
  if (!is_found_) {
    report.stamp = std::max(stamp_, odometry_.end());
    if (scanned_ && chosen < kChosen) {
      report.state = HealthState::kAmbiguous;
      report.clue = HealthClue::kSeveralPlaces;
    }
    return report;
  }
  const Health::Config& config = recipe_->config.health;
  report = health_.report(estimate());
  report.wrong = 1.0 - (1.0 - report.wrong) * chosen;
  report.within *= chosen;
  if (!(report.wrong < 0.5 * config.risk)) {
    report.protection.setConstant(std::numeric_limits<double>::infinity());
  }
  if (report.state != HealthState::kLost && chosen < kChosen) {
    const bool is_lost = report.wrong > config.probability_lost;
    report.state = is_lost ? HealthState::kLost : HealthState::kAmbiguous;
    report.clue = HealthClue::kSeveralPlaces;
    report.source.reset();
  }
  return report;
}

}  // namespace locfuse
