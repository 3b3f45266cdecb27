// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/models/measurement/range_bearing.hpp"
#include "support/jacobian.hpp"

namespace locfuse::test_range_bearing_in_space {
namespace {

using testing::expect_near;
using testing::expect_refused;
using testing::Rng;
using testing::same_bits;
using testing::uniform;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const Pose2 kMount{0.3, -0.2, 0.4};

RangeBearing seen(std::optional<double> range, std::optional<double> bearing,
                  std::optional<double> elevation) {
  return {0, {}, range, bearing, {}, elevation, {}};
}

/// Compares the Jacobian by pose and height with differences.
void expect_jacobian_in_space(const RangeBearingModel& model, const Pose2& pose, double height,
                              const Vector<3>& landmark, double tolerance = 1e-7) {
  const Vector<3> here = model.predict(pose, height, landmark);
  const Matrix<3, 4> differences = numerical_jacobian<3, 4>([&](const Vector<4>& delta) {
    const Pose2 moved = retract(pose, delta.head<3>());
    Vector<3> there = model.predict(moved, height + delta(3), landmark) - here;
    there(1) = wrap_angle(there(1));
    return there;
  });
  const auto lin = model.linearize(pose, height, landmark, seen(here(0), here(1), here(2)));
  ASSERT_TRUE(lin.has_value());
  expect_near(lin->residual, Vector<3>(Vector<3>::Zero()), 1e-12);
  expect_near(lin->jacobian, differences, tolerance);
}

TEST(RangeBearingModel, in_space_equals_values_computed_by_hand) {
  // The sensor is at (1.5, 2, 10), looking north; the landmark is 3 m east, 4 m north and 12 m
  // down.
  const RangeBearingModel model({0.1, 0.02}, {0.0, -0.5, 0.0}, {1.0, 0.05});
  const Pose2 pose{1.0, 2.0, kPi / 2.0};
  const Vector<3> landmark(4.5, 6.0, -2.0);
  expect_near(model.predict(pose, 9.0, landmark),
              Vector<3>(13.0, -std::atan2(3.0, 4.0), -std::atan2(12.0, 5.0)), 1e-14);
  const auto lin = model.linearize(pose, 9.0, landmark, seen(13.5, 0.0, -1.0));
  ASSERT_TRUE(lin.has_value());
  expect_near(lin->residual, Vector<3>(0.5, std::atan2(3.0, 4.0), std::atan2(12.0, 5.0) - 1.0),
              1e-14);
  Matrix<3, 4> expected;
  expected << -3.0 / 13.0, -4.0 / 13.0, -2.0 / 13.0, 12.0 / 13.0,  //
      4.0 / 25.0, -3.0 / 25.0, -1.0 - 1.5 / 25.0, 0.0,             //
      -12.0 / 169.0 * 0.6, -12.0 / 169.0 * 0.8, -12.0 / 169.0 * 0.4, -5.0 / 169.0;
  expect_near(lin->jacobian, expected, 1e-14);
  expect_near(lin->noise, Matrix<3, 3>(Vector<3>(0.01, 0.0004, 0.0025).asDiagonal()), 1e-16);
}

TEST(RangeBearingModel, jacobian_with_height_matches_differences) {
  const RangeBearingModel model({}, kMount, {0.5, 0.02});
  Rng rng(3);
  for (const Pose2& pose : testing::poses_to_try()) {
    expect_jacobian_in_space(model, pose, uniform(rng, -20.0, 20.0), {3.0, -2.0, 1.5});
  }
  // A decimetre beside a landmark 5 m below.
  expect_jacobian_in_space(RangeBearingModel(), {3.1, -2.0, -kPi}, 6.5, {3.0, -2.0, 1.5}, 1e-6);
}

TEST(RangeBearingModel, in_space_any_parts_are_their_rows) {
  const RangeBearingModel model({}, kMount, {0.5, 0.03});
  const Pose2 pose{1.0, 2.0, 3.0};
  const Vector<3> landmark(-4.0, 1.0, 3.0);
  RangeBearing all = seen(2.0, 0.3, 0.1);
  all.covariance = (Matrix<2, 2>() << 0.04, 0.001, 0.001, 0.01).finished();
  all.sigma_elevation = 0.2;
  const auto whole = model.linearize(pose, 1.0, landmark, all);
  ASSERT_EQ(whole->residual.size(), 3);
  expect_near(whole->noise.topLeftCorner(2, 2), *all.covariance, 0.0);
  EXPECT_NEAR(whole->noise(2, 2), 0.04, 1e-16);
  for (int parts = 0; parts < 8; ++parts) {
    RangeBearing z = all;
    std::vector<int> rows;
    for (int row = 0; row < 3; ++row) {
      if ((parts >> row) % 2 == 1) {
        rows.push_back(row);
      }
    }
    z.range = parts % 2 == 1 ? z.range : std::nullopt;
    z.bearing = (parts >> 1) % 2 == 1 ? z.bearing : std::nullopt;
    z.elevation = (parts >> 2) % 2 == 1 ? z.elevation : std::nullopt;
    const auto lin = model.linearize(pose, 1.0, landmark, z);
    ASSERT_EQ(lin.has_value(), parts > 0);
    if (lin) {
      expect_near(lin->residual, whole->residual(rows), 0.0);
      expect_near(lin->jacobian, whole->jacobian(rows, Eigen::all), 0.0);
      expect_near(lin->noise, whole->noise(rows, rows), 0.0);
    }
  }
}

TEST(RangeBearingModel, at_the_height_of_the_sensor_equals_the_plane_to_the_bit) {
  const RangeBearingModel model({}, kMount);
  for (const Pose2& pose : testing::poses_to_try()) {
    const auto plane = model.linearize(pose, {3.0, -2.0}, seen(4.0, 0.5, {}));
    const auto space = model.linearize(pose, 0.0, {3.0, -2.0, 0.0}, seen(4.0, 0.5, {}));
    EXPECT_TRUE(same_bits(plane->residual, space->residual));
    EXPECT_TRUE(same_bits(plane->jacobian, space->jacobian.leftCols<3>()));
    EXPECT_TRUE(same_bits(plane->noise, space->noise));
    EXPECT_EQ(space->jacobian.col(3).norm(), 0.0);
  }
}

TEST(RangeBearingModel, a_landmark_straight_below_has_no_direction) {
  const Pose2 pose{3.0, -2.0, 1.0};
  EXPECT_FALSE(
      RangeBearingModel().linearize(pose, 5.0, {3.0, -2.0, 0.0}, seen(5.0, {}, {})).has_value());
}

TEST(RangeBearingModel, rejects_invalid_noise_and_mounts_in_space) {
  expect_refused([] { RangeBearingModel({}, {}, {0.0, 0.0}); }, "sigma_elevation_rad", "0.0");
  expect_refused([] { RangeBearingModel({}, {}, {kNan, 0.1}); }, "pose in body");
}

}  // namespace
}  // namespace locfuse::test_range_bearing_in_space
