// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>

#include "locfuse/geometry/pose2.hpp"

namespace locfuse::testing {

using Rng = std::mt19937_64;

/// Not those of the standard library: what its distributions draw is another with each library, so
/// that tests would see other noise with each compiler.
[[nodiscard]] inline double uniform(Rng& rng, double low, double high) {
  const double below_one = std::nextafter(1.0, 0.0);
  return std::min(static_cast<double>(rng()) * 0x1p-64, below_one) * (high - low) + low;
}

/// By the polar method of Marsaglia.
[[nodiscard]] inline double normal(Rng& rng, double sigma) {
  while (true) {
    const double x = 2.0 * uniform(rng, 0.0, 1.0) - 1.0;
    const double y = 2.0 * uniform(rng, 0.0, 1.0) - 1.0;
    const double squared = x * x + y * y;
    if (squared > 0.0 && squared <= 1.0) {
      return sigma * (y * std::sqrt(-2.0 * std::log(squared) / squared));
    }
  }
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
