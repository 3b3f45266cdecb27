// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/mcl_particle_filter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "particles/mcl_tuning.hpp"

namespace locfuse::internal {
namespace {

PoseEstimate carried(const PoseEstimate& from, const UncertainMotion& by, Stamp stamp) {
  PoseEstimate to{stamp, from.pose * by.motion,
                  covariance_after(from.pose, from.covariance, by.motion, by.covariance)};
  // A way back subtracts what the way there added; the rounding error of both remains.
  const double summed = from.covariance.topLeftCorner<2, 2>().trace() +
                        to.covariance.topLeftCorner<2, 2>().trace() +
                        by.motion.position().squaredNorm() * from.covariance(2, 2);
  to.covariance.diagonal().head<2>().array() += ParticleFilterTuning::kVarianceRounding * summed;
  return to;
}

}  // namespace

void ParticleLikelihoods::evaluate(const LikelihoodField& field, const EndPoints& points,
                                   const ParticleBelief& belief, Workers& workers) {
  costs.resize(belief.x.size());
  log.resize(belief.x.size());
  const auto unit = static_cast<float>(field.unit());
  workers.share(static_cast<int>(belief.x.size()), kFieldGroup, [&](int begin, int end) {
    field.costs(points, belief.x.data(), belief.y.data(), belief.c.data(), belief.s.data(), begin,
                end, costs.data());
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      log[k] = -unit * static_cast<float>(costs[k]);
    }
  });
}

/// Leaves particles of equal weight whose poses are yet to be set.
void ParticleFilter::reset(Stamp stamp, int particles) {
  check_stamp(stamp);
  belief_.resize(particles);
  belief_.stamp = stamp_ = stamp;
  std::fill(belief_.weight.begin(), belief_.weight.begin() + particles,
            1.0F / static_cast<float>(particles));
  pending_ = {};
  added_variance_.setZero();
  used_share_ = 0.0;
  target_ = recipe_->config.max_particles;
}

void ParticleFilter::start_anywhere(Stamp stamp, RandomKeys& keys) {
  const int max_particles = recipe_->config.max_particles;
  reset(stamp,
        max_particles < ParticleFilterTuning::kMaxGlobalDraws / ParticleFilterTuning::kGlobalDraws
            ? ParticleFilterTuning::kGlobalDraws * max_particles
            : std::max(max_particles, ParticleFilterTuning::kMaxGlobalDraws));
  const std::uint64_t key = keys.next();
  // Boxes of side a, and of turn_per_cell a in the heading, fill free space and all headings.
  belief_.turn_per_cell = ParticleFilterTuning::kBoxTurnPerMetre * recipe_->grid().resolution();
  const double space = 2.0 * kPi * static_cast<double>(recipe_->free.size()) / belief_.size;
  const auto box = static_cast<float>(std::cbrt(space / belief_.turn_per_cell));
  recipe_->workers->share(belief_.size, 1, [&](int from, int to) {
    for (int k = from; k < to; ++k) {
      recipe_->draw_free(belief_, k, key);
      belief_.box[static_cast<std::size_t>(k)] = box;
    }
  });
  cluster();
}

void ParticleFilter::start_at(const std::vector<PoseHypothesis>& hypotheses, RandomKeys& keys) {
  double total = 0.0;
  for (const PoseHypothesis& h : hypotheses) {
    total += h.probability;
  }
  reset(hypotheses.front().estimate.stamp, recipe_->config.max_particles);
  keys.skip();  // golden runs were drawn with this key left out
  const std::uint64_t key = keys.next();
  int k = 0;
  double passed = 0.0;
  for (const PoseHypothesis& h : hypotheses) {
    passed += h.probability / total;
    const auto share = static_cast<int>(std::ceil(passed * belief_.size + 1e-9 - 0.5));
    const int end = std::clamp(share, k, belief_.size);
    draw_near(k, end, h.estimate, key);
    k = end;
  }
  cluster();
}

void ParticleFilter::start_with(Stamp stamp, const Matrix<4, Eigen::Dynamic>& particles,
                                double total, RandomKeys& keys) {
  reset(stamp, static_cast<int>(particles.cols()));
  keys.skip();
  for (int k = 0; k < belief_.size; ++k) {
    const Pose2 world{particles(0, k), particles(1, k), wrap_angle(particles(2, k))};
    belief_.put(static_cast<std::size_t>(k), recipe_->to_cells(world));
    belief_.weight[static_cast<std::size_t>(k)] = static_cast<float>(particles(3, k) / total);
  }
  cluster();
}

