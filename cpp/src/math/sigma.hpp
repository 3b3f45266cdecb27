// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace locfuse::internal {

/// Returns the sigma. Throws std::invalid_argument unless it is 0 to 1e6, so that its variance
/// stays finite over any distance and time.
inline double sigma_in_bounds(const std::string& name, double sigma) {
  constexpr double kMaxSigma = 1e6;
  if (!(sigma >= 0.0 && sigma <= kMaxSigma)) {
    throw std::invalid_argument(name + " is " + std::to_string(sigma) + ", expected 0 to 1e6");
  }
  return sigma;
}

}  // namespace locfuse::internal
