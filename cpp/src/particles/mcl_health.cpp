// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/mcl_health.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "locfuse/filters/gate.hpp"
#include "locfuse/math/counter_random.hpp"
#include "particles/mcl_tuning.hpp"

namespace locfuse::internal {
namespace {

const Gate kAcceptanceGate(MclHealthTuning::kGateConfidence);

/// Poses of the laser in cells at which a scan is evaluated: that of the estimate, then random
/// ones in free space, which show what fits by chance.
std::array<Pose2, 1 + MclHealthTuning::kChancePoses> laser_poses(const MclRecipe& recipe,
                                                                 const LaserScan& z,
                                                                 const Pose2& here) {
  const double per_cell = 1.0 / recipe.grid().resolution();
  std::array<Pose2, 1 + MclHealthTuning::kChancePoses> poses{recipe.to_cells(here)};
  const std::uint64_t key = random_bits(recipe.config.seed ^ MclHealthTuning::kChanceKey,
                                        static_cast<std::uint64_t>(z.stamp));
  for (std::uint64_t k = 1; k < poses.size(); ++k) {
    const Vector<2> corner = recipe.free_cell(random_uniform(key, 2 * k));
    poses[k] = {corner.x() + 0.5, corner.y() + 0.5, 2.0 * kPi * random_uniform(key, 2 * k + 1)};
  }
  const Pose2& mount = z.geometry->pose_in_body;
  const Pose2 mount_in_cells{mount.x * per_cell, mount.y * per_cell, mount.heading};
  for (Pose2& pose : poses) {
    pose = pose * mount_in_cells;
  }
  return poses;
}

/// Counts of a scan's returns.
struct Counts {
  std::array<int, 1 + MclHealthTuning::kChancePoses> explained{};  // by a wall, per pose
  int returns = 0;
  int covered = 0;
  double squares = 0.0;  // sum of squared ranges [m^2]
};

/// Counts as many returns as weigh particles.
Counts count_returns(const MclRecipe& recipe, const LikelihoodField& field, const LaserScan& z,
                     const Pose2& here) {
  const MclConfig& config = recipe.config;
  const LaserGeometry& geometry = *z.geometry;
  const double per_cell = 1.0 / recipe.grid().resolution();
  const auto poses = laser_poses(recipe, z, here);
  const double max_range = std::min(geometry.range_max, config.field.max_range_m);
  const std::size_t step = std::max<std::size_t>(
      z.ranges.size() / static_cast<std::size_t>(std::max(config.beams, 1)), 1);
  Counts counts;
  for (std::size_t i = 0; i < z.ranges.size(); i += step) {
    const double range = z.ranges[i];
    if (!(range > 0.0 && range < max_range)) {
      continue;
    }
    ++counts.returns;
    counts.squares += range * range;
    const bool is_near = range < std::max(MclHealthTuning::kCoverDistance, geometry.range_min);
    const double angle = geometry.angle_min + static_cast<double>(i) * geometry.angle_increment;
    const Vector<2> end = range * per_cell * Vector<2>(std::cos(angle), std::sin(angle));
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const Vector<2> seen = poses[k].act(end);
      const bool fits = field.explains(seen.x(), seen.y());
      if (k == 0 && is_near && (range < geometry.range_min || !fits)) {
        ++counts.covered;
        break;
      }
      counts.explained[k] += fits ? 1 : 0;
    }
  }
  return counts;
}

}  // namespace

void MclHealth::start(Stamp stamp, double wrong) {
  is_active_ = true;
  health_.start(stamp, wrong);
}

void MclHealth::restart(Stamp stamp, bool is_active) {
  is_active_ = is_active;
  health_.start(stamp);
}

void MclHealth::add_motion(const Pose2& motion) {
  const MclConfig& config = recipe_->config;
  const double spacings =
      motion.position().norm() / std::max(config.spacing_m, MclHealthTuning::kMinScanSpacing) +
      std::abs(motion.heading) /
          std::max(config.spacing_heading_rad, MclHealthTuning::kMinScanSpacing);
  since_scan_.for_each([&](SinceScan& since) { since.travelled += spacings; });
}

