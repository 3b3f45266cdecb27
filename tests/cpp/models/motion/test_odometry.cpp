// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/messages/messages.hpp"
#include "locfuse/models/motion/odometry.hpp"
#include "support/jacobian.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_pose_near;
using testing::expect_refused;

OdometryMotion::Config all_sigmas() { return {0.03, 0.01, 0.02, 0.04, 0.05, 0.06}; }

TEST(OdometryMotion, moves_in_the_previous_body_frame) {
  const Propagation<Pose2, 3> step =
      OdometryMotion(all_sigmas()).propagate({1.0, 2.0, kPi / 2.0}, {1.0, 0.5, 0.1}, 1.0);
  expect_pose_near(step.moved, {0.5, 3.0, kPi / 2.0 + 0.1}, 1e-15);
}

TEST(OdometryMotion, wraps_the_heading_when_turning_across_the_cut) {
  const Propagation<Pose2, 3> step =
      OdometryMotion(all_sigmas()).propagate({0.0, 0.0, kPi - 0.1}, {0.0, 0.0, 0.3}, 1.0);
  expect_pose_near(step.moved, {0.0, 0.0, -kPi + 0.2}, 1e-15);
}

TEST(OdometryMotion, noise_equals_values_computed_by_hand) {
  const OdometryMotion model(all_sigmas());
  // 4 m ahead, 0.5 rad, 2 s.
  const double along = 0.0009 * 4.0 + 0.0025 * 2.0;
  const double across = 0.0001 * 4.0 + 0.0025 * 2.0;
  const double heading = 0.0004 * 4.0 + 0.0016 * 0.5 + 0.0036 * 2.0;
  const Pose2 motion{4.0, 0.0, -0.5};
  expect_near(model.propagate({0.0, 0.0, 0.0}, motion, 2.0).noise,
              Matrix<3, 3>(Vector<3>(along, across, heading).asDiagonal()), 1e-16);
  expect_near(model.propagate({0.0, 0.0, kPi / 2.0}, motion, 2.0).noise,
              Matrix<3, 3>(Vector<3>(across, along, heading).asDiagonal()), 1e-16);
  const double mean = 0.5 * (along + across);
  const double xy = 0.5 * (along - across);
  expect_near(model.propagate({0.0, 0.0, kPi / 4.0}, motion, 2.0).noise,
              (Matrix<3, 3>() << mean, xy, 0.0, xy, mean, 0.0, 0.0, 0.0, heading).finished(),
              1e-16);
}

TEST(OdometryMotion, jacobian_matches_differences) {
  const OdometryMotion model(all_sigmas());
  testing::Rng rng(11);
  for (const Pose2& pose : testing::poses_to_try()) {
    const Pose2 motion = testing::random_pose(rng, 1.0);
    const Pose2 reference = model.propagate(pose, motion, 0.1).moved;
    const auto f = [&](const Pose2& p) {  // relative to the reference, so that no row jumps
      return local(model.propagate(p, motion, 0.1).moved, reference);
    };
    testing::expect_jacobian<3>(model.propagate(pose, motion, 0.1).jacobian, f, pose);
  }
}

TEST(OdometryMotion, with_errors_equals_values_computed_by_hand) {
  // Reported are 2 m ahead and a quarter turn in 0.5 s; true are 1.1 times the distance and 0.2 rad
  // less of a turn.
  const OdometryMotion model(all_sigmas());
  const OdometryErrors errors{0.1, 0.0, 0.0, 0.4};
  const Propagation<Pose2, 3> step =
      model.propagate({1.0, 2.0, 0.0}, {2.0, 0.0, kPi / 2.0}, 0.5, errors).step;
  expect_pose_near(step.moved,
                   {1.0 + 2.2 * std::cos(0.1), 2.0 - 2.2 * std::sin(0.1), kPi / 2.0 - 0.2}, 1e-15);
  const Propagation<Pose2, 3> askew =
      model.propagate({1.0, 2.0, 0.0}, {2.0, 0.0, 0.0}, 0.5, {0.0, kPi / 2.0, 0.0, 0.0}).step;
  expect_pose_near(askew.moved, {1.0, 4.0, 0.0}, 1e-15);
}