/// Particles begin to end - 1 become draws from a pose.
void ParticleFilter::draw_near(int begin, int end, const PoseEstimate& pose, std::uint64_t key) {
  const Matrix<3, 3> L = pose.covariance.llt().matrixL();
  for (int k = begin; k < end; ++k) {
    const Pose2 drawn = retract(pose.pose, L * random_normal3(key, static_cast<std::uint64_t>(k)));
    belief_.put(static_cast<std::size_t>(k), recipe_->to_cells(drawn));
  }
}

void ParticleFilter::inject(const PoseEstimate& pose, double share, RandomKeys& keys) {
  const int count = belief_.size;
  const int kept = std::clamp(static_cast<int>(std::lround((1.0 - share) * count)), 1, count);
  locfuse::resample(belief_, kept, {}, keys.next(), scratch_);
  belief_.resize(count);
  draw_near(kept, count, pose, keys.next());
  std::fill(belief_.weight.begin(), belief_.weight.begin() + count,
            1.0F / static_cast<float>(count));
  std::fill(belief_.weight.begin() + count, belief_.weight.end(), 0.0F);
  cluster();
}

void ParticleFilter::add_motion(const OdometryMotion& model, const Pose2& motion, Stamp until,
                                const std::optional<Vector<3>>& variance) {
  model.append(pending_, motion, seconds_between(stamp_, until), variance);
  stamp_ = until;
}

bool ParticleFilter::is_propagation_due() const {
  return pending_.motion.position().norm() > ParticleFilterTuning::kMaxPendingDistance ||
         std::abs(pending_.motion.heading) > ParticleFilterTuning::kMaxPendingTurn;
}

UncertainMotion ParticleFilter::pending_in_cells() const {
  const double per_cell = 1.0 / recipe_->grid().resolution();
  const Vector<3> scale(per_cell, per_cell, 1.0);
  UncertainMotion step = pending_;
  step.motion.x *= per_cell;
  step.motion.y *= per_cell;
  step.covariance = scale.asDiagonal() * step.covariance * scale.asDiagonal();
  return step;
}

void ParticleFilter::propagate(RandomKeys& keys) {
  const UncertainMotion step = pending_in_cells();
  move(belief_, step, keys.next(), *recipe_->workers);
  finish_propagation(step);
}

void ParticleFilter::finish_propagation(const UncertainMotion& step) {
  added_variance_ += step.covariance.diagonal();
  for (PoseHypothesis& h : hypotheses_) {
    h.estimate = carried(h.estimate, pending_, stamp_);
  }
  belief_.stamp = stamp_;
  pending_ = {};
}

void ParticleFilter::weigh(const LikelihoodField& field, const EndPoints& points) {
  likelihoods_.evaluate(field, points, belief_, *recipe_->workers);
}

void ParticleFilter::weigh(const BeamModel& model, const LaserScan& scan) {
  const Beams beams = model.beams_of(scan, recipe_->config.beams);
  recipe_->workers->share(belief_.size, 1, [&](int begin, int end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      likelihoods_.log[k] =
          static_cast<float>(model.log_likelihood(recipe_->to_world(belief_.pose(k)), beams));
    }
  });
}

double ParticleFilter::best_log_likelihood() const {
  return *std::max_element(likelihoods_.log.begin(), likelihoods_.log.begin() + belief_.size);
}

void ParticleFilter::resample(const Resampling& how, RandomKeys& keys) {
  const MclConfig& config = recipe_->config;
  used_share_ = reweigh(belief_, likelihoods_.log, how.max_share,
                        config.effective_share * effective_size(belief_));
  if (belief_.size > config.max_particles ||
      effective_size(belief_) < config.resample_below * belief_.size) {
    if (how.by_bin) {
      resample_by_bin(belief_, target_, recipe_->bins(), ParticleFilterTuning::kBinPower,
                      ParticleFilterTuning::kMinBinWeight, keys.next(), scratch_);
    } else {
      locfuse::resample(belief_, target_, {}, keys.next(), scratch_);
    }
    if (how.roughen) {
      roughen(keys);
    }
    adapt_size();
  }
  cluster();
}

/// Copies of a particle part by the kernel of a density estimate (Silverman), unless motion has
/// moved them as far since the last resampling: a robot that stands keeps more than one particle.
void ParticleFilter::roughen(RandomKeys& keys) {
  const Matrix<3, 3>& P = best().estimate.covariance;
  const double resolution = recipe_->grid().resolution();
  const double kernel = std::pow(4.0 / (5.0 * belief_.size), 2.0 / 7.0);
  const double xy = 0.5 * (P(0, 0) + P(1, 1)) / (resolution * resolution);
  const Vector<3> wanted = kernel * Vector<3>(xy, xy, P(2, 2));
  const Vector<3> missing = (wanted - added_variance_).cwiseMax(0.0);
  move(belief_, {{}, missing.asDiagonal()}, keys.next(), *recipe_->workers);
  added_variance_.setZero();
}

