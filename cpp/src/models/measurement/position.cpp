// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/position.hpp"

#include <stdexcept>

namespace locfuse {

PositionModel::PositionModel(const Config& config)
    : antenna_in_body_(config.antenna_forward_m, config.antenna_left_m) {
  if (!antenna_in_body_.allFinite()) {
    throw std::invalid_argument("position.antenna_forward_m and antenna_left_m must be finite");
  }
}

}  // namespace locfuse
