// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "locfuse/filters/workers.hpp"
#include "locfuse/geometry/pose2.hpp"
#include "locfuse/geometry/uncertain_motion.hpp"
#include "locfuse/time.hpp"

/// Particle filter over poses: the only code that changes a ParticleBelief. Random numbers depend
/// on the seed, the step and the particle alone, so results do not depend on the number of threads.
/// Derivation: docs/models/particles.md.
namespace locfuse {

/// Weighted poses at one stamp, in single precision and in the cells of a map, row by row from its
/// corner: 24 bytes each.
struct ParticleBelief {
  Stamp stamp = 0;
  std::vector<float> x, y;    ///< position [cells]
  std::vector<float> c, s;    ///< cosine and sine of the heading
  std::vector<float> weight;  ///< sum to 1; 0 for the few that fill up the last group
  /// Side of the box of poses that a particle stands for [cells]; 0 for one that is a point.
  std::vector<float> box;
  double turn_per_cell = 0.0;  ///< the box's third side: so much of the heading [rad]
  int size = 0;                ///< without those

  /// Room for `count` particles, whose values are left as they are. Throws std::invalid_argument
  /// unless 1 to kMaxSize.
  void resize(int count);

  [[nodiscard]] Pose2 pose(std::size_t k) const {
    return {static_cast<double>(x[k]), static_cast<double>(y[k]),
            static_cast<double>(std::atan2(s[k], c[k]))};
  }
  void put(std::size_t k, const Pose2& pose) {
    x[k] = static_cast<float>(pose.x);
    y[k] = static_cast<float>(pose.y);
    c[k] = static_cast<float>(std::cos(pose.heading));
    s[k] = static_cast<float>(std::sin(pose.heading));
    box[k] = 0.0F;
  }
  /// Particle k becomes what particle `i` of another belief is; its weight stays.
  void put(std::size_t k, const ParticleBelief& other, std::size_t i) {
    x[k] = other.x[i];
    y[k] = other.y[i];
    c[k] = other.c[i];
    s[k] = other.s[i];
    box[k] = other.box[i];
  }

  static constexpr int kMaxSize = 1 << 28;
  static constexpr int kMost = kMaxSize;
};

/// Moves each particle by its own draw from `step`, whose lengths are in cells; eq. (1.1).
void move(ParticleBelief& belief, const UncertainMotion& step, std::uint64_t key, Workers& workers);

/// Multiplies weights by exp(share * log_likelihood[i]) and makes them sum to 1; eq. (1.2).
///
/// `share` is the largest up to `max_share` that leaves `min_effective` of the particles, in the
/// sense of effective_size: where few particles stand for a wide belief, a likelihood that is
/// narrower than their spacing says less than it seems to. Returns the share.
double reweigh(ParticleBelief& belief, const std::vector<float>& log_likelihood, double max_share,
               double min_effective);

/// 1 / sum of squared weights; eq. (1.3).
[[nodiscard]] double effective_size(const ParticleBelief& belief);

}  // namespace locfuse