/// Number of particles by KLD sampling.
void ParticleFilter::adapt_size() {
  const MclConfig& config = recipe_->config;
  if (config.min_particles < config.max_particles) {
    const double wanted = kld_particles(occupied_bins(belief_, recipe_->bins(), 0.0),
                                        config.kld_error, config.kld_quantile);
    target_ =
        static_cast<int>(std::min(std::max({wanted, ParticleFilterTuning::kMinShrinkage * target_,
                                            static_cast<double>(config.min_particles)}),
                                  static_cast<double>(config.max_particles)));
  }
}

void ParticleFilter::replace_half(int count, std::function<void(ParticleBelief&, int)> draw,
                                  RandomKeys& keys) {
  const int particles = count > 0 ? count : std::max(target_, 2);
  locfuse::resample(belief_, particles, {particles / 2, 0.5, std::move(draw)}, keys.next(),
                    scratch_);
  cluster();
}

void ParticleFilter::cluster() {
  const std::vector<ParticleCluster> clusters =
      clusters_of(belief_, recipe_->bins(), ParticleFilterTuning::kMaxClusters);
  hypotheses_.clear();
  const MclConfig& config = recipe_->config;
  const Matrix<3, 3> to_metres = recipe_->world_per_cell();
  const Vector<3> map_sigma(config.sigma_map_m, config.sigma_map_m, config.sigma_map_rad);
  const Matrix<3, 3> map_covariance =
      map_sigma.cwiseMax(ParticleFilterTuning::kMinClusterSigma).cwiseAbs2().asDiagonal();
  for (const ParticleCluster& cluster : clusters) {
    const Matrix<3, 3> P = to_metres * cluster.covariance * to_metres.transpose() + map_covariance;
    hypotheses_.push_back(
        {{belief_.stamp, recipe_->to_world(cluster.mean), 0.5 * (P + P.transpose())},
         cluster.weight});
  }
}

bool ParticleFilter::is_converged() const {
  const MclConfig& config = recipe_->config;
  const Matrix<3, 3>& P = best().estimate.covariance;
  return best().probability >= config.probability_ready &&
         std::sqrt(std::max(P(0, 0), P(1, 1))) <= config.sigma_xy_ready_m &&
         std::sqrt(P(2, 2)) <= config.sigma_heading_ready_rad;
}

PoseEstimate ParticleFilter::predicted(const PoseEstimate& from) const {
  return carried(from, pending_, stamp_);
}

PoseEstimate ParticleFilter::predicted(const PoseEstimate& from, const HeldMotion& odometry,
                                       Stamp end) const {
  const Stamp now = std::max(stamp_, end);
  UncertainMotion ahead = pending_;
  Stamp at = stamp_;
  odometry.advance(
      stamp_, now, recipe_->hold,
      [&](const Pose2& motion, Stamp until, const std::optional<Vector<3>>& variance) {
        recipe_->motion.append(ahead, motion, seconds_between(at, until), variance);
        at = until;
      },
      [&](Stamp until) {
        recipe_->lost.append(ahead, Pose2{}, seconds_between(at, until));
        at = until;
      });
  return carried(from, ahead, now);
}

/// Eq. (3.1) of docs/models/particles.md.
PoseEstimate ParticleFilter::overall() const {
  const PoseEstimate& here = best().estimate;
  double total = 0.0;
  Vector<3> mean = Vector<3>::Zero();
  Matrix<3, 3> square = Matrix<3, 3>::Zero();
  for (const PoseHypothesis& cluster : hypotheses_) {
    const Vector<3> off = local(cluster.estimate.pose, here.pose);
    total += cluster.probability;
    mean += cluster.probability * off;
    square += cluster.probability * (cluster.estimate.covariance + off * off.transpose());
  }
  mean /= total;
  const Matrix<3, 3> P = square / total - mean * mean.transpose();
  return {here.stamp, here.pose, 0.5 * (P + P.transpose())};
}

double ParticleFilter::particle_spacing() const {
  const double per_bin =
      belief_.size / static_cast<double>(occupied_bins(belief_, recipe_->bins(), 0.0));
  return recipe_->config.bin_m / std::cbrt(per_bin);
}

}  // namespace locfuse::internal
