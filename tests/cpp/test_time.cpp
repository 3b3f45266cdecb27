// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "locfuse/time.hpp"

namespace locfuse {
namespace {

TEST(SecondsBetween, is_negative_backwards) {
  EXPECT_EQ(seconds_between(500'000'000, 2'000'000'000), 1.5);
  EXPECT_EQ(seconds_between(2'000'000'000, 500'000'000), -1.5);
}

TEST(SecondsBetween, resolves_a_nanosecond_on_a_clock_that_counts_from_1970) {
  constexpr Stamp kNow = 1'700'000'000'123'456'789;  // as a double it is good to 256 ns only
  EXPECT_EQ(seconds_between(kNow, kNow + 1), 1e-9);
}

}  // namespace
}  // namespace locfuse
