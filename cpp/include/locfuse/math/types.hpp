// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "locfuse/math/alignment.hpp"

namespace locfuse {

template <int N>
using Vector = Eigen::Matrix<double, N, 1>;

template <int M, int N>
using Matrix = Eigen::Matrix<double, M, N>;

}  // namespace locfuse
