// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/filters/gate.hpp"
#include "support/expect.hpp"

namespace locfuse::test_gate {
namespace {

TEST(Gate, has_no_limit_for_nothing_compared) {
  EXPECT_THROW((void)Gate(0.99).limit(0), std::invalid_argument);
  EXPECT_THROW((void)Gate(0.99).limit(-1), std::invalid_argument);
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Gate, limit_is_the_quantile_of_the_degrees_of_freedom) {
  const Gate gate(0.95);
  EXPECT_EQ(gate.probability(), 0.95);
  EXPECT_NEAR(gate.limit(1), 3.841458820694124, 1e-12);
  EXPECT_NEAR(gate.limit(3), 7.814727903251179, 1e-12);
  for (const int dof : {2, 31, 32, 33, 200}) {  // 32 are tabled
    EXPECT_EQ(gate.limit(dof), chi_squared_quantile(dof, 0.95)) << dof;
  }
}

TEST(Gate, lets_everything_through_by_default_and_at_probability_one) {
  for (const int dof : {1, 3, 32, 33}) {
    EXPECT_EQ(Gate().limit(dof), kInfinity);
    EXPECT_EQ(Gate(1.0).limit(dof), kInfinity);
  }
}

TEST(Gate, refuses_what_is_no_probability_that_something_passes) {
  testing::expect_refused([] { (void)Gate(0.0); }, "is 0.0");
  testing::expect_refused([] { (void)Gate(-0.5); }, "-0.5");
  testing::expect_refused([] { (void)Gate(1.5); }, "1.5");
  testing::expect_refused([] { (void)Gate(std::nan("")); }, "nan");
}

TEST(Gate, closed_lets_nothing_through_however_many_rows) {
  EXPECT_LT(Gate::closed().limit(33), 0.0);
}

}  // namespace
}  // namespace locfuse::test_gate
