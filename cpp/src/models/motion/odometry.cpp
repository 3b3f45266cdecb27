// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/motion/odometry.hpp"

#include <stdexcept>
#include <string>

namespace locfuse {
namespace {

double variance_of(const char* name, double sigma) {
  if (!(std::isfinite(sigma) && sigma >= 0.0)) {
    throw std::invalid_argument(std::string("odometry.") + name + " is " + std::to_string(sigma) +
                                ", expected a finite number >= 0");
  }
  return sigma * sigma;
}

}  // namespace

OdometryMotion::OdometryMotion(const Config& config)
    : longitudinal_per_m_(
          variance_of("sigma_longitudinal_per_sqrt_m", config.sigma_longitudinal_per_sqrt_m)),
      lateral_per_m_(variance_of("sigma_lateral_per_sqrt_m", config.sigma_lateral_per_sqrt_m)),
      heading_per_m_(variance_of("sigma_heading_per_sqrt_m", config.sigma_heading_per_sqrt_m)),
      heading_per_rad_(
          variance_of("sigma_heading_per_sqrt_rad", config.sigma_heading_per_sqrt_rad)),
      xy_per_s_(variance_of("sigma_xy_per_sqrt_s", config.sigma_xy_per_sqrt_s)),
      heading_per_s_(variance_of("sigma_heading_per_sqrt_s", config.sigma_heading_per_sqrt_s)) {}

}  // namespace locfuse
