// SPDX-License-Identifier: Apache-2.0
#include "filters/particle_lanes.hpp"

#include "math/lanes.hpp"

namespace locfuse::internal::LOCFUSE_LANES {

namespace {

static_assert(kParticleGroup % kLanes == 0);
constexpr float kPerTurn = 0.15915494309F;

/// As random_bits of math/counter_random.hpp, which must not be shared.
inline std::uint64_t mixed(std::uint64_t z) {
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}

/// Four numbers in (0, 1) for each particle from `first` on.
inline void draw(std::uint64_t key, int first, Lanes (&uniform)[4]) {
  constexpr std::uint64_t kStep = 0x9E3779B97F4A7C15ULL;
  std::int32_t bits[4][kLanes];
  std::uint64_t at = key + (2 * static_cast<std::uint64_t>(first) + 1) * kStep;
  for (int l = 0; l < kLanes; ++l) {
    const std::uint64_t one = mixed(at);
    const std::uint64_t two = mixed(at + kStep);
    at += 2 * kStep;
    bits[0][l] = static_cast<std::int32_t>(one >> 41U);  // 23 bits
    bits[1][l] = static_cast<std::int32_t>((one >> 9U) & 0x7FFFFFU);
    bits[2][l] = static_cast<std::int32_t>(two >> 41U);
    bits[3][l] = static_cast<std::int32_t>((two >> 9U) & 0x7FFFFFU);
  }
  for (int k = 0; k < 4; ++k) {
    Indices lanes;
    __builtin_memcpy(&lanes, bits[k], sizeof lanes);
    uniform[k] = (number(lanes) + 0.5F) * 0x1p-23F;
  }
}

}  // namespace

void move_particles(const LaneParticles& particles, int begin, int end, const LaneMotion& motion,
                    std::uint64_t key) {
  for (int i = begin; i < end; i += kLanes) {
    Lanes uniform[4];
    draw(key, i, uniform);
    // Box and Muller: two normal numbers from the first pair, one from the second.
    Lanes normal[4];
    for (int k = 0; k < 4; k += 2) {
      const Lanes radius = square_root(-2.0F * natural_log(uniform[k]));
      cos_sin_of_turns(uniform[k + 1], normal[k], normal[k + 1]);
      normal[k] *= radius;
      normal[k + 1] *= radius;
    }
    const float* const L = motion.L;
    const Lanes dx = motion.x + L[0] * normal[0];
    const Lanes dy = motion.y + L[1] * normal[0] + L[2] * normal[1];
    const Lanes turn = motion.heading + L[3] * normal[0] + L[4] * normal[1] + L[5] * normal[2];
    Lanes dc;
    Lanes ds;
    cos_sin_of_turns(turn * kPerTurn, dc, ds);
    const Lanes c = load(particles.c + i);
    const Lanes s = load(particles.s + i);
    store(load(particles.x + i) + c * dx - s * dy, particles.x + i);
    store(load(particles.y + i) + s * dx + c * dy, particles.y + i);
    const Lanes cosine = c * dc - s * ds;
    const Lanes sine = s * dc + c * ds;
    const Lanes one = 1.5F - 0.5F * (cosine * cosine + sine * sine);  // 1 but for rounding
    store(cosine * one, particles.c + i);
    store(sine * one, particles.s + i);
  }
}

}  // namespace locfuse::internal::LOCFUSE_LANES
