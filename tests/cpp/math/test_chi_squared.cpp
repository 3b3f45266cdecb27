// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/math/chi_squared.hpp"
#include "support/expect.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;

TEST(ChiSquaredQuantile, equals_the_tables) {
  EXPECT_NEAR(chi_squared_quantile(1, 0.95), 3.841458820694124, 1e-12);
  EXPECT_NEAR(chi_squared_quantile(3, 0.95), 7.814727903251179, 1e-12);
  EXPECT_NEAR(chi_squared_quantile(1, 0.999), 10.827566170662733, 1e-11);
  EXPECT_NEAR(chi_squared_quantile(10, 0.05), 3.940, 5e-4);
  EXPECT_NEAR(chi_squared_quantile(100, 0.025), 74.222, 5e-4);
  EXPECT_NEAR(chi_squared_quantile(100, 0.975), 129.561, 5e-4);
}

TEST(ChiSquaredQuantile, equals_the_closed_form_at_two_degrees_of_freedom) {
  for (const double p : {1e-6, 0.1, 0.5, 0.9, 0.999999}) {
    EXPECT_NEAR(chi_squared_quantile(2, p), -2.0 * std::log1p(-p), 1e-12);
  }
}

TEST(ChiSquaredQuantile, spans_zero_to_infinity) {
  EXPECT_EQ(chi_squared_quantile(3, 0.0), 0.0);
  EXPECT_EQ(chi_squared_quantile(3, 1.0), std::numeric_limits<double>::infinity());
}

TEST(ChiSquaredQuantile, rejects_invalid_probabilities_and_dof) {
  expect_refused([] { (void)chi_squared_quantile(0, 0.5); }, "dof is 0");
  expect_refused([] { (void)chi_squared_quantile(-2, 0.5); }, "dof is -2");
  expect_refused([] { (void)chi_squared_quantile(1, -0.25); }, "-0.25");
  expect_refused([] { (void)chi_squared_quantile(1, 1.25); }, "1.25");
  expect_refused([] { (void)chi_squared_quantile(1, std::nan("")); }, "nan");
}

}  // namespace
}  // namespace locfuse
