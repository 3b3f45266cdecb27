// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <utility>
#include <vector>

#include "locfuse/math/angle.hpp"

/// Functions that are called once per particle: approximate where that is enough, and written so
/// that compilers vectorize them.
namespace locfuse::internal {

/// Sum and sum of squares of the first `size` values, in eight chains.
inline std::pair<double, double> sums_of(const std::vector<float>& values, int size) {
  std::array<double, 8> sums{};
  std::array<double, 8> squares{};
  for (std::size_t k = 0; k < static_cast<std::size_t>(size); ++k) {
    const auto value = static_cast<double>(values[k]);
    sums[k % 8] += value;
    squares[k % 8] += value * value;
  }
  return {std::accumulate(sums.begin(), sums.end(), 0.0),
          std::accumulate(squares.begin(), squares.end(), 0.0)};
}

/// exp(x) for x <= 0, to 4e-6 of itself and 1e-7 more for each unit of x, without a branch:
/// compilers make lanes of it. 1 above, and next to nothing for NaN.
inline float exp_of(float x) {
  const float y = std::max(-126.0F, 1.4426950F * std::min(x, 0.0F));
  const auto n = static_cast<std::int32_t>(y - 0.5F);  // towards zero
  const float f = y - static_cast<float>(n);
  const float power =
      1.0F +
      f * (0.6931472F + f * (0.2402265F + f * (0.0555041F + f * (0.0096181F + f * 0.0013333F))));
  const std::int32_t bits = (n + 127) << 23;
  float scale = 0.0F;
  std::memcpy(&scale, &bits, sizeof scale);
  return scale * power;
}

/// Heading of (cosine, sine) in [-pi, pi], to 2e-5 rad: what bins and covariances need.
inline float heading_of(float c, float s) {
  const float less = std::min(std::abs(c), std::abs(s));
  const float more = std::max(std::abs(c), std::abs(s));
  const float t = less / more;
  const float q = t * t;
  // Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.49.
  float angle =
      t * (0.9998660F + q * (-0.3302995F + q * (0.1801410F + q * (-0.0851330F + q * 0.0208351F))));
  angle = std::abs(s) > std::abs(c) ? static_cast<float>(0.5 * kPi) - angle : angle;
  angle = c < 0.0F ? static_cast<float>(kPi) - angle : angle;
  return s < 0.0F ? -angle : angle;
}

}  // namespace locfuse::internal
