// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/velocity.hpp"

#include <stdexcept>
#include <string>

namespace locfuse {
namespace {

double variance_of(const char* name, double sigma, bool may_be_zero) {
  if (!(std::isfinite(sigma * sigma) &&
        (may_be_zero ? sigma >= 0.0 : sigma * sigma > 0.0 && sigma > 0.0))) {
    throw std::invalid_argument(std::string("velocity.") + name + " is " + std::to_string(sigma) +
                                ", expected a finite number " + (may_be_zero ? ">= 0" : "> 0") +
                                ", its square as well");
  }
  return sigma * sigma;
}

}  // namespace

VelocityModel::VelocityModel(const Config& config)
    : twist_variances_(variance_of("sigma_forward_mps", config.sigma_forward_mps, true),
                       variance_of("sigma_lateral_mps", config.sigma_lateral_mps, true),
                       variance_of("sigma_turn_rate_radps", config.sigma_turn_rate_radps, true)),
      point_variance_(variance_of("sigma_point_mps", config.sigma_point_mps, false)) {}

}  // namespace locfuse
