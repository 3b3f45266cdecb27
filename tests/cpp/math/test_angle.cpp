// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "locfuse/math/angle.hpp"

namespace locfuse {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(WrapAngle, keeps_the_direction_and_stays_in_the_half_open_interval) {
  for (int i = -10'000; i <= 10'000; ++i) {
    const double angle = 0.01 * i;
    const double wrapped = wrap_angle(angle);
    ASSERT_GE(wrapped, -kPi) << angle;
    ASSERT_LT(wrapped, kPi) << angle;
    ASSERT_NEAR(std::cos(wrapped), std::cos(angle), 1e-13) << angle;
    ASSERT_NEAR(std::sin(wrapped), std::sin(angle), 1e-13) << angle;
  }
}

TEST(WrapAngle, changes_no_bit_of_what_is_wrapped_already) {
  for (const double angle : {-kPi, -1.0, -1e-300, 0.0, 1e-300, 3.0, std::nextafter(kPi, 0.0)}) {
    EXPECT_EQ(wrap_angle(angle), angle);
  }
}

TEST(WrapAngle, maps_pi_to_minus_pi) {
  EXPECT_EQ(wrap_angle(kPi), -kPi);
  EXPECT_EQ(wrap_angle(3.0 * kPi), -kPi);
  EXPECT_EQ(wrap_angle(-3.0 * kPi), -kPi);
}

TEST(WrapAngle, wraps_the_neighbours_of_the_cut) {
  EXPECT_NEAR(wrap_angle(std::nextafter(kPi, 4.0)), -kPi, 1e-15);
  const double below = wrap_angle(std::nextafter(-kPi, -4.0));
  EXPECT_NEAR(below, kPi, 1e-15);
  EXPECT_LT(below, kPi);
}

TEST(WrapAngle, removes_whole_turns_of_huge_angles_exactly) {
  EXPECT_EQ(wrap_angle(std::ldexp(2.0 * kPi, 40)), 0.0);
  EXPECT_EQ(wrap_angle(std::ldexp(-2.0 * kPi, 900)), 0.0);
  for (const double huge : {1e15, -1e15, 1e300, std::numeric_limits<double>::max()}) {
    EXPECT_GE(wrap_angle(huge), -kPi);
    EXPECT_LT(wrap_angle(huge), kPi);
  }
}

TEST(WrapAngle, gives_nan_for_infinite_angles) {
  EXPECT_TRUE(std::isnan(wrap_angle(std::nan(""))));
  EXPECT_TRUE(std::isnan(wrap_angle(kInfinity)));
  EXPECT_TRUE(std::isnan(wrap_angle(-kInfinity)));
}

TEST(AngleDifference, goes_the_short_way_across_the_cut) {
  EXPECT_NEAR(angle_difference(kPi - 0.1, -kPi + 0.1), -0.2, 1e-15);
  EXPECT_NEAR(angle_difference(-kPi + 0.1, kPi - 0.1), 0.2, 1e-15);
  EXPECT_DOUBLE_EQ(angle_difference(0.5, 0.2), 0.3);
}

}  // namespace
}  // namespace locfuse
