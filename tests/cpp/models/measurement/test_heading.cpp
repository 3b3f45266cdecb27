// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/models/measurement/heading.hpp"
#include "support/expect.hpp"
#include "support/jacobian.hpp"

namespace locfuse::test_heading {
namespace {

constexpr Heading kCourse{0, 0.5, 0.1, true};

HeadingModel::Config mounted() {
  HeadingModel::Config config;
  config.offset_rad = 0.3;
  config.antenna_forward_m = 0.8;
  config.antenna_left_m = -0.2;
  return config;
}

TEST(HeadingModel, reads_the_heading_and_what_its_sensor_is_turned_by) {
  const HeadingModel model(mounted());
  const auto lin = model.linearize({1.0, 2.0, 0.4}, 0.1, {0, 1.0, 0.2}, {});
  ASSERT_TRUE(lin);
  EXPECT_NEAR(lin->residual(0), 0.2, 1e-15);
  EXPECT_NEAR(lin->noise(0), 0.04, 1e-15);
  EXPECT_EQ(lin->jacobian, (Matrix<1, 4>(0.0, 0.0, 1.0, 1.0)));
  const auto across = model.linearize({0.0, 0.0, 3.0}, {0, -3.0 + 0.3});
  EXPECT_NEAR(across->residual(0), 2.0 * kPi - 6.0, 1e-12);
  EXPECT_NEAR(across->noise(0), 0.1 * 0.1, 1e-15);
}

TEST(HeadingModel, a_sigma_has_a_minimum) {
  EXPECT_NEAR(HeadingModel().linearize({}, {0, 0.0, 1e-9})->noise(0), 1e-2, 1e-15);
}

TEST(HeadingModel, jacobian_equals_differences) {
  const HeadingModel model(mounted());
  const Pose2 rate{0.7, 0.1, 0.4};
  for (const Pose2& pose : testing::poses_to_try()) {
    for (const Heading& z : {Heading{0, 0.5, 0.1}, kCourse}) {
      const auto lin = model.linearize(pose, z, rate);
      ASSERT_TRUE(lin);
      testing::expect_jacobian<1>(
          lin->jacobian,
          [&](const Pose2& at) {
            // The measurement itself, continuous about this pose.
            return Vector<1>(
                wrap_angle(lin->residual(0) - model.linearize(at, z, rate)->residual(0)));
          },
          pose);
      const auto more = model.linearize(pose, 1e-3, z, rate);
      EXPECT_NEAR(wrap_angle(model.linearize(pose, 0.0, z, rate)->residual(0) - more->residual(0)),
                  1e-3 * more->jacobian(3), 1e-12);
    }
  }
}

/// Written out another way: the velocity of the antenna in world by differences of where it is.
TEST(HeadingModel, a_course_is_where_the_antenna_travels) {
  const HeadingModel model(mounted());
  const Vector<2> antenna(0.8, -0.2);
  for (const Vector<3>& twist :
       {Vector<3>(1.0, 0.0, 0.0), Vector<3>(-1.0, 0.0, 0.0), Vector<3>(1.0, 0.0, 1.5),
        Vector<3>(0.0, 0.0, -2.0), Vector<3>(0.5, 0.5, 0.3)}) {
    constexpr double kHalf = 1e-4;
    const Pose2 here{3.0, -1.0, 0.7};
    const auto moved = [&](double s) {
      return here * arc(s * twist.x(), s * twist.y(), s * twist.z());
    };
    const Vector<2> way = moved(kHalf).act(antenna) - moved(-kHalf).act(antenna);
    const double course = std::atan2(way.y(), way.x());
    const auto lin =
        model.linearize(here, {0, course, 0.1, true}, {twist.x(), twist.y(), twist.z()});
    ASSERT_TRUE(lin);
    EXPECT_NEAR(lin->residual(0), 0.0, 1e-7) << twist.transpose();
    EXPECT_EQ(lin->jacobian, (Matrix<1, 3>(0.0, 0.0, 1.0)));
    EXPECT_GT(lin->noise(0), 0.01);
  }
}

TEST(HeadingModel, a_course_of_one_that_hardly_moves_says_nothing) {
  const HeadingModel model;
  EXPECT_FALSE(model.linearize({}, kCourse));
  EXPECT_FALSE(model.linearize({}, kCourse, {0.49, 0.0, 0.0}));
  EXPECT_TRUE(model.linearize({}, kCourse, {0.51, 0.0, 0.0}));
  EXPECT_TRUE(model.linearize({}, kCourse, {-0.51, 0.0, 0.0}));
  EXPECT_FALSE(model.linearize({}, {0, 0.5, 0.34, true}, {2.0, 0.0, 0.0}));
}

TEST(HeadingModel, refuses_numbers_out_of_range) {
  const auto with = [](double HeadingModel::Config::*key, double value) {
    HeadingModel::Config config;
    config.*key = value;
    return config;
  };
  using Config = HeadingModel::Config;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  testing::expect_refused([&] { HeadingModel(with(&Config::sigma_rad, 0.0)); },
                          "heading.sigma_rad");
  testing::expect_refused([&] { HeadingModel(with(&Config::least_sigma_rad, -1.0)); },
                          "heading.least_sigma_rad");
  testing::expect_refused([&] { HeadingModel(with(&Config::offset_rad, kNone)); }, "offset_rad");
  testing::expect_refused([&] { HeadingModel(with(&Config::min_speed_mps, 0.0)); },
                          "min_speed_mps");
}

}  // namespace
}  // namespace locfuse::test_heading
