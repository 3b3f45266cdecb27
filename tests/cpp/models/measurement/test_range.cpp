// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/models/measurement/range.hpp"
#include "support/jacobian.hpp"

namespace locfuse::test_range {
namespace {

using testing::expect_jacobian;
using testing::expect_near;
using testing::expect_refused;

std::shared_ptr<const AnchorMap> one_anchor(const Anchor& anchor) {
  return std::make_shared<AnchorMap>(std::vector<Anchor>{anchor});
}

Tag tag(Id id) { return {id, Vector<3>::Zero()}; }

Range range_of(double range, Id tag = 0, Id anchor = 0) { return {0, tag, anchor, range, {}}; }

void expect_jacobian_at(const RangeModel& model, const Pose2& pose, double tolerance = 1e-7,
                        double step = 1e-6) {
  const auto h = [&](const Pose2& p) { return Vector<1>(*model.predict(p, range_of(1.0))); };
  const auto lin = model.linearize(pose, range_of(1.0));
  ASSERT_TRUE(lin.has_value());
  expect_jacobian<1>(lin->jacobian, h, pose, tolerance, step);
}

TEST(RangeModel, equals_values_computed_by_hand) {
  // The tag is at (1.5, 2, 1), so the anchor is 3 m, 4 m, 0 m away: 5 m, measured as 1.1 * 5 + 0.3.
  const RangeModel model({0.1, 0.02}, one_anchor({9, {4.5, 6.0, 1.0}, 0.3, 1.1}),
                         {{4, {0.5, 0.0, 1.0}}});
  const Pose2 pose{1.0, 2.0, 0.0};
  EXPECT_NEAR(*model.predict(pose, range_of(6.0, 4, 9)), 5.8, 1e-14);
  const auto lin = model.linearize(pose, range_of(6.0, 4, 9));
  ASSERT_TRUE(lin.has_value());
  EXPECT_NEAR(lin->residual(0), 0.2, 1e-14);
  expect_near(lin->jacobian, Matrix<1, 3>(-0.66, -0.88, -0.44), 1e-14);
}

TEST(RangeModel, measures_in_three_dimensions) {
  const RangeModel model({}, one_anchor({0, {3.0, 0.0, 5.0}}), {{0, {0.0, 0.0, 1.0}}});
  EXPECT_NEAR(*model.predict({0.0, 0.0, 1.0}, range_of(0.0)), 5.0, 1e-14);
  const auto lin = model.linearize({0.0, 0.0, 1.0}, range_of(5.5));
  expect_near(lin->jacobian, Matrix<1, 3>(-0.6, 0.0, 0.0), 1e-14);
}

TEST(RangeModel, prediction_and_residual_agree_everywhere) {
  const RangeModel model({}, one_anchor({0, {3.0, -2.0, 2.5}, -0.2, 0.98}),
                         {{0, {0.4, -0.3, 0.8}}});
  for (const Pose2& pose : testing::poses_to_try()) {
    const double expected = *model.predict(pose, range_of(0.0));
    EXPECT_NEAR(model.linearize(pose, range_of(expected + 0.5))->residual(0), 0.5, 1e-13);
  }
}

TEST(RangeModel, jacobian_matches_differences) {
  const auto anchors = one_anchor({0, {3.0, -2.0, 2.5}, 0.2, 1.05});
  for (const Vector<3>& arm :
       {Vector<3>(0.4, -0.3, 0.8), Vector<3>(0.0, 0.0, 0.0), Vector<3>(0.0, 0.7, 0.0),
        Vector<3>(-0.7, 0.0, 0.0), Vector<3>(0.4, -0.3, 60.0)}) {
    const RangeModel model({}, anchors, {{0, arm}});
    for (const Pose2& pose : testing::poses_to_try()) {
      expect_jacobian_at(model, pose);
    }
  }
}

TEST(RangeModel, jacobian_matches_differences_one_millimetre_from_the_anchor) {
  const RangeModel model({}, one_anchor({0, {3.0, 2.0, 1.0}}), {{0, {0.4, 0.3, 1.0}}});
  for (int i = 0; i < 16; ++i) {
    const double heading = wrap_angle(0.4 * i);
    const Vector<2> arm = Pose2{0.0, 0.0, heading}.act({0.4, 0.3});
    const Pose2 pose{3.0 - arm.x() + 1e-3 * std::cos(1.0 * i),
                     2.0 - arm.y() + 1e-3 * std::sin(1.0 * i), heading};
    ASSERT_NEAR(*model.predict(pose, range_of(0.0)), 1e-3, 1e-12);
    expect_jacobian_at(model, pose, 1e-6, 1e-7);
  }
}

TEST(RangeModel, linearize_point_depends_on_the_position_alone) {
  const RangeModel model({0.1, 0.02}, one_anchor({9, {4.5, 6.0, 2.0}, 0.3, 1.1}),
                         {{4, {0.5, -0.7, 1.0}}});
  testing::Rng rng(4);
  for (int i = 0; i < 100; ++i) {
    const Vector<2> place = 10.0 * testing::random_matrix(rng, 2, 1);
    const Range z = range_of(6.0, 4, 9);
    const auto lin = model.linearize_point(place, z);
    const auto h = [&](const Vector<2>& p) {
      return 1.1 * Vector<3>(p.x() - 4.5, p.y() - 6.0, -1.0).norm() + 0.3;
    };
    EXPECT_NEAR(lin->residual(0), 6.0 - h(place), 1e-12);
    const double d = 1e-6;
    EXPECT_NEAR(lin->jacobian(0),
                (h(place + Vector<2>(d, 0.0)) - h(place - Vector<2>(d, 0.0))) / (2.0 * d), 1e-7);
    EXPECT_NEAR(lin->jacobian(1),
                (h(place + Vector<2>(0.0, d)) - h(place - Vector<2>(0.0, d))) / (2.0 * d), 1e-7);
    EXPECT_NEAR(lin->noise(0), 0.01 + std::pow(0.02 * (h(place) - 0.3) / 1.1, 2), 1e-12);
  }
  EXPECT_FALSE(model.linearize_point({0.0, 0.0}, range_of(6.0, 5, 9)));
  EXPECT_FALSE(model.linearize_point({0.0, 0.0}, range_of(6.0, 4, 8)));
}

TEST(RangeModel, does_not_observe_the_plane_right_below_the_anchor) {
  const RangeModel model({}, one_anchor({0, {3.0, 2.0, 4.0}}), {Tag{}});
  expect_near(model.linearize({3.0, 2.0, 1.0}, range_of(4.0))->jacobian,
              Matrix<1, 3>(Matrix<1, 3>::Zero()), 0.0);
}

TEST(RangeModel, is_empty_where_the_tag_coincides_with_the_anchor) {
  const RangeModel model({}, one_anchor({0, {3.0, 2.0, 1.0}}), {{0, {0.0, 0.0, 1.0}}});
  EXPECT_FALSE(model.linearize({3.0, 2.0, 1.0}, range_of(0.0)).has_value());
}

TEST(RangeModel, is_empty_for_an_unknown_anchor_or_tag) {
  const RangeModel model({}, one_anchor({1, {3.0, 2.0, 1.0}}), {{2, Vector<3>::Zero()}});
  EXPECT_TRUE(model.linearize({}, range_of(1.0, 2, 1)).has_value());
  for (const Range& z : {range_of(1.0, 2, 0), range_of(1.0, 1, 1), range_of(1.0, 1, 2)}) {
    EXPECT_FALSE(model.linearize({}, z).has_value());
    EXPECT_FALSE(model.predict({}, z).has_value());
  }
}

TEST(RangeModel, uses_the_numbers_of_each_anchor_and_tag) {
  const auto anchors = std::make_shared<AnchorMap>(
      std::vector<Anchor>{{0, {10.0, 0.0, 0.0}, 0.5, 1.0}, {1, {0.0, 20.0, 0.0}, 0.0, 2.0}});
  const RangeModel model({}, anchors, {{0, {1.0, 0.0, 0.0}}, {1, {0.0, 4.0, 0.0}}});
  EXPECT_NEAR(*model.predict({}, range_of(0.0, 0, 0)), 9.5, 1e-14);
  EXPECT_NEAR(*model.predict({}, range_of(0.0, 1, 1)), 32.0, 1e-14);
}

TEST(RangeModel, the_sigma_of_a_message_overrides_that_of_the_model) {
  const RangeModel model({0.1, 0.02}, one_anchor({0, {5.0, 0.0, 0.0}, 0.7, 2.0}), {Tag{}});
  Range z = range_of(30.0);
  EXPECT_NEAR(model.linearize({}, z)->noise(0), 0.01 + 0.01, 1e-16);  // 0.1^2 + (0.02 * 5)^2
  z.sigma = 0.3;
  EXPECT_NEAR(model.linearize({}, z)->noise(0), 0.09, 1e-16);
}

TEST(RangeModel, with_errors_equals_values_computed_by_hand) {
  // A second ago the body was at (1, 2), and the anchor 5 m away: 1.2 * 5 + 0.3 + 0.25.
  const RangeModel model({}, one_anchor({9, {4.5, 6.0, 1.0}, 0.3, 1.1}), {{4, {0.5, 0.0, 1.0}}});
  const Pose2 then{1.0, 2.0, 0.0};
  const Pose2 rate{1.0, -2.0, 0.3};
  const auto lin = model.linearize_with_errors(then * arc(rate.x, rate.y, rate.heading),
                                               range_of(7.0, 4, 9), {0.25, 0.1, 1.0}, rate);
  ASSERT_TRUE(lin.has_value());
  EXPECT_NEAR(lin->residual(0), 7.0 - 6.55, 1e-12);
  EXPECT_NEAR(lin->jacobian(3), 1.0, 1e-12);
  EXPECT_NEAR(lin->jacobian(4), 5.0, 1e-12);
  EXPECT_FALSE(model.linearize_with_errors(then, range_of(7.0, 4, 8), {}, {}).has_value());
}

TEST(RangeModel, derivatives_by_pose_and_errors_match_differences) {
  const RangeModel model({}, one_anchor({0, {3.0, -2.0, 2.0}, 0.3, 1.1}), {{0, {0.3, -0.2, 1.0}}});
  const Pose2 rate{0.7, -0.1, 0.4};
  for (const Pose2& pose : testing::poses_to_try()) {
    const auto at = [&](const Vector<6>& off) {
      return model.linearize_with_errors(retract(pose, off.head<3>()), range_of(9.0),
                                         {0.2 + off(3), 0.05 + off(4), 0.3 + off(5)}, rate);
    };
    const auto lin = at(Vector<6>::Zero());
    ASSERT_TRUE(lin.has_value());
    const Matrix<1, 6> differences = numerical_jacobian<1, 6>(
        [&](const Vector<6>& off) { return Vector<1>(lin->residual - at(off)->residual); });
    expect_near(Matrix<1, 6>(lin->jacobian), differences, 1e-6);
    const auto plain = model.linearize(pose, range_of(9.0));
    const auto without = model.linearize_with_errors(pose, range_of(9.0), {}, rate);
    expect_near(without->residual, plain->residual, 1e-12);
    expect_near(without->jacobian.leftCols<3>(), plain->jacobian, 1e-12);
  }
}

TEST(RangeModel, derivatives_by_pose_anchor_and_tag_match_differences) {
  const RangeModel model({}, one_anchor({2, {0.0, 0.0, 0.0}}), {{0, {0.3, -0.2, 1.0}}});
  const Pose2 pose{1.5, -2.0, 0.7};
  const Range z{0, 0, 2, 9.0, {}};
  const Anchor anchor{2, {4.0, 3.0, 2.5}, 0.2, 1.05};
  const Vector<3> in_body(0.3, -0.2, 1.0);
  const auto residual = [&](const Vector<8>& off) {
    Anchor moved = anchor;
    moved.position += off.segment<3>(3);
    const Vector<3> arm = in_body + Vector<3>(off(6), off(7), 0.0);
    return model.linearize_with_places(retract(pose, off.head<3>()), z, moved, arm)->residual;
  };
  const auto lin = model.linearize_with_places(pose, z, anchor, in_body);
  const Matrix<1, 8> differences = numerical_jacobian<1, 8>(
      [&](const Vector<8>& off) { return (residual(Vector<8>::Zero()) - residual(off)).eval(); });
  EXPECT_TRUE(lin->jacobian.isApprox(differences, 1e-7));
  const Vector<2> at = pose.act(Vector<2>(0.3, -0.2));
  const double distance = (Vector<3>(at.x(), at.y(), 1.0) - anchor.position).norm();
  EXPECT_NEAR(lin->residual(0), 9.0 - 1.05 * distance - 0.2, 1e-12);
  EXPECT_FALSE(model.linearize_with_places(pose, z, {2, {at.x(), at.y(), 1.0}}, in_body));
}

TEST(RangeModel, rejects_a_config_without_noise) {
  const auto anchors = one_anchor({});
  const auto with = [&](double sigma, double relative) {
    (void)RangeModel({sigma, relative}, anchors, {});
  };
  expect_refused([&] { with(-0.25, 0.0); }, "sigma_m", "-0.25");
  expect_refused([&] { with(0.1, -0.25); }, "sigma_relative", "-0.25");
  expect_refused([&] { with(0.0, 0.0); }, "not both 0");
  expect_refused([&] { with(std::nan(""), 0.1); }, "nan");
  expect_refused([&] { with(0.1, std::numeric_limits<double>::infinity()); }, "inf");
  expect_refused([&] { with(1e200, 0.0); }, "sigma_m", "squares");
  expect_refused([&] { with(0.1, 1e200); }, "sigma_relative", "squares");
  EXPECT_NO_THROW(with(0.0, 0.1));
}

TEST(RangeModel, rejects_a_missing_map_and_ambiguous_tags) {
  expect_refused([] { (void)RangeModel({}, nullptr, {}); }, "AnchorMap");
  expect_refused(
      [] {
        (void)RangeModel({}, one_anchor({}), {tag(3), tag(1), tag(3)});
      },
      "tag 3", "twice");
  expect_refused(
      [] {
        (void)RangeModel({}, one_anchor({}), {{5, {0.0, std::nan(""), 0.0}}});
      },
      "tag 5");
}

}  // namespace
}  // namespace locfuse::test_range
