// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "locfuse/messages/limits.hpp"
#include "support/expect.hpp"

namespace locfuse::test_limits {
namespace {

constexpr auto kSecond = static_cast<Stamp>(kNanosecondsPerSecond);
constexpr Limits kTight{2.0, 1.0, 50.0, 100.0};

TEST(Limits, are_exact_to_the_bit) {
  const auto above = [](double value) { return std::nextafter(value, 1e9); };
  EXPECT_TRUE(is_plausible(Velocity{0, -2.0, 1.0}, kTight));
  EXPECT_FALSE(is_plausible(Velocity{0, -above(2.0), 0.0}, kTight));
  EXPECT_FALSE(is_plausible(Velocity{0, 0.0, above(1.0)}, kTight));
  EXPECT_TRUE(is_plausible(Velocity{0, 1.4, 0.0, -1.4}, kTight));
  EXPECT_FALSE(is_plausible(Velocity{0, 1.5, 0.0, 1.5}, kTight));
  EXPECT_TRUE(is_plausible(Range{0, 0, 0, 50.0, {}}, kTight));
  EXPECT_FALSE(is_plausible(Range{0, 0, 0, above(50.0), {}}, kTight));
  EXPECT_TRUE(is_plausible(PositionFix{0, {60.0, -80.0}, {}}, kTight));
  EXPECT_FALSE(is_plausible(PositionFix{0, {60.0, -80.1}, {}}, kTight));
  EXPECT_FALSE(is_plausible(PoseObservation{0, {101.0, 0.0, 0.0}, {}}, kTight));
  EXPECT_FALSE(is_plausible(Altitude{0, -101.0, 0.1}, kTight));
  EXPECT_FALSE(is_plausible(RangeBearing{0, 1, 51.0, 0.1, {}}, kTight));
  EXPECT_TRUE(is_plausible(RangeBearing{0, 1, {}, 0.1, {}}, kTight));
}

TEST(Limits, an_increment_has_its_duration_and_a_tenth_of_a_second_of_jitter) {
  EXPECT_TRUE(is_plausible(Increment{0, kSecond, {2.1, 0.0, 1.05}}, kTight));
  EXPECT_FALSE(is_plausible(Increment{0, kSecond, {2.3, 0.0, 0.0}}, kTight));
  EXPECT_FALSE(is_plausible(Increment{0, kSecond, {0.0, 0.0, -1.2}}, kTight));
  EXPECT_TRUE(is_plausible(Increment{0, 0, {0.1, 0.1, 0.05}}, kTight)) << "no duration";
  EXPECT_TRUE(is_plausible(Increment{0, 1, {0.19, 0.0, 0.0}}, kTight)) << "of a nanosecond";
  EXPECT_FALSE(is_plausible(Increment{0, 1, {0.3, 0.0, 0.0}}, kTight));
}

TEST(Limits, are_finite_and_positive) {
  EXPECT_NO_THROW(validate(Limits{}));
  testing::expect_refused([] { validate(Limits{0.0, 1.0, 1.0, 1.0}); }, "limits.speed_mps");
  testing::expect_refused([] { validate(Limits{1.0, -1.0, 1.0, 1.0}); }, "limits.turn_rate_radps");
  testing::expect_refused([] { validate(Limits{1.0, 1.0, INFINITY, 1.0}); }, "limits.range_m");
  testing::expect_refused(
      [] {
        validate(Limits{1e300, 1.0, 1.0, 1.0});
      },
      "limits.speed_mps", "1e12");
  testing::expect_refused(
      [] {
        validate(Limits{1.0, 1.0, 1.0, std::nan("")});
      },
      "limits.distance_m");
}

}  // namespace
}  // namespace locfuse::test_limits
