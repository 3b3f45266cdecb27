// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/particles.hpp"

namespace locfuse {

/// Particles whose bins touch; bins with next to nothing in them belong to none.
struct ParticleCluster {
  double weight = 0.0;
  Pose2 mean;               ///< circular in the heading [cells]
  Matrix<3, 3> covariance;  ///< [cells, rad]
};

/// Clusters of particles, the heaviest first, at most `max_clusters` of them.
[[nodiscard]] std::vector<ParticleCluster> clusters_of(const ParticleBelief& belief,
                                                       const ParticleBins& bins, int max_clusters);

}  // namespace locfuse
