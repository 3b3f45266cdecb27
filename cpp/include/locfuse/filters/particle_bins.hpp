// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/filters/particles.hpp"

namespace locfuse {

/// Size of the bins in which particles are counted and clustered; docs/models/particles.md.
struct ParticleBins {
  double side;      ///< [cells]
  double headings;  ///< how many all around
};

/// Number of bins that hold particles of at least `min_share` of an equal share of weight.
[[nodiscard]] int occupied_bins(const ParticleBelief& belief, const ParticleBins& bins,
                                double min_share);

/// Particles that keep the KL divergence below `error` with the probability that `quantile` of the
/// normal distribution stands for, for `bins` occupied bins (Fox, 2003); eq. (1.4).
[[nodiscard]] double kld_particles(int bins, double error, double quantile);

}  // namespace locfuse
