// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/altitude.hpp"

#include <cmath>
#include <stdexcept>

namespace locfuse {

AltitudeModel::AltitudeModel(const Config& config) : altimeter_up_(config.altimeter_up_m) {
  if (!std::isfinite(altimeter_up_)) {
    throw std::invalid_argument("altitude.altimeter_up_m must be finite");
  }
}

}  // namespace locfuse
