// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace locfuse {

/// Numbers broke: an innovation covariance that is not positive definite, a result that is not
/// finite. Whatever threw it left the belief as it was.
class NumericalError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace locfuse
