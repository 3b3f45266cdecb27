// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/chi_squared.hpp"

namespace locfuse::testing {

/// The mean of `count` chi-squared variables of `dof` lies in the two-sided band of 95%, or of
/// another probability.
inline bool in_band(double mean, int dof, int count, double probability = 0.95) {
  const double tail = 0.5 * (1.0 - probability);
  const double low = chi_squared_quantile(dof * count, tail) / count;
  const double high = chi_squared_quantile(dof * count, 1.0 - tail) / count;
  return low <= mean && mean <= high;
}

}  // namespace locfuse::testing
