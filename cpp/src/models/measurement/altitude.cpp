// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/altitude.hpp"

#include <cmath>
#include <stdexcept>

#include "locfuse/messages/reported_covariance.hpp"

namespace locfuse {

AltitudeModel::AltitudeModel(const Config& config)
    : sigma_(config.sigma_m), altimeter_up_(config.altimeter_up_m) {
  check_min_sigma("altitude.sigma_m", sigma_);
  if (!std::isfinite(altimeter_up_)) {
    throw std::invalid_argument("altitude.altimeter_up_m must be finite");
  }
}

}  // namespace locfuse
