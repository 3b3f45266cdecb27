// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <random>

#include "locfuse/geometry/pose2.hpp"

namespace locfuse::testing {

using Rng = std::mt19937_64;

[[nodiscard]] inline double uniform(Rng& rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(rng);
}

[[nodiscard]] inline double normal(Rng& rng, double sigma) {
  return sigma * std::normal_distribution<double>()(rng);
}

[[nodiscard]] inline Pose2 random_pose(Rng& rng, double extent = 20.0) {
  return {uniform(rng, -extent, extent), uniform(rng, -extent, extent), uniform(rng, -kPi, kPi)};
}

[[nodiscard]] inline Eigen::MatrixXd random_matrix(Rng& rng, Eigen::Index rows, Eigen::Index cols) {
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return uniform(rng, -1.0, 1.0); });
}

[[nodiscard]] inline Eigen::MatrixXd random_covariance(Rng& rng, Eigen::Index size) {
  const Eigen::MatrixXd root = random_matrix(rng, size, size);
  const Eigen::MatrixXd squared = root * root.transpose();
  return 0.5 * (squared + squared.transpose()) + 0.1 * Eigen::MatrixXd::Identity(size, size);
}

}  // namespace locfuse::testing
