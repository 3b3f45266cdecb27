// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/models/measurement/range_bearing.hpp"
#include "support/jacobian.hpp"

namespace locfuse::test_range_bearing {
namespace {

using testing::expect_jacobian;
using testing::expect_near;
using testing::expect_refused;
using testing::Rng;
using testing::uniform;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const Pose2 kMount{0.3, -0.2, 0.4};

RangeBearing seen(std::optional<double> range, std::optional<double> bearing) {
  return {0, {}, range, bearing, {}};
}

TEST(RangeBearingModel, equals_values_computed_by_hand) {
  // The sensor is at (1.5, 2), looking north; the landmark is 3 m east and 4 m north of it.
  const RangeBearingModel model({0.1, 0.02}, {0.0, -0.5, 0.0});
  const Pose2 pose{1.0, 2.0, kPi / 2.0};
  const Vector<2> landmark(4.5, 6.0);
  expect_near(model.predict(pose, landmark), Vector<2>(5.0, -std::atan2(3.0, 4.0)), 1e-14);
  const auto lin = model.linearize_both(pose, landmark, seen(5.2, 0.0));
  ASSERT_TRUE(lin.has_value());
  expect_near(lin->residual, Vector<2>(0.2, std::atan2(3.0, 4.0)), 1e-14);
  // d = (3, 4); range falls by the direction, bearing by the perpendicular over the range.
  Matrix<2, 3> expected;
  expected << -0.6, -0.8, -0.4, 4.0 / 25.0, -3.0 / 25.0, -1.0 - 1.5 / 25.0;
  expect_near(lin->jacobian, expected, 1e-14);
  expect_near(lin->noise, Matrix<2, 2>(Vector<2>(0.01, 0.0004).asDiagonal()), 1e-16);
}

TEST(RangeBearingModel, jacobian_matches_differences) {
  const RangeBearingModel model({}, kMount);
  const Vector<2> landmark(3.0, -2.0);
  for (const Pose2& pose : testing::poses_to_try()) {
    const Vector<2> here = model.predict(pose, landmark);
    const auto h = [&](const Pose2& p) {
      const Vector<2> there = model.predict(p, landmark);
      return Vector<2>(there.x(), here.y() + angle_difference(there.y(), here.y()));
    };
    const auto lin = model.linearize_with_landmark(pose, landmark, seen(1.0, 1.0));
    ASSERT_TRUE(lin.has_value());
    expect_jacobian<2>(Matrix<2, 3>(lin->jacobian.leftCols<3>()), h, pose);
    const Matrix<2, 2> by_landmark = numerical_jacobian<2, 2>(
        [&](const Vector<2>& delta) {
          const Vector<2> there = model.predict(pose, landmark + delta);
          return Vector<2>(there.x() - here.x(), angle_difference(there.y(), here.y()));
        },
        1e-6);
    expect_near(Matrix<2, 2>(lin->jacobian.rightCols<2>()), by_landmark, 1e-7);
  }
}

TEST(RangeBearingModel, with_errors_equals_values_computed_by_hand) {
  // A second ago, before it had driven 2 m east and turned, it was at (1, 2) looking north.
  const RangeBearingModel model({0.1, 0.02}, {0.0, -0.3, 0.1});
  const LandmarkErrors errors{{0.0, -0.2, -0.1}, 0.25, 0.1, 1.0};
  const Pose2 then{1.0, 2.0, kPi / 2.0};
  const Pose2 rate{1.0, -2.0, 0.3};
  const auto lin = model.linearize_with_errors(then * arc(rate.x, rate.y, rate.heading), {4.5, 6.0},
                                               seen(6.0, 0.0), errors, rate);
  ASSERT_TRUE(lin.has_value());
  EXPECT_NEAR(lin->residual(0), 6.0 - (1.1 * 5.0 + 0.25), 1e-12);
  EXPECT_NEAR(lin->residual(1), std::atan2(3.0, 4.0), 1e-12);
}

TEST(RangeBearingModel, without_errors_it_is_the_plain_model) {
  const RangeBearingModel model({}, kMount);
  const Vector<2> landmark(3.0, -2.0);
  for (const Pose2& pose : testing::poses_to_try()) {
    for (const RangeBearing& z : {seen(1.0, 1.0), seen(1.0, {}), seen({}, 1.0)}) {
      const auto plain = model.linearize(pose, landmark, z);
      const auto lin = model.linearize_with_errors(pose, landmark, z, {}, {1.0, 0.2, 0.3});
      ASSERT_TRUE(lin.has_value());
      expect_near(lin->residual, plain->residual, 1e-12);
      expect_near(lin->jacobian.leftCols<3>(), plain->jacobian, 1e-12);
      expect_near(lin->noise, plain->noise, 0.0);
    }
  }
}

TEST(RangeBearingModel, derivatives_by_pose_and_errors_match_differences) {
  const RangeBearingModel model({}, kMount);
  const Vector<2> landmark(3.0, -2.0);
  const Pose2 rate{0.7, -0.1, 0.4};
  Vector<6> e;
  e << 0.05, -0.04, 0.1, 0.2, 0.05, 0.3;
  for (const Pose2& pose : testing::poses_to_try()) {
    const auto at = [&](const Vector<9>& off) {
      const Vector<6> f = e + off.tail<6>();
      return model.linearize_with_errors(retract(pose, off.head<3>()), landmark, seen(1.0, 1.0),
                                         {{f(0), f(1), f(2)}, f(3), f(4), f(5)}, rate);
    };
    const auto lin = at(Vector<9>::Zero());
    ASSERT_TRUE(lin.has_value());
    const Matrix<2, 9> differences = numerical_jacobian<2, 9>([&](const Vector<9>& off) {
      const Vector<2> residual = at(off)->residual;
      return Vector<2>(lin->residual(0) - residual(0),
                       angle_difference(lin->residual(1), residual(1)));
    });
    expect_near(Matrix<2, 9>(lin->jacobian), differences, 1e-6);
  }
}

TEST(RangeBearingModel, range_or_bearing_alone_is_one_row) {
  const RangeBearingModel model({}, kMount);
  const Pose2 pose{1.0, 2.0, 3.0};
  const Vector<2> landmark(-4.0, 1.0);
  const auto both = model.linearize(pose, landmark, seen(2.0, 0.3));
  const auto range = model.linearize(pose, landmark, seen(2.0, {}));
  const auto bearing = model.linearize(pose, landmark, seen({}, 0.3));
  ASSERT_EQ(range->residual.size(), 1);
  ASSERT_EQ(bearing->residual.size(), 1);
  EXPECT_EQ(range->residual(0), both->residual(0));
  EXPECT_EQ(bearing->residual(0), both->residual(1));
  expect_near(range->jacobian, both->jacobian.row(0), 0.0);
  expect_near(bearing->jacobian, both->jacobian.row(1), 0.0);
  EXPECT_EQ(range->noise(0), both->noise(0, 0));
  EXPECT_EQ(bearing->noise(0), both->noise(1, 1));
  EXPECT_FALSE(model.linearize_both(pose, landmark, seen(2.0, {})).has_value());
}

TEST(RangeBearingModel, the_residual_of_a_bearing_is_wrapped) {
  const RangeBearingModel model({}, {});
  for (const double bearing : {-kPi, std::nextafter(kPi, 0.0), kPi - 0.01, -kPi + 0.01}) {
    const auto lin = model.linearize({}, {-2.0, 0.0}, seen({}, bearing));  // straight behind
    EXPECT_LE(std::abs(lin->residual(0)), 0.0100001) << bearing;
  }
}

TEST(RangeBearingModel, a_landmark_on_the_sensor_has_no_direction) {
  const RangeBearingModel model({}, kMount);
  const Pose2 pose{1.0, 2.0, 0.0};
  EXPECT_FALSE(model.linearize(pose, pose.act(kMount.position()), seen(0.0, 0.0)).has_value());
}

TEST(RangeBearingModel, place_inverts_predict) {
  const RangeBearingModel model({}, kMount);
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Pose2 pose = testing::random_pose(rng);
    const Vector<2> z{uniform(rng, 0.1, 20.0), uniform(rng, -kPi, kPi)};
    const auto placed = model.place(pose, seen(z.x(), z.y()));
    ASSERT_TRUE(placed.has_value());
    const Vector<2> again = model.predict(pose, placed->position);
    EXPECT_NEAR(again.x(), z.x(), 1e-12);
    EXPECT_NEAR(angle_difference(again.y(), z.y()), 0.0, 1e-12);
    expect_jacobian<2>(
        placed->by_pose,
        [&](const Pose2& p) { return model.place(p, seen(z.x(), z.y()))->position; }, pose);
    const Matrix<2, 2> by_observation = numerical_jacobian<2, 2>(
        [&](const Vector<2>& delta) {
          return Vector<2>(model.place(pose, seen(z.x() + delta.x(), z.y() + delta.y()))->position -
                           placed->position);
        },
        1e-6);
    expect_near(placed->by_observation, by_observation, 1e-7);
  }
  EXPECT_FALSE(model.place({}, seen(2.0, {})).has_value());
}

TEST(RangeBearingModel, noise_of_a_range_may_grow_with_it) {
  const RangeBearingModel model({0.3, 0.02, 0.1}, {});
  const RangeBearing z = seen(4.0, 0.0);
  EXPECT_NEAR(model.noise(z)(0, 0), 0.09 + 0.16, 1e-15);
  EXPECT_NEAR(model.linearize_both({}, {5.0, 0.0}, z)->noise(0, 0), 0.25, 1e-15);
  EXPECT_NEAR(model.linearize({}, {5.0, 0.0}, seen({}, 0.0))->noise(0, 0), 0.0004, 1e-18);
}

TEST(RangeBearingModel, an_observation_may_have_its_own_covariance) {
  RangeBearing z = seen(2.0, 0.0);
  z.covariance = (Matrix<2, 2>() << 0.04, 0.001, 0.001, 0.01).finished();
  const RangeBearingModel model;
  expect_near(model.linearize({}, {2.0, 0.0}, z)->noise, *z.covariance, 0.0);
}

TEST(RangeBearingModel, rejects_invalid_noise) {
  expect_refused([] { RangeBearingModel({0.0, 0.02}, {}); }, "sigma_range_m", "0.0");
  expect_refused([] { RangeBearingModel({0.1, kNan}, {}); }, "sigma_bearing_rad", "nan");
  for (const double sigma : {1e200, 1e-200}) {
    expect_refused([sigma] { RangeBearingModel({sigma, 0.02}, {}); }, "sigma_range_m", "square");
  }
  expect_refused([] { RangeBearingModel({0.1, 1e200}, {}); }, "sigma_bearing_rad", "square");
  for (const double share : {-0.1, kNan, 1e200}) {
    expect_refused([share] { RangeBearingModel({0.1, 0.02, share}, {}); }, "sigma_range_relative");
  }
  expect_refused([] { RangeBearingModel({}, {kNan, 0.0, 0.0}); }, "pose in body");
}

}  // namespace
}  // namespace locfuse::test_range_bearing
