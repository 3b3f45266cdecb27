// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/models/motion/constant_velocity.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_refused;
using testing::normal;
using testing::Rng;

const Eigen::VectorXd kState =
    (Eigen::VectorXd(7) << 1.0, 2.0, 3.0, 4.0, 0.5, -1.0, 0.25).finished();

TEST(ConstantVelocityMotion, equals_values_computed_by_hand) {
  const auto step = ConstantVelocityMotion({2.0, 3.0, 0.5}).propagate(kState, 3.0);
  expect_near(step.moved, (Eigen::VectorXd(7) << 2.5, -1.0, 3.0, 4.75, 0.5, -1.0, 0.25).finished(),
              1e-15);
  Eigen::MatrixXd F = Eigen::MatrixXd::Identity(7, 7);
  F(0, 4) = F(1, 5) = F(3, 6) = 3.0;
  expect_near(step.jacobian, F, 0.0);
  Eigen::MatrixXd Q = Eigen::MatrixXd::Zero(7, 7);
  Q(0, 0) = Q(1, 1) = 4.0 * 9.0;  // q T^3 / 3
  Q(0, 4) = Q(4, 0) = Q(1, 5) = Q(5, 1) = 4.0 * 4.5;
  Q(4, 4) = Q(5, 5) = 4.0 * 3.0;
  Q(3, 3) = 9.0 * 9.0;
  Q(3, 6) = Q(6, 3) = 9.0 * 4.5;
  Q(6, 6) = 9.0 * 3.0;
  Q(2, 2) = 0.25 * 3.0;
  expect_near(step.noise, Q, 1e-13);
}

TEST(ConstantVelocityMotion, two_steps_equal_one) {
  const ConstantVelocityMotion model({0.7, 0.3, 0.2});
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Eigen::VectorXd state = testing::random_matrix(rng, 7, 1);
    const double a = testing::uniform(rng, 1e-3, 2.0);
    const double b = testing::uniform(rng, 1e-3, 2.0);
    const auto whole = model.propagate(state, a + b);
    const auto first = model.propagate(state, a);
    const auto second = model.propagate(first.moved, b);
    expect_near(second.moved, whole.moved, 1e-14);
    expect_near(second.jacobian * first.jacobian, whole.jacobian, 1e-14);
    expect_near(second.jacobian * first.noise * second.jacobian.transpose() + second.noise,
                whole.noise, 1e-13);
  }
}

TEST(ConstantVelocityMotion, noise_is_that_of_white_acceleration) {
  // The velocity is a random walk of two hundred steps; position and velocity must vary as in Q.
  constexpr int kRuns = 4000;
  constexpr int kSteps = 200;
  const double sigma = 0.8;
  const double T = 2.0;
  const double h = T / kSteps;
  Rng rng(7);
  Matrix<2, 2> sum = Matrix<2, 2>::Zero();
  for (int run = 0; run < kRuns; ++run) {
    Vector<2> s = Vector<2>::Zero();
    for (int i = 0; i < kSteps; ++i) {
      const double kick = normal(rng, sigma * std::sqrt(h));
      s += Vector<2>(h * (s(1) + 0.5 * kick), kick);
    }
    sum += s * s.transpose() / kRuns;
  }
  const Eigen::MatrixXd Q = ConstantVelocityMotion({sigma, 1.0, 1.0}).propagate(kState, T).noise;
  EXPECT_NEAR(sum(0, 0) / Q(0, 0), 1.0, 0.07);
  EXPECT_NEAR(sum(0, 1) / Q(0, 4), 1.0, 0.07);
  EXPECT_NEAR(sum(1, 1) / Q(4, 4), 1.0, 0.07);
}

TEST(PointMotion, is_the_same_for_each_axis_of_each_point) {
  const double T = 1.7;
  const Vector<12> state = Vector<12>::LinSpaced(-1.0, 2.0);
  const auto step = PointMotion({0.8}).propagate<12>(state, T);
  const auto body = ConstantVelocityMotion({0.8, 1.0, 1.0}).propagate(kState, T);
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(step.moved(i), state(i) + T * state(i + 6), 1e-15);
    EXPECT_EQ(step.moved(i + 6), state(i + 6));
    EXPECT_EQ(step.noise(i, i), body.noise(0, 0));
    EXPECT_EQ(step.noise(i, i + 6), body.noise(0, 4));
    EXPECT_EQ(step.noise(i + 6, i), body.noise(4, 0));
    EXPECT_EQ(step.noise(i + 6, i + 6), body.noise(4, 4));
  }
  EXPECT_NEAR(step.noise.cwiseAbs().sum(),
              6.0 * (body.noise(0, 0) + 2.0 * body.noise(0, 4) + body.noise(4, 4)), 1e-12);
  Matrix<12, 12> A = Matrix<12, 12>::Identity();  // celan2017 eq. (3)
  A.topRightCorner<6, 6>() = T * Matrix<6, 6>::Identity();
  expect_near(step.jacobian, A, 0.0);
  expect_refused([] { (void)PointMotion({0.0}); }, "motion.sigma_velocity_per_sqrt_s", "0.0");
}

TEST(ConstantVelocityMotion, rejects_invalid_noise_and_states) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused([] { ConstantVelocityMotion({0.0, 1.0, 1.0}); }, "sigma_velocity", "0.0");
  expect_refused([&] { ConstantVelocityMotion({1.0, nan, 1.0}); }, "sigma_climb", "nan");
  expect_refused([] { ConstantVelocityMotion({1.0, 1.0, -1.0}); }, "sigma_heading", "-1");
  expect_refused([] { ConstantVelocityMotion({1e200, 1.0, 1.0}); }, "sigma_velocity", "square");
  expect_refused([] { ConstantVelocityMotion({1.0, 1e200, 1.0}); }, "sigma_climb", "square");
  expect_refused([] { ConstantVelocityMotion({1.0, 1.0, 1e200}); }, "sigma_heading", "square");
  expect_refused([] { (void)PointMotion({1e200}); }, "sigma_velocity", "square");
  expect_refused([] { (void)ConstantVelocityMotion().propagate(kState.head(4), 1.0); }, "4", "7");
}

}  // namespace
}  // namespace locfuse
