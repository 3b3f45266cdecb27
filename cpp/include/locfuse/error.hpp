// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace locfuse {

/// Numerical failure: an innovation covariance that is not positive definite, a result that is not
/// finite. The belief is unchanged where it is thrown.
class NumericalError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace locfuse
