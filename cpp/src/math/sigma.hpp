// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace locfuse::internal {

/// The sigma, whose variance is finite after any way in any time. Throws std::invalid_argument
/// unless it is 0 to 1e6.
inline double sigma_in_bounds(const std::string& name, double sigma) {
  constexpr double kMost = 1e6;
  if (!(sigma >= 0.0 && sigma <= kMost)) {
    throw std::invalid_argument(name + " is " + std::to_string(sigma) + ", expected 0 to 1e6");
  }
  return sigma;
}

}  // namespace locfuse::internal
