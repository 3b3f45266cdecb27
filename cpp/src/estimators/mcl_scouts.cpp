// SPDX-License-Identifier: Apache-2.0
// How an Mcl finds the body again: scouts that gather evidence against the belief.
#include <algorithm>
#include <cmath>
#include <utility>

#include "locfuse/estimators/mcl.hpp"
#include "locfuse/math/counter_random.hpp"

namespace locfuse {
namespace {

constexpr double kBehind = 4.0;    // nats behind the belief at which a scout gives up
constexpr double kMemory = 0.98;   // of its gains, per scan
constexpr int kTries = 16;         // of a scout, per field
constexpr double kPerMetre = 0.5;  // turn tried with a displacement [rad / m]

}  // namespace

/// Moves each particle of a pool to the best of some tries about it, by one field; its likelihoods
/// are left in `log_likelihood_`.
void Mcl::climb(const EndPoints& points, const LikelihoodField& field, ParticleBelief& pool) {
  const double cells = field.config().sigma_hit_m / grid().resolution();
  const double turn = kPerMetre * field.config().sigma_hit_m;
  tries_.resize(kTries * pool.size);
  for (std::size_t k = 0; k < static_cast<std::size_t>(tries_.size); ++k) {
    tries_.put(k, pool, k / kTries);
  }
  const Vector<3> sigma(cells, cells, turn);
  move(tries_, {{}, sigma.cwiseAbs2().asDiagonal()}, next_key(), *recipe_->workers);
  fit(field, points, pool);
  std::vector<float> best = log_likelihood_;
  fit(field, points, tries_);
  for (std::size_t k = 0; k < static_cast<std::size_t>(tries_.size); ++k) {
    const std::size_t to = k / kTries;
    if (log_likelihood_[k] > best[to]) {
      best[to] = log_likelihood_[k];
      pool.put(to, tries_, k);
    }
  }
  log_likelihood_ = std::move(best);
}

/// Places that fit the scan: of many draws from the free cells those that the widest field likes,
/// moved to the best nearby, field by field, down to the one in use.
ParticleBelief Mcl::places_that_fit(const EndPoints& points, int count) {
  ParticleBelief pool;
  const std::uint64_t key = next_key();
  pool.resize(recipe_->config.scout_draws);
  recipe_->workers->share(pool.size, 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      draw_free(pool, k, key);
    }
  });
  std::fill(pool.weight.begin(), pool.weight.begin() + pool.size, 1.0F);
  fit(recipe_->fields.back(), points, pool);
  reweigh(pool, log_likelihood_, 1.0, count);
  resample(pool, count, {}, next_key(), scratch_);
  for (std::size_t level = recipe_->fields.size(); level-- > level_;) {
    climb(points, recipe_->fields[level], pool);
  }
  return pool;
}

/// While the body is not found, lets scouts, each in a place of its own, gather evidence against
/// the belief scan by scan: the best that it has against the best that they have. Who gathers more
/// than a kidnapping is unlikely becomes half of the belief; who falls behind, or has come to where
/// the belief is, begins anew.
void Mcl::challenge(const EndPoints& points, double share, double best, bool just_lost) {
  const Config& config = recipe_->config;
  if (tracking_ || config.scouts == 0) {
    scouts_.size = 0;
    return;
  }
  const bool first = scouts_.size != config.scouts;
  if (first) {
    gain_.assign(static_cast<std::size_t>(config.scouts), -kBehind);
    scouts_.resize(config.scouts);
  } else {
    climb(points, recipe_->fields[level_], scouts_);
  }
  const Pose2 found = to_cells(hypotheses_.front().estimate.pose);
  std::vector<std::size_t> idle;
  for (std::size_t k = 0; k < gain_.size(); ++k) {
    if (!first) {
      const double now = share * (static_cast<double>(log_likelihood_[k]) - best);
      gain_[k] = kMemory * gain_[k] + std::min(std::max(now, -config.most_gain), config.most_gain);
    }
    const Vector<3> off = local(scouts_.pose(k), found);
    const bool there = off.head<2>().norm() < config.bin_m / grid().resolution() &&
                       std::abs(off.z()) < 2.0 * kPi / config.bin_headings;
    if (there || gain_[k] <= -kBehind) {
      idle.push_back(k);
    }
  }
  const auto winner = std::max_element(gain_.begin(), gain_.end());
  const auto who = static_cast<std::size_t>(winner - gain_.begin());
  if (*winner > -std::log(config.kidnapping_probability) &&
      std::find(idle.begin(), idle.end(), who) == idle.end()) {
    admit(who, 1);
    idle.push_back(who);
  }
  if (!idle.empty()) {
    const ParticleBelief places = places_that_fit(points, static_cast<int>(idle.size()));
    for (std::size_t i = 0; i < idle.size(); ++i) {
      scouts_.put(idle[i], places, i);
      gain_[idle[i]] = 0.0;
    }
  }
  if (just_lost) {
    admit(0, config.scouts);
  }
}

/// Gives half of the weight to the places that scouts have found, from `first` on.
void Mcl::admit(std::size_t first, int scouts) {
  const double cells = sigma_hit() / grid().resolution();
  const Vector<3> sigma(cells, cells, kPerMetre * sigma_hit());
  const std::uint64_t key = next_key();
  const int count = scouts > 1 ? recipe_->config.max_particles : std::max(target_, 2);
  resample(belief_, count,
           {count / 2, 0.5,
            [&](ParticleBelief& belief, int k) {
              const Pose2 place = scouts_.pose(first + static_cast<std::size_t>(k % scouts));
              const Vector<3> normal = random_normal3(key, static_cast<std::uint64_t>(k));
              belief.put(static_cast<std::size_t>(k), retract(place, sigma.cwiseProduct(normal)));
            }},
           next_key(), scratch_);
  summarize();
}

}  // namespace locfuse
