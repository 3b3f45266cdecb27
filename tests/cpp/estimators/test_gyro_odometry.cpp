// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>

#include "locfuse/estimators/gyro_odometry.hpp"
#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/angle.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_gyro_odometry {
namespace {

using Verdict = GyroOdometry::Verdict;

constexpr Stamp kStep = 10'000'000;  // of the gyro
constexpr Stamp kOdometry = 20'000'000;

Imu level(Stamp stamp, double rate) { return {stamp, {0.0, 0.0, rate}, Vector<3>(0.0, 0.0, 9.81)}; }

/// Feeds a gyro of a rate, and odometry of a turn and a way in each step, for some seconds; returns
/// the last motion, and adds the turns.
struct Drive {
  GyroOdometry odometry{GyroOdometry::Config{}};
  Stamp now = 0;
  double turned = 0.0;
  double variance = 0.0;
  int slipped = 0;
  GyroOdometry::Motion last;

  void go(double seconds, double gyro_rate, double wheel_rate, double speed = 0.0) {
    const Stamp end = now + static_cast<Stamp>(seconds * 1e9);
    while (now < end) {
      for (Stamp at = now; at < now + kOdometry; at += kStep) {
        odometry.on(level(at, gyro_rate));
      }
      const double dt = seconds_between(now, now + kOdometry);
      const auto motion =
          odometry.on(Increment{now, now + kOdometry, arc(speed * dt, 0.0, wheel_rate * dt)});
      last = *motion;
      turned += last.increment.motion.heading;
      variance += last.increment.variance ? last.increment.variance->z() : 0.0;
      slipped += last.verdict == Verdict::kSlipped ? 1 : 0;
      now += kOdometry;
    }
  }
};

TEST(GyroOdometry, a_turn_that_both_measure_stays_and_is_surer_than_by_wheels) {
  Drive drive;
  drive.go(2.0, 0.0, 0.0);
  drive.turned = drive.variance = 0.0;
  drive.go(5.0, 0.4, 0.4, 1.0);
  EXPECT_NEAR(drive.turned, 2.0, 1e-6);
  EXPECT_EQ(drive.slipped, 0);
  const double dt = seconds_between(0, kOdometry);
  const OdometryMotion wheels{OdometryMotion::Config{}};
  const double by_wheels = wheels.propagate({}, arc(dt, 0.0, 0.4 * dt), dt).noise(2, 2);
  EXPECT_LT(drive.variance, 0.2 * by_wheels * 250);
  EXPECT_EQ(drive.last.verdict, Verdict::kTurned);
}

TEST(GyroOdometry, learns_the_bias_at_rest) {
  Drive drive;
  drive.go(5.0, 0.03, 0.0);
  EXPECT_NEAR(drive.odometry.bias(), 0.03, 1e-3);
  EXPECT_LT(drive.odometry.sigma_bias(), 2e-3);
  EXPECT_NEAR(drive.turned, 0.0, 1e-3);
  drive.turned = 0.0;
  drive.go(10.0, 0.03 + 0.2, 0.2 * 1.05, 1.0);  // wheels report 5 % too much
  EXPECT_NEAR(drive.turned, 2.0, 0.02);
}

TEST(GyroOdometry, measures_the_turn_about_the_vertical_however_it_is_mounted) {
  for (const Vector<3>& up : {Vector<3>(0.0, 0.0, 1.0), Vector<3>(0.0, 0.0, -1.0),
                              Vector<3>(0.6, 0.0, 0.8), Vector<3>(0.0, -1.0, 0.0)}) {
    GyroOdometry odometry{GyroOdometry::Config{}};
    for (Stamp at = 0; at < kOdometry; at += kStep) {
      odometry.on(Imu{at, 0.3 * up, 9.81 * up});
    }
    const auto motion = odometry.on(Increment{0, kOdometry, {0.0, 0.0, 0.3 * 0.02}});
    ASSERT_TRUE(motion);
    EXPECT_NEAR(motion->increment.motion.heading, 0.006, 1e-9);
    EXPECT_EQ(motion->verdict, Verdict::kTurned);
  }
}

TEST(GyroOdometry, takes_the_turn_of_the_gyro_while_wheels_slip) {
  Drive drive;
  drive.go(5.0, 0.0, 0.0);
  drive.go(3.0, 0.0, 0.0, 1.0);
  drive.turned = 0.0;
  const double sure = drive.last.increment.variance->x();
  drive.go(3.0, 0.0, 0.4, 1.0);  // one wheel spins
  EXPECT_NEAR(drive.turned, 0.0, 0.01);
  EXPECT_GT(drive.slipped, 100);
  EXPECT_EQ(drive.last.verdict, Verdict::kSlipped);
  EXPECT_GT(drive.last.increment.variance->x(), 3.0 * sure);
  drive.go(1.5, 0.0, 0.0, 1.0);
  EXPECT_EQ(drive.last.verdict, Verdict::kTurned);
  EXPECT_NEAR(drive.odometry.bias(), 0.0, 1e-3);  // a slip teaches nothing
}

TEST(GyroOdometry, is_unsure_where_the_contradiction_stays) {
  Drive drive;
  drive.go(6.0, 0.0, 0.0);
  drive.go(6.0, 0.5, 0.5, 1.0);
  const double agreeing = drive.last.increment.variance->z();
  drive.go(4.0, 0.0, 0.5, 1.0);
  EXPECT_LT(drive.last.increment.variance->z(), 2.0 * agreeing);
  drive.go(4.0, 0.0, 0.5, 1.0);
  EXPECT_GT(drive.last.increment.variance->z(), 100.0 * agreeing);
  drive.go(60.0, 0.5, 0.5, 1.0);  // and comes back where they agree again
  EXPECT_EQ(drive.last.verdict, Verdict::kTurned);
  EXPECT_LT(drive.last.increment.variance->z(), 3.0 * agreeing);
}

TEST(GyroOdometry, a_slip_at_the_start_is_not_taken_for_the_bias) {
  Drive drive;
  drive.go(3.0, 0.01, 0.4, 1.0);  // one wheel spins, and the gyro has a bias
  EXPECT_NEAR(drive.turned, 0.0, 0.1);
  EXPECT_GT(drive.variance, 0.1);  // neither is known to be right
  drive.go(10.0, 0.01, 0.0, 1.0);
  EXPECT_EQ(drive.last.verdict, Verdict::kTurned);
  EXPECT_NEAR(drive.odometry.bias(), 0.01, 0.01);
}

TEST(GyroOdometry, learns_a_bias_that_is_far_beyond_its_sigma) {
  Drive drive;
  drive.go(10.0, 0.15, 0.0);
  EXPECT_EQ(drive.last.verdict, Verdict::kTurned);
  EXPECT_NEAR(drive.odometry.bias(), 0.15, 0.01);
  drive.turned = 0.0;
  drive.go(5.0, 0.15 + 0.3, 0.3, 1.0);
  EXPECT_NEAR(drive.turned, 1.5, 0.02);
}

TEST(GyroOdometry, leaves_the_turn_to_the_wheels_where_the_gyro_has_stopped) {
  Drive drive;
  drive.go(3.0, 0.0, 0.0);
  drive.turned = 0.0;
  drive.odometry.on(level(drive.now, 1e-3));
  for (int i = 1; i <= 200; ++i) {  // slower odometry, so that ten samples lie in between
    for (int k = 1; k <= 12; ++k) {
      drive.odometry.on(level(drive.now + k * kStep, 1e-3));
    }
    const Stamp end = drive.now + 12 * kStep;
    const auto motion = drive.odometry.on(Increment{drive.now, end, {0.1, 0.0, 0.06}});
    drive.turned += motion->increment.motion.heading;
    drive.now = end;
  }
  EXPECT_NEAR(drive.turned, 12.0, 0.2);
}

TEST(GyroOdometry, without_samples_near_the_motion_stays_as_it_came) {
  GyroOdometry odometry{GyroOdometry::Config{}};
  const Increment wheels{0, kOdometry, {0.1, 0.0, 0.2}};
  EXPECT_EQ(odometry.on(wheels)->verdict, Verdict::kNoGyro);
  odometry.on(level(0, 0.1));
  odometry.on(level(1'000'000'000, 0.1));  // with a gap of a second
  const auto motion = odometry.on(Increment{300'000'000, 400'000'000, {0.1, 0.0, 0.2}});
  EXPECT_EQ(motion->verdict, Verdict::kNoGyro);
  EXPECT_DOUBLE_EQ(motion->increment.motion.heading, 0.2);
  EXPECT_FALSE(motion->increment.variance);
}

TEST(GyroOdometry, a_velocity_holds_until_the_next) {
  GyroOdometry odometry{GyroOdometry::Config{}};
  for (Stamp at = 0; at <= 100'000'000; at += kStep) {
    odometry.on(level(at, 0.5));
  }
  EXPECT_FALSE(odometry.on(Velocity{0, 1.0, 0.5}));
  const auto motion = odometry.on(Velocity{100'000'000, 7.0, 7.0});
  ASSERT_TRUE(motion);
  EXPECT_EQ(motion->increment.begin, 0);
  EXPECT_EQ(motion->increment.stamp, 100'000'000);
  EXPECT_NEAR(motion->increment.motion.heading, 0.05, 1e-12);
  EXPECT_NEAR(motion->increment.motion.x, arc(0.1, 0.0, 0.05).x, 1e-12);
  EXPECT_FALSE(odometry.on(Velocity{50'000'000, 1.0, 0.5}));     // late
  EXPECT_FALSE(odometry.on(Velocity{5'000'000'000, 1.0, 0.5}));  // after a pause
}

TEST(GyroOdometry, the_average_is_that_of_both) {
  GyroOdometry::Config config;
  config.turn = GyroOdometry::Turn::kAverage;
  config.sigma_bias_radps = 1e-9;
  config.sigma_bias_radps_per_sqrt_s = 0.0;
  config.sigma_turn_scale = 0.0;
  GyroOdometry odometry(config);
  for (Stamp at = 0; at <= kOdometry; at += kStep) {
    odometry.on(level(at, 0.5));
  }
  const auto motion = odometry.on(Increment{0, kOdometry, {0.02, 0.0, 0.012}});
  EXPECT_NEAR(motion->increment.motion.heading, 0.5 * (0.01 + 0.012), 1e-9);
}

/// The heading of wheels and gyro is as wrong as its variance says, whatever is wrong with them.
TEST(GyroOdometry, the_variance_of_the_turn_is_honest) {
  GyroOdometry::Config config;
  double nees = 0.0;
  double by_wheels = 0.0;
  double by_both = 0.0;
  const int seeds = 100;
  for (int seed = 1; seed <= seeds; ++seed) {
    testing::Rng random(static_cast<std::uint64_t>(seed));
    const double scale = 1.0 + config.sigma_scale * testing::normal(random, 1.0);
    const double turn_scale = 1.0 + config.sigma_turn_scale * testing::normal(random, 1.0);
    double bias = config.sigma_bias_radps * testing::normal(random, 1.0);
    GyroOdometry odometry(config);
    double error = 0.0;
    double wheels_error = 0.0;
    double variance = 0.0;
    const double dt = seconds_between(0, kOdometry);
    const double step = seconds_between(0, kStep);
    for (Stamp now = 0; now < 90'000'000'000; now += kOdometry) {
      const double t = seconds_between(0, now);
      const double speed = t < 3.0 ? 0.0 : 0.8;
      const double rate = t < 3.0 ? 0.0 : 0.6 * std::sin(0.2 * t);
      for (Stamp at = now; at < now + kOdometry; at += kStep) {
        bias += config.sigma_bias_radps_per_sqrt_s * std::sqrt(step) * testing::normal(random, 1.0);
        odometry.on(level(
            at, scale * rate + bias +
                    config.sigma_turn_per_sqrt_s / std::sqrt(step) * testing::normal(random, 1.0)));
      }
      const double turn = rate * dt;
      const double sigma =
          std::sqrt(config.odometry.sigma_heading_per_sqrt_m *
                        config.odometry.sigma_heading_per_sqrt_m * speed * dt +
                    config.odometry.sigma_heading_per_sqrt_rad *
                        config.odometry.sigma_heading_per_sqrt_rad * std::abs(turn));
      const double wheels = turn_scale * turn + sigma * testing::normal(random, 1.0);
      const auto motion =
          odometry.on(Increment{now, now + kOdometry, arc(speed * dt, 0.0, wheels)});
      error += motion->increment.motion.heading - turn;
      wheels_error += wheels - turn;
      variance += motion->increment.variance->z();
    }
    nees += error * error / variance / seeds;
    by_both += error * error / seeds;
    by_wheels += wheels_error * wheels_error / seeds;
  }
  EXPECT_GT(nees, 0.3);
  EXPECT_LT(nees, 1.3);
  EXPECT_LT(by_both, 0.25 * by_wheels);
  RecordProperty("nees", std::to_string(nees));
  RecordProperty("rms_both", std::to_string(std::sqrt(by_both)));
  RecordProperty("rms_wheels", std::to_string(std::sqrt(by_wheels)));
}

TEST(GyroOdometry, refuses_what_is_not_valid) {
  GyroOdometry::Config config;
  config.sigma_turn_per_sqrt_s = 0.0;
  testing::expect_refused([&] { GyroOdometry{config}; }, "gyro.sigma_turn_per_sqrt_s", "0");
  config = {};
  config.sigma_scale = -1.0;
  testing::expect_refused([&] { GyroOdometry{config}; }, "gyro.sigma_scale", "-1");
  GyroOdometry odometry{GyroOdometry::Config{}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  testing::expect_refused([&] { odometry.on(Imu{0, {0.0, nan, 0.0}}); }, "Imu.angular_rate", "nan");
  testing::expect_refused(
      [&] {
        odometry.on(Imu{0, {0.0, 0.0, 0.0}, Vector<3>(0.0, 0.0, 1e6)});
      },
      "Imu.specific_force", "1e+06");
  testing::expect_refused([&] { odometry.on(Increment{9, 4, {}}); }, "9", "4");
}

}  // namespace
}  // namespace locfuse::test_gyro_odometry
