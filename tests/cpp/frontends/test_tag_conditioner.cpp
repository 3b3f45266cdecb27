// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/frontends/tag_conditioner.hpp"
#include "locfuse/math/angle.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_refused;

constexpr Stamp kSecond = 1'000'000'000;
const std::vector<Tag> kTags = {{1, {0.5, 0.0, 1.0}}, {2, {0.0, 2.0, 1.0}}};
const Matrix<2, 2> kR = 0.04 * Matrix<2, 2>::Identity();

TagConditioner::Config no_low_pass() {
  TagConditioner::Config config;
  config.cutoff_hz = 0.0;
  return config;
}

PositionFix fix(Stamp stamp, double x, double y, Id tag = 1) { return {stamp, {x, y}, kR, tag}; }

TEST(TagConditioner, removes_only_the_bias) {
  TagConditioner::Config config = no_low_pass();
  config.bias_x_m = 0.2;
  config.bias_y_m = -0.1;
  TagConditioner conditioner(config, kTags);
  const ConditionedFix out = conditioner.on(fix(5, 1.0, 2.0));
  EXPECT_EQ(out.verdict, TagVerdict::kPassed);
  expect_near(out.fix->position, Vector<2>(0.8, 2.1), 1e-15);
  EXPECT_EQ(out.fix->stamp, 5);
  EXPECT_EQ(out.fix->tag, 1);
  EXPECT_EQ(out.fix->covariance, kR);
}

TEST(TagConditioner, the_low_pass_is_that_of_first_order) {
  TagConditioner::Config config;
  config.cutoff_hz = 0.25;
  TagConditioner conditioner(config, kTags);
  conditioner.on(fix(0, 0.0, 0.0));
  const double share = 1.0 - std::exp(-2.0 * kPi * 0.25 * 0.5);  // half a second later
  EXPECT_NEAR(conditioner.on(fix(kSecond / 2, 1.0, 0.0)).fix->position.x(), share, 1e-15);
  // A step of one second is two of half a second with the same value.
  TagConditioner twice(config, kTags);
  twice.on(fix(0, 0.0, 0.0));
  twice.on(fix(kSecond / 2, 1.0, 0.5));
  const Vector<2> fine = twice.on(fix(kSecond, 1.0, 0.5)).fix->position;
  TagConditioner once(config, kTags);
  once.on(fix(0, 0.0, 0.0));
  expect_near(once.on(fix(kSecond, 1.0, 0.5)).fix->position, fine, 1e-15);
}

TEST(TagConditioner, the_low_pass_lags_and_smooths_as_documented) {
  TagConditioner::Config config;
  config.cutoff_hz = 0.2;
  TagConditioner conditioner(config, kTags);
  const double a = 1.0 - std::exp(-2.0 * kPi * 0.2);
  testing::Rng rng(2);
  double lag = 0.0;
  double square = 0.0;
  constexpr int kFixes = 20000;
  for (int i = 0; i < kFixes; ++i) {
    const double x = 0.3 * i;
    const Vector<2> out =
        conditioner.on(fix(i * kSecond, x, testing::normal(rng, 0.1))).fix->position;
    lag = x - out.x();
    square += out.y() * out.y() / kFixes;
  }
  EXPECT_NEAR(lag, 0.3 * (1.0 - a) / a, 1e-9);                      // eq. (11)
  EXPECT_NEAR(square / 0.01, a / (2.0 - a), 0.03 * a / (2.0 - a));  // eq. (12)
}

TEST(TagConditioner, adds_the_lag_at_most_to_the_covariance) {
  TagConditioner::Config config;
  config.cutoff_hz = 0.2;
  TagConditioner conditioner(config, kTags);
  const double a = 1.0 - std::exp(-2.0 * kPi * 0.2);
  double lag = 0.0;
  Matrix<2, 2> covariance;
  for (int i = 0; i < 60; ++i) {
    conditioner.on(Velocity{i * kSecond, 0.3, 0.0});
    const ConditionedFix out = conditioner.on(fix(i * kSecond, 0.3 * i, 0.0));
    lag = 0.3 * i - out.fix->position.x();
    covariance = out.fix->covariance;
  }
  EXPECT_NEAR(lag, 0.3 * (1.0 - a) / a, 1e-9);
  expect_near(covariance, Matrix<2, 2>(kR + lag * lag * Matrix<2, 2>::Identity()), 1e-9);
}

