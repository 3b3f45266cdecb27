// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/particles.hpp"

namespace locfuse {

/// Particles drawn anew, beside those that are kept; docs/models/particles.md.
struct FreshParticles {
  int count = 0;
  double probability = 0.0;                        ///< of all of them together
  std::function<void(ParticleBelief&, int)> draw;  ///< sets the pose of particle k
};

/// Systematic ("low variance") resampling into `count` particles, of which the last ones are fresh;
/// copies of one that stands for a box share it out, eq. (1.6). `scratch` is memory to reuse.
void resample(ParticleBelief& belief, int count, const FreshParticles& fresh, std::uint64_t key,
              ParticleBelief& scratch);

/// Resampling that keeps the weight of every bin, so that places that are unlikely so far do not
/// die by chance; eq. (1.7). A bin of weight W gets one particle at least and a share of the others
/// as W^power; bins with less than `min_share` of all weight go. Where more are left than `count`
/// it is `resample`.
void resample_by_bin(ParticleBelief& belief, int count, const ParticleBins& bins, double power,
                     double min_share, std::uint64_t key, ParticleBelief& scratch);

}  // namespace locfuse
