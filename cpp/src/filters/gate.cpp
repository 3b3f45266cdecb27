// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/gate.hpp"

#include <stdexcept>
#include <string>

namespace locfuse {

Gate::Gate(double probability) : probability_(probability) {
  if (!(probability > 0.0 && probability <= 1.0)) {
    throw std::invalid_argument("gate probability is " + std::to_string(probability) +
                                ", expected more than 0 and at most 1");
  }
  for (int dof = 1; dof <= kMaxTabledDof; ++dof) {
    limits_[static_cast<std::size_t>(dof)] = chi_squared_quantile(dof, probability);
  }
}

}  // namespace locfuse
