// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/math/angle.hpp"
#include "locfuse/math/numerical_jacobian.hpp"
#include "locfuse/models/motion/ackermann.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_refused;

constexpr double kLimit = 0.6;  // of steering [rad]

AckermannVehicle truck() { return AckermannVehicle({2.83, 0.76, 0.2, 0.07}); }

Vector<2> velocity_of(const AckermannVehicle& vehicle, double wheel_speed, double steering) {
  const Velocity u = vehicle.velocity(0, wheel_speed, steering);
  return {u.forward, u.turn_rate};
}

TEST(AckermannVehicle, equals_values_computed_by_hand) {
  // tan(steering) of 1/2 on a base of 2 m: a circle of 4 m; the wheel is on one of 3 m.
  const AckermannVehicle vehicle({2.0, 1.0, 0.0, 0.0});
  const Velocity left = vehicle.velocity(7, 1.5, std::atan(0.5));
  EXPECT_EQ(left.stamp, 7);
  EXPECT_NEAR(left.forward, 2.0, 1e-15);
  EXPECT_NEAR(left.turn_rate, 0.5, 1e-15);
  const Velocity right = vehicle.velocity(7, 2.5, -std::atan(0.5));
  EXPECT_NEAR(right.forward, 2.0, 1e-15);
  EXPECT_NEAR(right.turn_rate, -0.5, 1e-15);
  // On the left turn d(forward)/d(steering) = 2 * 0.625 * 1 / 0.75 with 1/(2 cos^2) = 0.625.
  expect_near(vehicle.jacobian(1.5, std::atan(0.5)),
              (Matrix<2, 2>() << 4.0 / 3.0, 5.0 / 3.0, 1.0 / 3.0, 5.0 / 3.0).finished(), 1e-15);
}

TEST(AckermannVehicle, going_straight_the_wheel_is_as_fast_as_the_axle) {
  expect_near(velocity_of(truck(), 3.0, 0.0), Vector<2>(3.0, 0.0), 0.0);
  expect_near(velocity_of(truck(), -3.0, 0.4), -velocity_of(truck(), 3.0, 0.4), 0.0);
  expect_near(velocity_of(truck(), 0.0, 0.4), Vector<2>(0.0, 0.0), 0.0);
}

TEST(AckermannVehicle, inverts_the_motion_of_a_rigid_body) {
  testing::Rng rng(31);
  const AckermannVehicle vehicle = truck();
  for (int i = 0; i < 100; ++i) {
    const double forward = testing::uniform(rng, -5.0, 5.0);
    const double steering = testing::uniform(rng, -kLimit, kLimit);
    const double turn_rate = forward * std::tan(steering) / vehicle.config().wheel_base_m;
    const double wheel = forward - turn_rate * vehicle.config().encoder_left_m;
    expect_near(velocity_of(vehicle, wheel, steering), Vector<2>(forward, turn_rate), 1e-14);
  }
}

TEST(AckermannVehicle, jacobian_matches_differences) {
  testing::Rng rng(32);
  const AckermannVehicle vehicle = truck();
  for (int i = 0; i < 100; ++i) {
    const double wheel = testing::uniform(rng, -5.0, 5.0);
    const double steering = testing::uniform(rng, -kLimit, kLimit);
    const Matrix<2, 2> differences = numerical_jacobian<2, 2>([&](const Vector<2>& delta) {
      return velocity_of(vehicle, wheel + delta(0), steering + delta(1));
    });
    expect_near(vehicle.jacobian(wheel, steering), differences, 1e-7);
  }
}

TEST(AckermannVehicle, covariance_is_that_of_many_noisy_readings) {
  testing::Rng rng(33);
  const AckermannVehicle vehicle({2.83, 0.76, 0.05, 0.01});
  const double wheel = 3.0;
  const double steering = 0.3;
  const Vector<2> mean = velocity_of(vehicle, wheel, steering);
  constexpr int kDraws = 100000;
  Matrix<2, 2> spread = Matrix<2, 2>::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Vector<2> off = velocity_of(vehicle, wheel + testing::normal(rng, 0.05),
                                      steering + testing::normal(rng, 0.01)) -
                          mean;
    spread += off * off.transpose() / kDraws;
  }
  const Matrix<2, 2> covariance = vehicle.covariance(wheel, steering);
  EXPECT_TRUE(testing::is_covariance(covariance));
  expect_near(covariance.cwiseQuotient(spread), Matrix<2, 2>::Ones(), 0.02);
  EXPECT_EQ(vehicle.covariance(0.0, 0.0)(1, 1), 0.0);  // at rest steering has no effect
}

