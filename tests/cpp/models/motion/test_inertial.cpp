// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/geometry/rotation.hpp"
#include "locfuse/models/motion/inertial.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_inertial {
namespace {

using testing::expect_near;
using testing::expect_refused;
using testing::Rng;
using Error = Vector<InertialMotion::kVariables>;
using State = InertialMotion::State;

Vector<3> any(Rng& rng, double extent) {
  return extent * Vector<3>(testing::random_matrix(rng, 3, 1));
}

State any_state(Rng& rng) {
  return {any(rng, 10.0), any(rng, 3.0), rotation_by(any(rng, 1.8)), any(rng, 0.1), any(rng, 0.5)};
}

State moved_by(const State& state, const Error& error) {
  State other = state;
  other.position += error(InertialMotion::kPosition);
  other.velocity += error(InertialMotion::kVelocity);
  other.attitude = rotation_by(error(InertialMotion::kRotation)) * state.attitude;
  other.rate_bias += error(InertialMotion::kRateBias);
  other.force_bias += error(InertialMotion::kForceBias);
  return other;
}

Error difference(const State& a, const State& b) {
  Error error;
  error(InertialMotion::kPosition) = a.position - b.position;
  error(InertialMotion::kVelocity) = a.velocity - b.velocity;
  error(InertialMotion::kRotation) = rotation_vector(a.attitude * b.attitude.transpose());
  error(InertialMotion::kRateBias) = a.rate_bias - b.rate_bias;
  error(InertialMotion::kForceBias) = a.force_bias - b.force_bias;
  return error;
}

TEST(InertialMotion, a_body_at_rest_stays_where_it_is) {
  Rng rng(1);
  State state = any_state(rng);
  state.velocity.setZero();
  const Vector<3> up = state.attitude.transpose() * Vector<3>(0.0, 0.0, InertialMotion::kGravity);
  const auto step = InertialMotion().propagate(state, state.rate_bias, up + state.force_bias, 0.01);
  expect_near(difference(step.moved, state), Error::Zero(), 1e-15);
}

TEST(InertialMotion, a_circle_comes_back_to_where_it_began) {
  // 2 m about the origin in 6 s, nose ahead and leaning by 0.4 rad: the rate and the force are
  // constant in body.
  const double rate = 2.0 * std::acos(-1.0) / 6.0;
  State state;
  state.position << 2.0, 0.0, 1.0;
  state.velocity << 0.0, 2.0 * rate, 0.0;
  state.attitude = rotation_of(0.4, 0.0, std::acos(0.0));
  const State start = state;
  const Vector<3> turn = state.attitude.transpose() * Vector<3>(0.0, 0.0, rate);
  const Vector<3> force =
      state.attitude.transpose() * Vector<3>(-2.0 * rate * rate, 0.0, InertialMotion::kGravity);
  const InertialMotion motion;
  for (int i = 0; i < 6000; ++i) {
    state = motion.propagate(state, turn, force, 1e-3).moved;
  }
  expect_near(difference(state, start), Error::Zero(), 1e-5);
}

TEST(InertialMotion, jacobian_is_that_of_differences) {
  Rng rng(2);
  const InertialMotion motion;
  constexpr double kSmall = 1e-6;
  for (int i = 0; i < 50; ++i) {
    const State state = any_state(rng);
    const Vector<3> rate = any(rng, 2.0);
    const Vector<3> force = any(rng, 15.0);
    const auto step = motion.propagate(state, rate, force, 0.01);
    for (int column = 0; column < InertialMotion::kVariables; ++column) {
      const Error by = kSmall * Error::Unit(column);
      const State ahead = motion.propagate(moved_by(state, by), rate, force, 0.01).moved;
      const State behind = motion.propagate(moved_by(state, -by), rate, force, 0.01).moved;
      const Error slope = difference(ahead, behind) / (2.0 * kSmall);
      // As if the body turned by half of it at once: an error of third order.
      expect_near(step.jacobian.col(column), slope, 1e-5);
    }
  }
}

TEST(InertialMotion, noise_is_that_of_white_rates_and_forces) {
  constexpr int kRuns = 4000;
  constexpr int kSteps = 100;
  InertialMotion::Config config;
  config.sigma_turn_per_sqrt_s = 0.02;
  config.sigma_velocity_per_sqrt_s = 0.3;
  config.sigma_scale = 1e-9;
  const InertialMotion motion(config);
  const State start;
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(15, 15);
  const Vector<3> up(0.0, 0.0, InertialMotion::kGravity);
  for (int i = 0; i < kSteps; ++i) {
    const auto step = motion.propagate(start, Vector<3>::Zero(), up, 0.01);
    P = step.jacobian * P * step.jacobian.transpose() + step.noise;
  }
  Rng rng(3);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(9, 9);
  const std::vector<int> rows{0, 1, 3, 4, 5, 6, 7, 8, 2};
  for (int run = 0; run < kRuns; ++run) {
    State state = start;
    for (int i = 0; i < kSteps; ++i) {
      Vector<3> rate;
      Vector<3> force = up;
      for (int axis = 0; axis < 3; ++axis) {
        rate(axis) = testing::normal(rng, 0.02 / std::sqrt(0.01));
        force(axis) += testing::normal(rng, 0.3 / std::sqrt(0.01));
      }
      state = motion.propagate(state, rate, force, 0.01).moved;
    }
    const Error error = difference(state, start);
    sum += error(rows) * error(rows).transpose() / kRuns;
  }
  for (int i = 0; i < 9; ++i) {
    const double expected = P(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(i)]);
    EXPECT_NEAR(sum(i, i) / expected, 1.0, 0.1) << i;  // 4 sigmas of 4,000 runs
  }
}

TEST(InertialMotion, a_sensor_that_is_mounted_askew_measures_in_its_own_axes) {
  InertialMotion::Config config;
  config.mount << std::acos(-1.0), 0.0, 0.5;  // upside down, and turned
  const InertialMotion motion(config);
  expect_near(motion.in_body({0.0, 0.0, -9.8}), Vector<3>(0.0, 0.0, 9.8), 1e-14);
  expect_near(motion.in_body({1.0, 0.0, 0.0}), Vector<3>(std::cos(0.5), std::sin(0.5), 0.0), 1e-14);
}

TEST(InertialMotion, refuses_noise_and_mounts_that_are_none) {
  InertialMotion::Config config;
  config.sigma_velocity_per_sqrt_s = 0.0;
  expect_refused([&] { InertialMotion{config}; }, "imu.sigma_velocity_per_sqrt_s", "> 0");
  config = {};
  config.sigma_bias_radps = -1.0;
  expect_refused([&] { InertialMotion{config}; }, "imu.sigma_bias_radps");
  config = {};
  config.mount.x() = std::numeric_limits<double>::infinity();
  expect_refused([&] { InertialMotion{config}; }, "imu.mount");
}

}  // namespace
}  // namespace locfuse::test_inertial
