// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/chi_squared.hpp"

namespace locfuse::testing {

/// The mean of `count` chi-squared variables of `dof` lies in the two-sided 95% band.
inline bool in_band(double mean, int dof, int count) {
  const double low = chi_squared_quantile(dof * count, 0.025) / count;
  const double high = chi_squared_quantile(dof * count, 0.975) / count;
  return low <= mean && mean <= high;
}

}  // namespace locfuse::testing
