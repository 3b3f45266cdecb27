// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "locfuse/particles/mcl_map_sharpness.hpp"
#include "locfuse/particles/mcl_particle_filter.hpp"

namespace locfuse::internal {

/// A scan as the particle filter used it.
struct UsedScan {
  const EndPoints& points;
  double share;     ///< of its information that counts
  double best;      ///< log likelihood of the best particle, before that share [nats]
  bool lost_track;  ///< tracking was lost by it
};

/// Finds a kidnapped robot: recovery particles, each a candidate pose of its own, gather evidence
/// against the particle filter; eq. (2.3) of docs/models/particles.md.
class ParticleRecovery {
 public:
  explicit ParticleRecovery(std::shared_ptr<const MclRecipe> recipe) : recipe_(std::move(recipe)) {}

  void reset() { candidates_ = {}; }
  /// While the robot is tracked there are no candidates.
  void pause() { candidates_.size = 0; }
  /// Moves the candidates without noise: they climb to where scans fit.
  void propagate(const Pose2& motion_in_cells, RandomKeys& keys);
  /// Compares candidates with the filter by a scan, promotes the winner, draws new ones in place of
  /// those that fell behind, and promotes all when tracking was lost just now.
  void update(const UsedScan& scan, const MapSharpness& sharpness, ParticleFilter& filter,
              RandomKeys& keys);

 private:
  [[nodiscard]] std::vector<std::size_t> test_candidates(const UsedScan& scan,
                                                         const MapSharpness& sharpness,
                                                         ParticleFilter& filter, RandomKeys& keys);
  void promote_winner(std::vector<std::size_t>& rejected, double sigma_hit, ParticleFilter& filter,
                      RandomKeys& keys) const;
  void promote_candidates(std::size_t first, int count, double sigma_hit, ParticleFilter& filter,
                          RandomKeys& keys) const;
  [[nodiscard]] ParticleBelief draw_candidates(const EndPoints& points, int count,
                                               std::size_t level, ParticleFilter& filter,
                                               RandomKeys& keys);
  void hill_climb(const EndPoints& points, const LikelihoodField& field, ParticleBelief& pool,
                  ParticleFilter& filter, RandomKeys& keys);

  std::shared_ptr<const MclRecipe> recipe_;
  ParticleBelief candidates_;
  std::vector<double> gain_;  // evidence of each over the particle filter [nats]
  ParticleBelief tries_;      // memory to reuse
};

}  // namespace locfuse::internal
