// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/models/measurement/velocity.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_velocity {
namespace {

using testing::expect_near;
using testing::expect_refused;
using testing::Rng;
using testing::uniform;

TEST(VelocityModel, equals_values_computed_by_hand) {
  // Heading north at 2 m/s, turning left at 0.5 rad/s; the point is 1 m ahead and 2 m to the left.
  const Vector<2> v = VelocityModel::predict(kPi / 2.0, {2.0, 0.0, 0.5}, {1.0, 2.0});
  expect_near(v, Vector<2>(-0.5, 1.0), 1e-15);
}

TEST(VelocityModel, is_the_derivative_of_a_point_on_an_arc) {
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Pose2 pose = testing::random_pose(rng);
    const Vector<3> twist = testing::random_matrix(rng, 3, 1);
    const Vector<2> point = testing::random_matrix(rng, 2, 1);
    const double h = 1e-6;
    const Vector<3> ahead = h * twist;
    const Vector<2> difference = (pose * arc(ahead.x(), ahead.y(), ahead.z())).act(point) -
                                 (pose * arc(-ahead.x(), -ahead.y(), -ahead.z())).act(point);
    expect_near(VelocityModel::predict(pose.heading, twist, point), difference / (2.0 * h), 1e-8);
  }
}

TEST(VelocityModel, noise_of_the_wheels_is_shared_by_the_points) {
  const VelocityModel::Config config{0.2, 0.1, 0.3, 0.05};
  const VelocityModel model(config);
  Matrix<2, 3> points;
  points << 0.6, -0.3, -0.3, 0.0, 0.25, -0.25;
  const Vector<3> twist(0.4, 0.0, 0.2);
  const Vector<6> velocities = Vector<6>::LinSpaced(0.0, 0.5);
  const auto lin = model.linearize<6>(velocities, 0.7, twist, points);
  expect_near(lin.jacobian, Matrix<6, 6>::Identity(), 0.0);
  Rng rng(8);
  constexpr int kRuns = 20000;
  Matrix<6, 6> sum = Matrix<6, 6>::Zero();
  for (int run = 0; run < kRuns; ++run) {
    const Vector<3> wrong = twist + Vector<3>{testing::normal(rng, 0.2), testing::normal(rng, 0.1),
                                              testing::normal(rng, 0.3)};
    Vector<6> off;
    for (int k = 0; k < 3; ++k) {
      off.segment<2>(2 * k) = VelocityModel::predict(0.7, wrong, points.col(k)) -
                              VelocityModel::predict(0.7, twist, points.col(k));
    }
    for (int k = 0; k < 6; ++k) {
      off(k) += testing::normal(rng, 0.05);
    }
    sum += off * off.transpose() / kRuns;
  }
  expect_near(lin.noise, sum, 0.0025);  // 4 sigma of the largest
  for (int k = 0; k < 3; ++k) {
    const Vector<2> expected = VelocityModel::predict(0.7, twist, points.col(k));
    expect_near(lin.residual.segment<2>(2 * k), expected - velocities.segment<2>(2 * k), 1e-15);
  }
}

TEST(VelocityModel, rejects_invalid_sigmas) {
  expect_refused([] { (void)VelocityModel({-0.1, 0.0, 0.0, 0.1}); }, "sigma_forward_mps", "-0.1");
  expect_refused([] { (void)VelocityModel({0.1, std::nan(""), 0.0, 0.1}); }, "sigma_lateral_mps");
  expect_refused([] { (void)VelocityModel({0.1, 0.0, -1.0, 0.1}); }, "sigma_turn_rate_radps");
  expect_refused([] { (void)VelocityModel({0.1, 0.0, 0.0, 0.0}); }, "sigma_point_mps", "> 0");
  expect_refused([] { (void)VelocityModel({1e200, 0.0, 0.0, 0.1}); }, "sigma_forward", "square");
  expect_refused([] { (void)VelocityModel({0.1, 1e200, 0.0, 0.1}); }, "sigma_lateral", "square");
  expect_refused([] { (void)VelocityModel({0.1, 0.0, 1e200, 0.1}); }, "sigma_turn_rate", "square");
  expect_refused([] { (void)VelocityModel({0.1, 0.0, 0.0, 1e200}); }, "sigma_point", "square");
  EXPECT_NO_THROW((void)VelocityModel({0.0, 0.0, 0.0, 0.1}));
}

}  // namespace
}  // namespace locfuse::test_velocity
