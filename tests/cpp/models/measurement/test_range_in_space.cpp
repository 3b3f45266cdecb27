// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <vector>

#include "locfuse/models/measurement/range.hpp"
#include "support/jacobian.hpp"

namespace locfuse::test_range_in_space {
namespace {

using testing::expect_near;
using testing::Rng;
using testing::same_bits;
using testing::uniform;

RangeModel model_of(const Anchor& anchor, const Vector<3>& tag) {
  return {{0.1, 0.02},
          std::make_shared<AnchorMap>(std::vector<Anchor>{anchor}),
          std::vector<Tag>{{0, tag}}};
}

Range range_of(double range) { return {0, 0, 0, range, {}}; }

/// Compares the Jacobian by pose and height with differences.
void expect_jacobian_in_space(const RangeModel& model, const Pose2& pose, double height,
                              double tolerance = 1e-7) {
  const double here = *model.predict(pose, height, range_of(0.0));
  const Matrix<1, 4> differences = numerical_jacobian<1, 4>([&](const Vector<4>& delta) {
    const Pose2 there = retract(pose, delta.head<3>());
    return Vector<1>(*model.predict(there, height + delta(3), range_of(0.0)) - here);
  });
  const auto lin = model.linearize(pose, height, range_of(here + 0.5));
  ASSERT_TRUE(lin.has_value());
  EXPECT_NEAR(lin->residual(0), 0.5, 1e-13);
  expect_near(lin->jacobian, differences, tolerance);
}

TEST(RangeModel, from_a_height_equals_values_computed_by_hand) {
  // Looking north at (1, 2, 10), so the tag is at (1, 2.5, 11); the anchor is (2, 3, -6) from it.
  const RangeModel model = model_of({0, {3.0, 5.5, 5.0}, 0.3, 1.1}, {0.5, 0.0, 1.0});
  const Pose2 pose{1.0, 2.0, kPi / 2.0};
  EXPECT_NEAR(*model.predict(pose, 10.0, range_of(0.0)), 1.1 * 7.0 + 0.3, 1e-14);
  const auto lin = model.linearize(pose, 10.0, range_of(9.0));
  EXPECT_NEAR(lin->residual(0), 1.0, 1e-14);
  expect_near(lin->jacobian, 1.1 / 7.0 * Matrix<1, 4>(-2.0, -3.0, 1.0, 6.0), 1e-14);
  EXPECT_NEAR(lin->noise(0), 0.01 + 0.14 * 0.14, 1e-15);
}

TEST(RangeModel, jacobian_with_height_matches_differences) {
  const RangeModel model = model_of({0, {3.0, -2.0, 2.5}, 0.2, 1.05}, {0.4, -0.3, 0.8});
  Rng rng(3);
  for (const Pose2& pose : testing::poses_to_try()) {
    expect_jacobian_in_space(model, pose, uniform(rng, -20.0, 20.0));
  }
}

TEST(RangeModel, right_above_an_anchor_observes_only_the_height) {
  const RangeModel model = model_of({0, {3.0, 2.0, 4.0}}, Vector<3>::Zero());
  const Pose2 above{3.0, 2.0, -kPi};
  expect_near(model.linearize(above, 9.0, range_of(5.0))->jacobian,
              Matrix<1, 4>(0.0, 0.0, 0.0, 1.0), 0.0);
  expect_near(model.linearize(above, -1.0, range_of(5.0))->jacobian,
              Matrix<1, 4>(0.0, 0.0, 0.0, -1.0), 0.0);
  expect_jacobian_in_space(model, above, 9.0);
  expect_jacobian_in_space(model, {3.0 + 1e-3, 2.0, 0.0}, 9.0);
  EXPECT_FALSE(model.linearize(above, 4.0, range_of(0.0)).has_value());
}

TEST(RangeModel, at_height_zero_equals_the_plane_to_the_bit) {
  const RangeModel model = model_of({0, {3.0, -2.0, 2.5}, 0.2, 1.05}, {0.4, -0.3, 0.8});
  for (const Pose2& pose : testing::poses_to_try()) {
    const auto plane = model.linearize(pose, range_of(3.0));
    const auto space = model.linearize(pose, 0.0, range_of(3.0));
    EXPECT_TRUE(same_bits(plane->residual, space->residual));
    EXPECT_TRUE(same_bits(plane->jacobian, space->jacobian.head<3>()));
    EXPECT_TRUE(same_bits(plane->noise, space->noise));
    EXPECT_EQ(*model.predict(pose, range_of(3.0)), *model.predict(pose, 0.0, range_of(3.0)));
  }
}

}  // namespace
}  // namespace locfuse::test_range_in_space
