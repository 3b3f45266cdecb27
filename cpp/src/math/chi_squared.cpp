// SPDX-License-Identifier: Apache-2.0
#include "locfuse/math/chi_squared.hpp"

#include <boost/math/distributions/chi_squared.hpp>
#include <limits>
#include <stdexcept>
#include <string>

namespace locfuse {

double chi_squared_quantile(int dof, double probability) {
  if (dof < 1) {
    throw std::invalid_argument("dof is " + std::to_string(dof) + ", expected at least 1");
  }
  if (!(probability >= 0.0 && probability <= 1.0)) {
    throw std::invalid_argument("probability is " + std::to_string(probability) +
                                ", expected 0 to 1");
  }
  if (probability == 1.0) {
    return std::numeric_limits<double>::infinity();
  }
  return boost::math::quantile(boost::math::chi_squared(dof), probability);
}

}  // namespace locfuse
