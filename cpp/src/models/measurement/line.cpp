// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/line.hpp"

#include "math/refuse.hpp"

namespace locfuse {

LineModel::LineModel(const Config& config) : variance_(config.sigma_wall_m * config.sigma_wall_m) {
  if (!(config.sigma_wall_m >= 0.0 && config.sigma_wall_m <= 1e3)) {
    internal::refuse("line.sigma_wall_m", config.sigma_wall_m, "0 to 1000");
  }
}

}  // namespace locfuse
