// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/mcl_recovery.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "particles/mcl_tuning.hpp"

namespace locfuse::internal {

void ParticleRecovery::propagate(const Pose2& motion_in_cells, RandomKeys& keys) {
  if (candidates_.size > 0) {
    move(candidates_, {motion_in_cells, Matrix<3, 3>::Zero()}, keys.next(), *recipe_->workers);
  }
}

void ParticleRecovery::update(const UsedScan& scan, const MapSharpness& sharpness,
                              ParticleFilter& filter, RandomKeys& keys) {
  if (recipe_->config.scouts == 0) {
    return;
  }
  std::vector<std::size_t> rejected = test_candidates(scan, sharpness, filter, keys);
  promote_winner(rejected, sharpness.sigma_hit(), filter, keys);
  if (!rejected.empty()) {
    const ParticleBelief fresh = draw_candidates(scan.points, static_cast<int>(rejected.size()),
                                                 sharpness.level(), filter, keys);
    for (std::size_t i = 0; i < rejected.size(); ++i) {
      candidates_.put(rejected[i], fresh, i);
      gain_[rejected[i]] = 0.0;
    }
  }
  if (scan.lost_track) {
    promote_candidates(0, recipe_->config.scouts, sharpness.sigma_hit(), filter, keys);
  }
}

/// Adds a scan to the evidence of each candidate; docs/models/particles.md eq. (2.3). Returns those
/// that fell behind, or have come to where the particle filter is.
std::vector<std::size_t> ParticleRecovery::test_candidates(const UsedScan& scan,
                                                           const MapSharpness& sharpness,
                                                           ParticleFilter& filter,
                                                           RandomKeys& keys) {
  const MclConfig& config = recipe_->config;
  const bool first = candidates_.size != config.scouts;
  if (first) {
    gain_.assign(static_cast<std::size_t>(config.scouts), RecoveryTuning::kMinGain);
    candidates_.resize(config.scouts);
  } else {
    hill_climb(scan.points, sharpness.field(), candidates_, filter, keys);
  }
  const Pose2 tracked = recipe_->to_cells(filter.best().estimate.pose);
  const std::vector<float>& log_likelihood = filter.likelihoods().log;
  std::vector<std::size_t> rejected;
  for (std::size_t k = 0; k < gain_.size(); ++k) {
    if (!first) {
      const double now = scan.share * (static_cast<double>(log_likelihood[k]) - scan.best);
      gain_[k] = RecoveryTuning::kGainMemory * gain_[k] +
                 std::min(std::max(now, -config.most_gain), config.most_gain);
    }
    const Vector<3> off = local(candidates_.pose(k), tracked);
    const bool is_tracked = off.head<2>().norm() < config.bin_m / recipe_->grid().resolution() &&
                            std::abs(off.z()) < 2.0 * kPi / config.bin_headings;
    if (is_tracked || gain_[k] <= RecoveryTuning::kMinGain) {
      rejected.push_back(k);
    }
  }
  return rejected;
}

/// Promotes the best candidate if its evidence outweighs that a kidnapping is unlikely; another one
/// takes its place.
void ParticleRecovery::promote_winner(std::vector<std::size_t>& rejected, double sigma_hit,
                                      ParticleFilter& filter, RandomKeys& keys) const {
  const auto best = std::max_element(gain_.begin(), gain_.end());
  const auto winner = static_cast<std::size_t>(best - gain_.begin());
  if (*best > -std::log(recipe_->config.kidnapping_probability) &&
      std::find(rejected.begin(), rejected.end(), winner) == rejected.end()) {
    promote_candidates(winner, 1, sigma_hit, filter, keys);
    rejected.push_back(winner);
  }
}

/// Gives half of the filter's weight to `count` candidates from `first` on.
void ParticleRecovery::promote_candidates(std::size_t first, int count, double sigma_hit,
                                          ParticleFilter& filter, RandomKeys& keys) const {
  const double cells = sigma_hit / recipe_->grid().resolution();
  const Vector<3> sigma(cells, cells, RecoveryTuning::kClimbTurnPerMetre * sigma_hit);
  const std::uint64_t key = keys.next();
  const auto draw = [&](ParticleBelief& belief, int k) {
    const Pose2 place = candidates_.pose(first + static_cast<std::size_t>(k % count));
    const Vector<3> normal = random_normal3(key, static_cast<std::uint64_t>(k));
    belief.put(static_cast<std::size_t>(k), retract(place, sigma.cwiseProduct(normal)));
  };
  filter.replace_half(count > 1 ? recipe_->config.max_particles : 0, draw, keys);
}

/// Candidates that fit the scan: of many poses in free space those that the widest field prefers,
/// climbing field by field down to the one in use.
ParticleBelief ParticleRecovery::draw_candidates(const EndPoints& points, int count,
                                                 std::size_t level, ParticleFilter& filter,
                                                 RandomKeys& keys) {
  ParticleBelief pool;
  const std::uint64_t key = keys.next();
  pool.resize(recipe_->config.scout_draws);
  recipe_->workers->share(pool.size, 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      recipe_->draw_free(pool, k, key);
    }
  });
  std::fill(pool.weight.begin(), pool.weight.begin() + pool.size, 1.0F);
  filter.likelihoods().evaluate(recipe_->fields.back(), points, pool, *recipe_->workers);
  reweigh(pool, filter.likelihoods().log, 1.0, count);
  resample(pool, count, {}, keys.next(), filter.scratch());
  for (std::size_t wider = recipe_->fields.size(); wider-- > level;) {
    hill_climb(points, recipe_->fields[wider], pool, filter, keys);
  }
  return pool;
}

/// Moves each particle of a pool to the best of some draws about it under one field, and leaves its
/// log likelihoods in the filter's memory.
void ParticleRecovery::hill_climb(const EndPoints& points, const LikelihoodField& field,
                                  ParticleBelief& pool, ParticleFilter& filter, RandomKeys& keys) {
  constexpr std::size_t kDraws = RecoveryTuning::kClimbDraws;
  const double cells = field.config().sigma_hit_m / recipe_->grid().resolution();
  const double turn = RecoveryTuning::kClimbTurnPerMetre * field.config().sigma_hit_m;
  tries_.resize(RecoveryTuning::kClimbDraws * pool.size);
  for (std::size_t k = 0; k < static_cast<std::size_t>(tries_.size); ++k) {
    tries_.put(k, pool, k / kDraws);
  }
  const Vector<3> sigma(cells, cells, turn);
  move(tries_, {{}, sigma.cwiseAbs2().asDiagonal()}, keys.next(), *recipe_->workers);
  ParticleLikelihoods& likelihoods = filter.likelihoods();
  likelihoods.evaluate(field, points, pool, *recipe_->workers);
  std::vector<float> best = likelihoods.log;
  likelihoods.evaluate(field, points, tries_, *recipe_->workers);
  for (std::size_t k = 0; k < static_cast<std::size_t>(tries_.size); ++k) {
    const std::size_t to = k / kDraws;
    if (likelihoods.log[k] > best[to]) {
      best[to] = likelihoods.log[k];
      pool.put(to, tries_, k);
    }
  }
  likelihoods.log = std::move(best);
}

}  // namespace locfuse::internal
