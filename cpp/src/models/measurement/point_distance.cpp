// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/point_distance.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace locfuse {

PointDistanceModel::PointDistanceModel(const Config& config)
    : variance_(config.sigma_m * config.sigma_m) {
  if (!(config.sigma_m > 0.0 && variance_ > 0.0 && std::isfinite(variance_))) {
    throw std::invalid_argument("side.sigma_m is " + std::to_string(config.sigma_m) +
                                ", expected a finite number > 0, its square as well");
  }
}

}  // namespace locfuse
