// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// Many particles at once; see math/lanes.hpp.
namespace locfuse::internal {

/// Arrays of particles are filled up to a multiple of this.
constexpr int kParticleGroup = 8;

/// Poses: position, cosine and sine of the heading.
struct LaneParticles {
  float *x, *y, *c, *s;
};

/// A motion in the previous body frame: its mean, and the lower triangle L of its covariance L L'.
struct LaneMotion {
  float x, y, heading;
  float L[6];  ///< xx; yx, yy; hx, hy, hh
};

/// Moves particles `begin` to `end`, whole groups, each by its own draw from the motion: those of
/// `key` with the numbers 2 i and 2 i + 1.
using MoveParticles = void (*)(const LaneParticles&, int begin, int end, const LaneMotion&,
                               std::uint64_t key);

namespace portable {
void move_particles(const LaneParticles& particles, int begin, int end, const LaneMotion& motion,
                    std::uint64_t key);
}
#ifdef LOCFUSE_LANES_AVX2
namespace avx2 {
void move_particles(const LaneParticles& particles, int begin, int end, const LaneMotion& motion,
                    std::uint64_t key);
}
#endif

}  // namespace locfuse::internal
