// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/position.hpp"

#include <stdexcept>
#include <utility>

namespace locfuse {

PositionModel::PositionModel(const Config& config, std::vector<Tag> tags)
    : config_(config),
      antenna_in_body_(config.antenna_forward_m, config.antenna_left_m),
      tags_(std::move(tags)) {
  if (!antenna_in_body_.allFinite()) {
    throw std::invalid_argument("position.antenna_forward_m and antenna_left_m must be finite");
  }
  check_unknown_sigma("position.sigma_m", config.sigma_m);
  check_min_sigma("position.least_sigma_m", config.least_sigma_m);
}

}  // namespace locfuse
