// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/math/numerical_jacobian.hpp"
#include "support/expect.hpp"

namespace locfuse {
namespace {

TEST(NumericalJacobian, is_the_matrix_of_a_linear_function) {
  const Matrix<2, 3> A = (Matrix<2, 3>() << 1.0, -2.0, 3.0, 0.5, 4.0, -6.0).finished();
  const Matrix<2, 3> jacobian =
      numerical_jacobian<2, 3>([&](const Vector<3>& delta) { return Vector<2>(A * delta); });
  testing::expect_near(jacobian, A, 1e-9);
}

TEST(NumericalJacobian, has_an_error_that_falls_with_the_square_of_the_step) {
  const auto f = [](const Vector<1>& d) { return Vector<1>(std::exp(1.0 + d(0)) - std::exp(1.0)); };
  const double coarse = numerical_jacobian<1, 1>(f, 1e-2)(0) - std::exp(1.0);
  const double fine = numerical_jacobian<1, 1>(f, 1e-3)(0) - std::exp(1.0);
  EXPECT_NEAR(coarse / fine, 100.0, 0.1);
}

}  // namespace
}  // namespace locfuse
