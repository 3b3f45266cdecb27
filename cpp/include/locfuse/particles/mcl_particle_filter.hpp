// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/filters/clustering.hpp"
#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/resampling.hpp"
#include "locfuse/particles/mcl_recipe.hpp"

namespace locfuse::internal {

/// Log likelihoods of one measurement from each particle, up to a constant.
struct ParticleLikelihoods {
  /// Particles that a likelihood field evaluates at once.
  static constexpr int kFieldGroup = 8;

  std::vector<float> log;           ///< [nats]
  std::vector<std::int32_t> costs;  ///< memory to reuse

  /// Of a scan under a likelihood field.
  void evaluate(const LikelihoodField& field, const EndPoints& points, const ParticleBelief& belief,
                Workers& workers);
};

/// The particle filter of an Mcl: propagate, weigh, resample, cluster; docs/models/particles.md.
///
/// Motion accumulates, with its covariance, until `propagate` moves the particles to it.
class ParticleFilter {
 public:
  explicit ParticleFilter(std::shared_ptr<const MclRecipe> recipe) : recipe_(std::move(recipe)) {}

  /// @name Start. Each forgets what was known before.
  /// Uniform over free space and headings.
  void start_anywhere(Stamp stamp, RandomKeys& keys);
  /// Draws from poses, as many as their probabilities say.
  void start_at(const std::vector<PoseHypothesis>& hypotheses, RandomKeys& keys);
  /// Particles (x, y, heading, weight) in world, one per column; `total` is the sum of weights.
  void start_with(Stamp stamp, const Matrix<4, Eigen::Dynamic>& particles, double total,
                  RandomKeys& keys);

  /// Replaces a share of the particles by draws from a pose.
  void inject(const PoseEstimate& pose, double share, RandomKeys& keys);

  /// @name Propagate
  /// Appends a motion that ends at `until`, with its variance where that is known.
  void add_motion(const OdometryMotion& model, const Pose2& motion, Stamp until,
                  const std::optional<Vector<3>>& variance = {});
  [[nodiscard]] bool has_pending_motion() const { return belief_.stamp != stamp_; }
  /// Whether the pending motion is so long that its Gaussian no longer fits.
  [[nodiscard]] bool is_propagation_due() const;
  /// The pending motion, lengths in cells.
  [[nodiscard]] UncertainMotion pending_in_cells() const;
  /// Moves particles by draws from the pending motion.
  void propagate(RandomKeys& keys);
  /// Moves particles by draws from odometry and a scan match together; eq. (2.4) and (2.5). Returns
  /// false, and moves nothing, where there is no match to draw from.
  bool propagate_by_match(const LaserScan& z, double sigma_hit, RandomKeys& keys);
  /// Moves each particle by a draw from odometry and the lines of scan and map together, or from
  /// odometry alone where it sees none, and weighs it by them; eq. (2.6) to (2.9). Returns the scan
  /// without the beams that have weighed particles, if some have.
  [[nodiscard]] std::optional<LaserScan> propagate_by_lines(const LaserScan& z, double sigma_hit,
                                                            RandomKeys& keys);

  /// @name Weigh: each leaves log likelihoods for `resample`.
  void weigh(const LikelihoodField& field, const EndPoints& points);
  void weigh(const BeamModel& model, const LaserScan& scan);
  /// By log_likelihood(pose in world) [nats].
  template <class LogLikelihood>
  void weigh_poses(const LogLikelihood& log_likelihood);
  /// Log likelihood of the best particle.
  [[nodiscard]] double best_log_likelihood() const;

  /// @name Resample
  struct Resampling {
    double max_share = 1.0;  ///< of the information of the measurement that is used
    bool by_bin = false;     ///< keep the weight of each bin
    bool roughen = false;    ///< spread copies of a particle
  };
  /// Updates weights, resamples where too few particles are effective, and clusters.
  void resample(const Resampling& how, RandomKeys& keys);
  /// Gives half of the weight, and of `count` particles (of as many as it is adapted to if 0), to
  /// poses that `draw` sets.
  void replace_half(int count, std::function<void(ParticleBelief&, int)> draw, RandomKeys& keys);

  [[nodiscard]] const ParticleBelief& belief() const { return belief_; }
  /// Stamp at which the pending motion ends.
  [[nodiscard]] Stamp stamp() const { return stamp_; }
  /// Clusters at the belief's stamp, the likeliest first.
  [[nodiscard]] const std::vector<PoseHypothesis>& hypotheses() const { return hypotheses_; }
  [[nodiscard]] const PoseHypothesis& best() const { return hypotheses_.front(); }
  /// Whether the likeliest cluster has config.probability_ready and is narrow.
  [[nodiscard]] bool is_converged() const;
  /// A pose at the belief's stamp, carried along the pending motion.
  [[nodiscard]] PoseEstimate predicted(const PoseEstimate& from) const;
  /// A pose at the belief's stamp, carried on by odometry to a stamp that is not before.
  [[nodiscard]] PoseEstimate predicted(const PoseEstimate& from, const HeldMotion& odometry,
                                       Stamp end) const;
  /// The likeliest pose with the covariance of all clusters about their mean, at the belief's
  /// stamp.
  [[nodiscard]] PoseEstimate overall() const;
  /// Mean distance between the particles of a bin [m].
  [[nodiscard]] double particle_spacing() const;
  [[nodiscard]] double used_share() const { return used_share_; }

  /// Memory that recovery shares.
  [[nodiscard]] ParticleLikelihoods& likelihoods() { return likelihoods_; }
  [[nodiscard]] ParticleBelief& scratch() { return scratch_; }

 private:
  void reset(Stamp stamp, int particles);
  void draw_near(int begin, int end, const PoseEstimate& pose, std::uint64_t key);
  void finish_propagation(const UncertainMotion& step);
  void roughen(RandomKeys& keys);
  void adapt_size();
  void cluster();

  std::shared_ptr<const MclRecipe> recipe_;
  ParticleBelief belief_;
  ParticleBelief scratch_;
  ParticleLikelihoods likelihoods_;
  std::vector<float> correction_;                 // log importance weights of the proposal
  std::vector<PoseHypothesis> hypotheses_;        // at belief_.stamp
  Stamp stamp_ = 0;                               // up to where pending_ leads
  UncertainMotion pending_;                       // since belief_.stamp, in metres
  Vector<3> added_variance_ = Vector<3>::Zero();  // by motion since the last resampling [cells^2]
  double used_share_ = 0.0;
  int target_ = 0;  // particles after the next resampling
};

template <class LogLikelihood>
void ParticleFilter::weigh_poses(const LogLikelihood& log_likelihood) {
  likelihoods_.log.resize(belief_.x.size());
  recipe_->workers->share(static_cast<int>(belief_.x.size()), ParticleLikelihoods::kFieldGroup,
                          [&](int begin, int end) {
                            for (int i = begin; i < end; ++i) {
                              const auto k = static_cast<std::size_t>(i);
                              likelihoods_.log[k] = static_cast<float>(
                                  log_likelihood(recipe_->to_world(belief_.pose(k))));
                            }
                          });
}

}  // namespace locfuse::internal