TEST(TagConditioner, takes_a_tag_of_which_no_wheels_report_for_as_fast_as_it_can_be) {
  TagConditioner::Config config;
  config.cutoff_hz = 0.2;
  TagConditioner conditioner(config, kTags);
  EXPECT_EQ(conditioner.on(fix(0, 0.0, 0.0)).fix->covariance, kR);  // it has no lag yet
  const double lag = std::exp(-2.0 * kPi * 0.2) * 1.4;
  expect_near(conditioner.on(fix(kSecond, 0.1, 0.0)).fix->covariance,
              Matrix<2, 2>(kR + lag * lag * Matrix<2, 2>::Identity()), 1e-12);
  // An increment up to half a second: full speed from there on.
  TagConditioner partly(config, kTags);
  partly.on(fix(0, 0.0, 0.0));
  partly.on(Increment{kSecond / 4, kSecond / 2, {0.1, 0.0, 0.0}});
  const double partly_lag = std::exp(-2.0 * kPi * 0.2) * (0.1 + 1.4 * 0.5);
  expect_near(partly.on(fix(kSecond, 0.1, 0.0)).fix->covariance,
              Matrix<2, 2>(kR + partly_lag * partly_lag * Matrix<2, 2>::Identity()), 1e-12);
}

// A sigma of 0 or -1 says that none is known, and the lag alone would be taken for the sigma.
TEST(TagConditioner, leaves_a_covariance_that_is_unknown) {
  for (const double unknown : {0.0, -1.0}) {
    TagConditioner conditioner({}, kTags);
    conditioner.on(fix(0, 0.0, 0.0));
    PositionFix z = fix(kSecond, 0.1, 0.0);
    z.covariance = unknown * Matrix<2, 2>::Identity();
    EXPECT_EQ(conditioner.on(z).fix->covariance, z.covariance);
  }
}

TEST(TagConditioner, says_how_far_a_rejected_fix_is_off) {
  TagConditioner conditioner(no_low_pass(), kTags);
  const ConditionedFix passed = conditioner.on(fix(0, 0.0, 0.0));
  EXPECT_TRUE(std::isnan(passed.distance));
  EXPECT_TRUE(std::isnan(passed.limit));
  const ConditionedFix jump = conditioner.on(fix(kSecond, 3.0, 4.0));
  EXPECT_EQ(jump.verdict, TagVerdict::kJump);
  EXPECT_EQ(jump.distance, 5.0);
  EXPECT_NEAR(jump.limit, 2.2, 1e-15);  // 1.4 m/s for a second, and 0.8 m
  conditioner.on(Increment{0, kSecond, {0.2, 0.0, 0.0}});
  conditioner.on(fix(kSecond, 0.0, 1.0));
  conditioner.on(Increment{kSecond, 2 * kSecond, {0.2, 0.0, 0.0}});
  const ConditionedFix frozen = conditioner.on(fix(2 * kSecond, 0.0, 1.0));
  EXPECT_EQ(frozen.verdict, TagVerdict::kFrozen);
  EXPECT_EQ(frozen.distance, 0.0);
  EXPECT_EQ(frozen.limit, 0.1);
}

TEST(TagConditioner, passes_fixes_of_other_antennas_as_they_are) {
  TagConditioner::Config config = no_low_pass();
  config.bias_x_m = 1.0;
  TagConditioner conditioner(config, kTags);
  EXPECT_EQ(conditioner.conditioned(fix(0, 3.0, 0.0, 7))->position.x(), 3.0);
  EXPECT_EQ(conditioner.conditioned(fix(0, 3.0, 0.0))->position.x(), 2.0);
  EXPECT_FALSE(conditioner.conditioned(fix(1, 30.0, 0.0)));
}

