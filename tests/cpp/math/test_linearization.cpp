// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "locfuse/math/linearization.hpp"

namespace locfuse {
namespace {

TEST(LogLikelihood, equals_a_value_computed_by_hand_in_one_dimension) {
  Linearization<1, 3> lin;
  lin.residual << 0.5;
  lin.jacobian << 1.0, 2.0, 3.0;
  lin.noise << 0.04;  // 0.5^2 / 0.04 = 6.25
  EXPECT_NEAR(log_likelihood(lin), -0.5 * (6.25 + std::log(2.0 * kPi * 0.04)), 1e-14);
}

TEST(LogLikelihood, equals_a_value_computed_by_hand_with_correlated_noise) {
  Linearization<2, 3> lin;
  lin.residual << 1.0, 2.0;
  lin.jacobian.setZero();
  lin.noise << 2.0, 1.0, 1.0, 2.0;  // determinant 3, r' R^-1 r = (2 - 4 + 8) / 3 = 2
  EXPECT_NEAR(log_likelihood(lin), -0.5 * (2.0 + std::log(3.0) + 2.0 * std::log(2.0 * kPi)), 1e-14);
}

TEST(LogLikelihood, is_the_same_for_run_time_sizes) {
  Linearization<Eigen::Dynamic, 3, 8> lin;
  lin.residual = Vector<2>(1.0, 2.0);
  lin.jacobian = Matrix<2, 3>::Zero();
  lin.noise = (Matrix<2, 2>() << 2.0, 1.0, 1.0, 2.0).finished();
  EXPECT_NEAR(log_likelihood(lin), -0.5 * (2.0 + std::log(3.0) + 2.0 * std::log(2.0 * kPi)), 1e-14);
}

TEST(LogLikelihood, throws_where_noise_is_not_positive_definite) {
  Linearization<2, 3> lin;
  lin.residual.setZero();
  lin.jacobian.setZero();
  lin.noise << 1.0, 2.0, 2.0, 1.0;  // eigenvalues 3 and -1
  EXPECT_THROW((void)log_likelihood(lin), NumericalError);
  lin.noise.setZero();
  EXPECT_THROW((void)log_likelihood(lin), NumericalError);
}

}  // namespace
}  // namespace locfuse
