// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

#include "locfuse/math/types.hpp"

namespace locfuse {

/// Random bits that depend only on key and number, so that any thread may draw them: SplitMix64
/// (Steele, Lea and Flood, OOPSLA 2014) as a function of its counter.
[[nodiscard]] constexpr std::uint64_t random_bits(std::uint64_t key, std::uint64_t number) {
  std::uint64_t z = key + (number + 1) * 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}

/// Uniform in [0, 1).
[[nodiscard]] constexpr double random_uniform(std::uint64_t key, std::uint64_t number) {
  return static_cast<double>(random_bits(key, number) >> 11U) * 0x1p-53;
}

/// Standard normal variable (Box and Muller), from the numbers 2 n and 2 n + 1.
[[nodiscard]] inline double random_normal(std::uint64_t key, std::uint64_t number) {
  const double u = 1.0 - random_uniform(key, 2 * number);
  return std::sqrt(-2.0 * std::log(u)) *
         std::cos(6.283185307179586 * random_uniform(key, 2 * number + 1));
}

/// Three independent standard normal variables, from the numbers 3 n to 3 n + 2.
[[nodiscard]] inline Vector<3> random_normal3(std::uint64_t key, std::uint64_t number) {
  return {random_normal(key, 3 * number), random_normal(key, 3 * number + 1),
          random_normal(key, 3 * number + 2)};
}

}  // namespace locfuse
