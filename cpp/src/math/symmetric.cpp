// SPDX-License-Identifier: Apache-2.0
#include "locfuse/math/symmetric.hpp"

#include <Eigen/Cholesky>

namespace locfuse {

bool factorize(Eigen::Ref<Eigen::MatrixXd> P) {
  return Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(P).info() == Eigen::Success;
}

}  // namespace locfuse