TEST(OdometryMotion, without_errors_it_is_the_reported_motion) {
  const OdometryMotion model(all_sigmas());
  testing::Rng rng(13);
  for (const Pose2& pose : testing::poses_to_try()) {
    const Pose2 motion = testing::random_pose(rng, 1.0);
    const Propagation<Pose2, 3> plain = model.propagate(pose, motion, 0.1);
    const Propagation<Pose2, 3> step = model.propagate(pose, motion, 0.1, OdometryErrors{}).step;
    expect_pose_near(step.moved, plain.moved, 1e-15);
    expect_near(step.jacobian, plain.jacobian, 1e-15);
    expect_near(step.noise, plain.noise, 1e-17);
  }
}

TEST(OdometryMotion, derivatives_by_errors_match_differences) {
  const OdometryMotion model(all_sigmas());
  testing::Rng rng(14);
  for (const Pose2& pose : testing::poses_to_try()) {
    const Pose2 motion = testing::random_pose(rng, 1.0);
    const Vector<4> e(0.1, -0.2, 0.05, 0.3);
    const auto moved = [&](const Vector<4>& off) {
      const Vector<4> f = e + off;
      return model.propagate(pose, motion, 0.5, {f(0), f(1), f(2), f(3)});
    };
    const OdometryMotion::Corrected here = moved(Vector<4>::Zero());
    const Matrix<3, 4> differences = numerical_jacobian<3, 4>(
        [&](const Vector<4>& off) { return local(moved(off).step.moved, here.step.moved); });
    expect_near(here.by_errors, differences, 1e-7);
  }
}

TEST(OdometryMotion, noise_is_symmetric_and_positive_when_moving) {
  const OdometryMotion model(all_sigmas());
  testing::Rng rng(12);
  for (const Pose2& pose : testing::poses_to_try()) {
    const Propagation<Pose2, 3> step = model.propagate(pose, testing::random_pose(rng, 1.0), 0.1);
    EXPECT_TRUE(testing::is_covariance(step.noise)) << step.noise;
  }
}

TEST(OdometryMotion, noise_does_not_depend_on_the_message_rate) {
  const OdometryMotion model(all_sigmas());
  const Pose2 start{1.0, 2.0, 0.3};
  const Propagation<Pose2, 3> whole = model.propagate(start, {1.0, 0.0, 0.0}, 2.0);
  Pose2 pose = start;
  Matrix<3, 3> noise = Matrix<3, 3>::Zero();
  Matrix<3, 3> jacobian = Matrix<3, 3>::Identity();
  for (int i = 0; i < 100; ++i) {
    const Propagation<Pose2, 3> step = model.propagate(pose, {0.01, 0.0, 0.0}, 0.02);
    pose = step.moved;
    noise += step.noise;
    jacobian = (step.jacobian * jacobian).eval();
  }
  expect_pose_near(pose, whole.moved, 1e-13);
  expect_near(noise, whole.noise, 1e-15);
  expect_near(jacobian, whole.jacobian, 1e-13);
}

TEST(OdometryMotion, noise_of_a_turn_does_not_depend_on_the_message_rate) {
  const OdometryMotion model(all_sigmas());
  const Matrix<3, 3> whole = model.propagate({}, {0.0, 0.0, -1.5}, 2.0).noise;
  Pose2 pose;
  Matrix<3, 3> noise = Matrix<3, 3>::Zero();
  for (int i = 0; i < 100; ++i) {
    const Propagation<Pose2, 3> step = model.propagate(pose, {0.0, 0.0, -0.015}, 0.02);
    pose = step.moved;
    noise += step.noise;
  }
  EXPECT_NEAR(pose.heading, -1.5, 1e-13);
  expect_near(noise, whole, 1e-15);
}

