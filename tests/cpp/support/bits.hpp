// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstring>

#include "locfuse/filters/belief.hpp"

namespace locfuse::testing {

[[nodiscard]] inline bool same_bits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() &&
         std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}

[[nodiscard]] inline bool same_bits(const GaussianBelief& a, const GaussianBelief& b) {
  return a.stamp == b.stamp && same_bits(a.x, b.x) && same_bits(a.P, b.P);
}

}  // namespace locfuse::testing