TEST(TagConditioner, rejects_jumps) {
  TagConditioner conditioner(no_low_pass(), kTags);
  conditioner.on(fix(0, 0.0, 0.0));
  EXPECT_EQ(conditioner.on(fix(kSecond, 2.3, 0.0)).verdict, TagVerdict::kJump);  // 1.4 + 0.8
  EXPECT_FALSE(conditioner.on(fix(kSecond, 2.3, 0.0)).fix);
  EXPECT_EQ(conditioner.on(fix(2 * kSecond, 2.3, 0.0)).verdict,
            TagVerdict::kPassed);  // reachable by now
  EXPECT_EQ(conditioner.on(fix(2 * kSecond, 30.0, 0.0, 2)).verdict, TagVerdict::kPassed);
}

TEST(TagConditioner, restarts_after_exactly_the_configured_jumps) {
  TagConditioner::Config config;
  config.restart_after = 3;
  TagConditioner conditioner(config, kTags);
  conditioner.on(fix(0, 0.0, 0.0));
  const Stamp step = kSecond / 10;
  EXPECT_EQ(conditioner.on(fix(step, 9.0, 0.0)).verdict, TagVerdict::kJump);
  EXPECT_EQ(conditioner.on(fix(2 * step, 9.1, 0.0)).verdict, TagVerdict::kJump);
  EXPECT_EQ(conditioner.on(fix(3 * step, 0.1, 0.0)).verdict,
            TagVerdict::kPassed);  // the count restarts
  EXPECT_EQ(conditioner.on(fix(4 * step, 9.0, 0.0)).verdict, TagVerdict::kJump);
  EXPECT_EQ(conditioner.on(fix(5 * step, 9.1, 0.0)).verdict, TagVerdict::kJump);
  const ConditionedFix out = conditioner.on(fix(6 * step, 9.2, 0.0));
  EXPECT_EQ(out.verdict, TagVerdict::kRestarted);
  EXPECT_EQ(out.fix->position.x(), 9.2);  // the low-pass restarts, too
  EXPECT_EQ(conditioner.on(fix(7 * step, 9.3, 0.0)).verdict, TagVerdict::kPassed);
}

// The low-pass added the difference to the earlier value, which lost digits.
TEST(TagConditioner, restarts_without_rounding_from_earlier_values) {
  TagConditioner::Config config;
  config.restart_after = 1;
  TagConditioner conditioner(config, kTags);
  EXPECT_EQ(conditioner.on(fix(0, 1e308, 0.0)).verdict, TagVerdict::kJump);  // outside the bounds
  EXPECT_EQ(conditioner.on(fix(0, 9e11, -9e11)).verdict, TagVerdict::kPassed);
  const ConditionedFix out = conditioner.on(fix(1, 0.1, 0.2));
  EXPECT_EQ(out.verdict, TagVerdict::kRestarted);
  EXPECT_EQ(out.fix->position, Vector<2>(0.1, 0.2));
  EXPECT_EQ(conditioner.on(fix(2, 0.0, -1.1e12)).verdict, TagVerdict::kJump);
  const Vector<2> next = conditioner.on(fix(3, 0.1, 0.2)).fix->position;
  expect_near(next, Vector<2>(0.1, 0.2), 1e-15);
}

TEST(TagConditioner, rejects_a_frozen_value_while_the_robot_moves) {
  TagConditioner conditioner(no_low_pass(), kTags);
  conditioner.on(Velocity{0, 0.3, 0.0});
  EXPECT_EQ(conditioner.on(fix(0, 1.0, 0.0)).verdict, TagVerdict::kPassed);
  conditioner.on(Velocity{kSecond / 4, 0.3, 0.0});
  EXPECT_EQ(conditioner.on(fix(kSecond / 4, 1.0, 0.0)).verdict, TagVerdict::kPassed);  // 7.5 cm
  conditioner.on(Velocity{kSecond / 2, 0.3, 0.0});
  const ConditionedFix stuck = conditioner.on(fix(kSecond / 2, 1.0, 0.0));
  EXPECT_EQ(stuck.verdict, TagVerdict::kFrozen);
  EXPECT_FALSE(stuck.fix);
  EXPECT_EQ(conditioner.on(fix(kSecond, 1.1, 0.0)).verdict, TagVerdict::kPassed);
}