TEST(OdometryMotion, jacobians_of_shares_chain_to_that_of_the_arc) {
  const OdometryMotion model(all_sigmas());
  const Pose2 start{1.0, 2.0, 3.0};
  const Pose2 motion{0.8, -0.3, 1.2};
  Pose2 pose = start;
  Matrix<3, 3> jacobian = Matrix<3, 3>::Identity();
  for (int i = 0; i < 10; ++i) {
    const Propagation<Pose2, 3> step = model.propagate(pose, arc_share(motion, 0.1), 0.1);
    pose = step.moved;
    jacobian = (step.jacobian * jacobian).eval();
  }
  const Propagation<Pose2, 3> whole = model.propagate(start, motion, 1.0);
  expect_pose_near(pose, whole.moved, 1e-13);
  expect_near(jacobian, whole.jacobian, 1e-13);
}

TEST(OdometryMotion, step_is_that_of_equations_6_and_7_of_ekim2020) {
  const double theta = 0.7;
  const double trans = 0.5;
  const double rot = -0.3;
  const Pose2 motion = Increment::from_drive_then_turn(0, 1, trans, rot).motion;
  const Propagation<Pose2, 3> step =
      OdometryMotion(all_sigmas()).propagate({1.0, 2.0, theta}, motion, 0.1);
  expect_pose_near(step.moved,
                   {1.0 + trans * std::cos(theta), 2.0 + trans * std::sin(theta), theta + rot},
                   1e-15);
  Matrix<3, 3> A;
  A << 1.0, 0.0, -trans * std::sin(theta),  //
      0.0, 1.0, trans * std::cos(theta),    //
      0.0, 0.0, 1.0;
  expect_near(step.jacobian, A, 1e-15);
}

TEST(OdometryMotion, at_rest_only_noise_over_time_grows) {
  const OdometryMotion model(all_sigmas());
  const Matrix<3, 3> expected = Vector<3>(0.0025 * 3.0, 0.0025 * 3.0, 0.0036 * 3.0).asDiagonal();
  expect_near(model.propagate({0.0, 0.0, 0.0}, {}, 3.0).noise, expected, 1e-16);
  EXPECT_TRUE(OdometryMotion(OdometryMotion::Config{}).propagate({}, {}, 3.0).noise.isZero(0.0));
}

TEST(OdometryMotion, longitudinal_noise_over_time_is_along_the_heading) {
  OdometryMotion::Config config;
  config.sigma_longitudinal_per_sqrt_s = 0.1;
  const Matrix<3, 3> standing =
      OdometryMotion(config).propagate({1.0, 2.0, kPi / 2.0}, {}, 3.0).noise;
  const Matrix<3, 3> ahead = Vector<3>(0.0, 0.01 * 3.0, 0.0).asDiagonal();
  expect_near(standing, ahead, 1e-16);
}

TEST(OdometryMotion, rejects_invalid_sigmas) {
  OdometryMotion::Config config;
  const auto refused = [&](double& field, const char* name) {
    const double kept = field;
    field = -0.25;
    expect_refused([&] { (void)OdometryMotion(config); }, name, "-0.25");
    field = std::nan("");
    expect_refused([&] { (void)OdometryMotion(config); }, name, "nan");
    // Its variance would be infinite.
    field = 1e160;
    expect_refused([&] { (void)OdometryMotion(config); }, name, "1e6");
    field = kept;
  };
  refused(config.sigma_longitudinal_per_sqrt_m, "sigma_longitudinal_per_sqrt_m");
  refused(config.sigma_lateral_per_sqrt_m, "sigma_lateral_per_sqrt_m");
  refused(config.sigma_heading_per_sqrt_m, "sigma_heading_per_sqrt_m");
  refused(config.sigma_heading_per_sqrt_rad, "sigma_heading_per_sqrt_rad");
  refused(config.sigma_longitudinal_per_sqrt_s, "sigma_longitudinal_per_sqrt_s");
  refused(config.sigma_xy_per_sqrt_s, "sigma_xy_per_sqrt_s");
  refused(config.sigma_heading_per_sqrt_s, "sigma_heading_per_sqrt_s");
}

}  // namespace
}  // namespace locfuse
