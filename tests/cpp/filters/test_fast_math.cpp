// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "filters/fast_math.hpp"
#include "support/expect.hpp"

namespace locfuse::test_fast_math {
namespace {

TEST(FastMath, exponentials_are_right_to_four_in_a_million) {
  for (int i = 0; i <= 80'000; ++i) {
    const auto x = static_cast<float>(-0.001 * i);
    const double exact = std::exp(static_cast<double>(x));
    // From the rounding of x / log(2), which is below 116, on.
    ASSERT_NEAR(internal::exp_of(x) / exact, 1.0, 4e-6 + 1e-7 * std::abs(x)) << x;
  }
  EXPECT_EQ(internal::exp_of(0.0F), 1.0F);
  EXPECT_EQ(internal::exp_of(3.0F), 1.0F);
  EXPECT_LT(internal::exp_of(-1e6F), 1e-30F);
  EXPECT_LT(internal::exp_of(std::numeric_limits<float>::quiet_NaN()), 1e-30F);
}

TEST(FastMath, headings_are_right_all_around) {
  for (int i = -31'415; i <= 31'415; ++i) {
    const double angle = 1e-4 * i;
    const float heading = internal::heading_of(static_cast<float>(std::cos(angle)),
                                               static_cast<float>(std::sin(angle)));
    ASSERT_NEAR(heading, angle, 2e-5) << angle;
  }
}

}  // namespace
}  // namespace locfuse::test_fast_math