TEST(AckermannVehicle, rejects_a_wheel_that_does_not_determine_the_speed) {
  const AckermannVehicle vehicle({2.0, 1.0, 0.0, 0.0});
  const double pole = std::atan(2.0);
  for (const double steering : {pole, pole + 0.1}) {
    expect_refused([&] { (void)vehicle.velocity(0, 1.0, steering); }, "steering",
                   std::to_string(steering));
    expect_refused([&] { (void)vehicle.jacobian(1.0, steering); }, "steering");
    expect_refused([&] { (void)vehicle.covariance(1.0, steering); }, "steering");
  }
  EXPECT_NEAR(vehicle.velocity(0, 1.0, -pole).forward, 0.5, 1e-15);  // the outer wheel
  const AckermannVehicle right({2.0, -1.0, 0.0, 0.0});
  expect_refused([&] { (void)right.velocity(0, 1.0, -pole); }, "steering");
}

TEST(AckermannVehicle, rejects_invalid_readings) {
  const AckermannVehicle vehicle = truck();
  expect_refused([&] { (void)vehicle.velocity(0, std::nan(""), 0.0); }, "wheel_speed", "nan");
  expect_refused([&] { (void)vehicle.velocity(0, 1.0, std::nan("")); }, "steering", "nan");
  expect_refused([&] { (void)vehicle.velocity(0, 1.0, -1.6); }, "steering", "-1.6");
  expect_refused([&] { (void)vehicle.velocity(0, 1.0, 3.0); }, "steering", "3.0");
}

TEST(AckermannVehicle, rejects_an_invalid_vehicle) {
  using Config = AckermannVehicle::Config;
  const double infinity = HUGE_VAL;
  expect_refused([] { (void)AckermannVehicle(Config{}); }, "wheel_base_m", "0.0");
  expect_refused([] { (void)AckermannVehicle({-2.0, 0.0, 0.0, 0.0}); }, "wheel_base_m", "-2.0");
  expect_refused([&] { (void)AckermannVehicle({infinity, 0.0, 0.0, 0.0}); }, "wheel_base_m");
  expect_refused([] { (void)AckermannVehicle({2.0, std::nan(""), 0.0, 0.0}); }, "encoder_left_m");
  expect_refused([] { (void)AckermannVehicle({2.0, 0.5, -0.1, 0.0}); }, "sigma_speed_mps", "-0.1");
  expect_refused([] { (void)AckermannVehicle({2.0, 0.5, 0.0, -0.1}); }, "sigma_steering_rad");
  expect_refused([] { (void)AckermannVehicle({1e-320, 0.5, 0.0, 0.0}); }, "wheel_base_m", "1e-3");
  expect_refused([] { (void)AckermannVehicle({1e4, 0.5, 0.0, 0.0}); }, "wheel_base_m", "1e3");
  expect_refused([] { (void)AckermannVehicle({2.0, -1e300, 0.0, 0.0}); }, "encoder_left_m");
  expect_refused([] { (void)AckermannVehicle({2.0, 0.5, 1e200, 0.0}); }, "sigma_speed_mps", "1e6");
  expect_refused([] { (void)AckermannVehicle({2.0, 0.5, 0.0, 1e200}); }, "sigma_steering_rad");
  expect_refused([] { (void)truck().velocity(0, 1e300, 0.1); }, "wheel_speed", "1e6");
}

// Tiny bases and long arms, where results were not finite, are refused; up to those bounds
// everything is finite.
TEST(AckermannVehicle, results_are_finite) {
  const double edge = std::nextafter(0.5 * kPi, 0.0);
  int accepted = 0;
  const auto try_one = [&](const AckermannVehicle::Config& config, double speed, double steering) {
    try {
      const AckermannVehicle vehicle(config);
      const Velocity u = vehicle.velocity(0, speed, steering);
      EXPECT_TRUE(std::isfinite(u.forward) && std::isfinite(u.turn_rate));
      EXPECT_TRUE(vehicle.jacobian(speed, steering).allFinite());
      EXPECT_TRUE(vehicle.covariance(speed, steering).allFinite());
      ++accepted;
    } catch (const std::invalid_argument&) {  // refused
    }
  };
  for (const double base : {1e-320, 1e-3, 2.83, 1e3, 1e300}) {
    for (const double left : {-1e300, -1e3, -0.76, 0.0, 1e-3, 1e3, 1e300}) {
      const double pole = left == 0.0 ? 1.0 : std::atan(base / left);
      for (const double steering : {0.0, edge, -edge, std::nextafter(pole, 0.0), 0.999999 * pole}) {
        for (const double speed : {-1e308, -1e6, 0.0, 1e6, 1e308}) {
          try_one({base, left, 1e6, 1e6}, speed, steering);
          try_one({base, left, 1e200, 1e200}, speed, steering);
        }
      }
    }
  }
  EXPECT_GT(accepted, 100);
}

}  // namespace
}  // namespace locfuse