ScanEvidence MclHealth::evidence_of(const LaserScan& z, const PoseEstimate& here) const {
  // The second narrowest field: sharp enough to separate places, wider than a tracked cluster.
  const LikelihoodField& field =
      recipe_->fields[std::min<std::size_t>(1, recipe_->fields.size() - 1)];
  const Counts counts = count_returns(*recipe_, field, z, here.pose);
  ScanEvidence evidence;
  evidence.stamp = z.stamp;
  const auto clear = static_cast<double>(std::max(counts.returns - counts.covered, 1));
  evidence.explained = counts.explained[0] / clear;
  for (std::size_t k = 1; k < counts.explained.size(); ++k) {
    evidence.by_chance += counts.explained[k] / (clear * MclHealthTuning::kChancePoses);
  }
  evidence.covered =
      counts.returns > 0 ? static_cast<double>(counts.covered) / counts.returns : 0.0;
  // Where the pose is uncertain its end points are as well, and the scan says little.
  const Matrix<3, 3>& P = here.covariance;
  const double variance =
      std::max(P(0, 0), P(1, 1)) + P(2, 2) * counts.squares / std::max(counts.returns, 1);
  const double reach = 1.25 * field.config().sigma_hit_m;
  evidence.novelty = reach * reach / (reach * reach + variance);
  evidence.independent =
      std::min(recipe_->config.independent_beams, static_cast<double>(counts.returns));
  return evidence;
}

void MclHealth::report_scan(const LaserScan& z, ScanEvidence evidence) {
  if (evidence.independent > 0.0) {
    if (const SinceScan* since = since_scan_.find(z)) {
      const double waited =
          seconds_between(since->stamp, evidence.stamp) / MclHealthTuning::kStationaryPeriod;
      evidence.novelty *= std::min(since->travelled + std::max(waited, 0.0), 1.0);
    }
    since_scan_.set(z, {evidence.stamp});
    health_.record(evidence);
  }
}

std::optional<LaserScan> MclHealth::without_cover(const LaserScan& z,
                                                  const ScanEvidence& evidence) {
  if (!(evidence.covered > MclHealthTuning::kRemovedCover)) {
    return std::nullopt;
  }
  LaserScan clear = z;
  for (double& range : clear.ranges) {
    range =
        range < MclHealthTuning::kCoverDistance ? std::numeric_limits<double>::quiet_NaN() : range;
  }
  return clear;
}

template <class Message>
void MclHealth::record(const Message& z, Outcome outcome) {
  if (is_active_) {
    const double limit = kAcceptanceGate.limit(outcome.dof);
    outcome.verdict = outcome.nis > limit ? Verdict::kGated : Verdict::kFused;
    health_.record(named_source_of(z), z.stamp, outcome, limit, health_.outlier_volume(z));
  }
}
template void MclHealth::record(const Range& z, Outcome outcome);
template void MclHealth::record(const PositionFix& z, Outcome outcome);
template void MclHealth::record(const PoseObservation& z, Outcome outcome);
template void MclHealth::record(const RangeBearing& z, Outcome outcome);

HealthReport MclHealth::report(double probability, const PoseEstimate& estimate,
                               bool has_scan) const {
  const double chosen = std::min(probability, 1.0);  // a sum of floats may exceed 1
  HealthReport report;
  if (!is_active_) {
    report.stamp = estimate.stamp;
    if (has_scan && chosen < MclHealthTuning::kMinProbabilityChosen) {
      report.state = HealthState::kAmbiguous;
      report.reason = HealthReason::kSeveralPlaces;
    }
    return report;
  }
  const Health::Config& config = recipe_->config.health;
  report = health_.report(estimate);
  report.wrong = 1.0 - (1.0 - report.wrong) * chosen;
  report.within *= chosen;
  if (!(report.wrong < 0.5 * config.risk)) {
    report.protection.setConstant(std::numeric_limits<double>::infinity());
  }
  if (report.state != HealthState::kLost && chosen < MclHealthTuning::kMinProbabilityChosen) {
    const bool is_lost = report.wrong > config.probability_lost;
    report.state = is_lost ? HealthState::kLost : HealthState::kAmbiguous;
    report.reason = HealthReason::kSeveralPlaces;
    report.source.reset();
  }
  return report;
}

}  // namespace locfuse::internal