TEST(TagConditioner, accepts_repeated_values_at_rest) {
  TagConditioner conditioner(no_low_pass(), kTags);
  for (int i = 0; i < 20; ++i) {
    conditioner.on(Velocity{i * kSecond, 0.0, 0.0});
    EXPECT_EQ(conditioner.on(fix(i * kSecond, 1.0, 0.0)).verdict, TagVerdict::kPassed);
  }
}

TEST(TagConditioner, a_turn_moves_a_tag_off_the_axis) {
  TagConditioner conditioner(no_low_pass(), kTags);
  conditioner.on(fix(0, 1.0, 0.0, 2));
  conditioner.on(Increment{0, kSecond, {0.0, 0.0, 0.2}});  // tag 2 is 2 m off: 0.4 m
  EXPECT_EQ(conditioner.on(fix(kSecond, 1.0, 0.0, 2)).verdict, TagVerdict::kFrozen);
  EXPECT_EQ(conditioner.on(fix(kSecond, 1.0, 0.0, 1)).verdict, TagVerdict::kPassed);
}

TEST(TagConditioner, a_velocity_times_out) {
  TagConditioner conditioner(no_low_pass(), kTags);
  conditioner.on(Velocity{0, 0.05, 0.0});
  conditioner.on(fix(0, 1.0, 0.0));
  // 5 cm within the timeout of a second, nothing after that.
  EXPECT_EQ(conditioner.on(fix(60 * kSecond, 1.0, 0.0)).verdict, TagVerdict::kPassed);
}

TEST(TagConditioner, rejects_stale_fixes_and_unknown_tags) {
  TagConditioner conditioner({}, kTags);
  conditioner.on(fix(kSecond, 1.0, 0.0));
  EXPECT_EQ(conditioner.on(fix(0, 1.0, 0.0)).verdict, TagVerdict::kStale);
  EXPECT_EQ(conditioner.on(fix(kSecond, 1.0, 0.0, 7)).verdict, TagVerdict::kUnknownTag);
  EXPECT_EQ(conditioner.on(PositionFix{kSecond, {1.0, 0.0}, kR}).verdict, TagVerdict::kUnknownTag);
  expect_refused([&] { conditioner.on(fix(kSecond, std::nan(""), 0.0)); }, "nan");
}

TEST(TagConditioner, rejects_a_config_out_of_range) {
  const auto with = [](const auto& change) {
    return [=] {
      TagConditioner::Config config;
      change(config);
      (void)TagConditioner(config, kTags);
    };
  };
  using Config = TagConditioner::Config;
  expect_refused(with([](Config& c) { c.cutoff_hz = -0.1; }), "cutoff_hz", "-0.1");
  expect_refused(with([](Config& c) { c.bias_x_m = std::nan(""); }), "bias_x_m");
  expect_refused(with([](Config& c) { c.bias_y_m = std::nan(""); }), "bias_y_m");
  expect_refused(with([](Config& c) { c.max_speed_mps = 0.0; }), "max_speed_mps");
  expect_refused(with([](Config& c) { c.jump_margin_m = 0.0; }), "jump_margin_m");
  expect_refused(with([](Config& c) { c.restart_after = 0; }), "restart_after");
  expect_refused(with([](Config& c) { c.frozen_motion_m = std::nan(""); }), "frozen_motion_m");
  expect_refused(with([](Config& c) { c.hold_s = 0.0; }), "hold_s");
  expect_refused(with([](Config& c) { c.cutoff_hz = 1.1e9; }), "cutoff_hz");
  expect_refused(with([](Config& c) { c.bias_x_m = 1.1e9; }), "bias_x_m");
  expect_refused(with([](Config& c) { c.bias_y_m = -1.1e9; }), "bias_y_m");
  expect_refused(with([](Config& c) { c.max_speed_mps = HUGE_VAL; }), "max_speed_mps", "inf");
  expect_refused(with([](Config& c) { c.jump_margin_m = HUGE_VAL; }), "jump_margin_m", "inf");
  expect_refused(with([](Config& c) { c.frozen_motion_m = HUGE_VAL; }), "frozen_motion_m", "inf");
  expect_refused([] { (void)TagConditioner({}, {kTags[0], kTags[0]}); }, "tag 1", "twice");
}

}  // namespace
}  // namespace locfuse
