// SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_pose_near;
using testing::random_pose;
using testing::Rng;
using testing::uniform;

/// Motions that are hard to split: cusps, cuts, and turns around the switch to the series.
std::vector<Pose2> motions_to_try() {
  std::vector<Pose2> motions = {{1.0, 0.0, 0.0},   {0.0, 1.0, 0.0},     {0.0, 0.0, -kPi},
                                {1.0, 2.0, -kPi},  {0.3, -0.2, 3.1415}, {1.0, 1.0, 1e-4},
                                {1.0, 1.0, -1e-4}, {1.0, 1.0, 9.9e-5},  {1.0, 1.0, 1e-12},
                                {0.5, 0.0, 0.7},   {0.0, 0.0, 0.0}};
  Rng rng(7);
  for (int i = 0; i < 100; ++i) {
    motions.push_back(random_pose(rng, 2.0));
  }
  return motions;
}

TEST(Pose2, takes_points_from_body_to_world) {
  const Pose2 T_world_body{1.0, 2.0, kPi / 2.0};
  expect_near(T_world_body.act({3.0, 4.0}), Vector<2>(-3.0, 5.0), 1e-15);
}

TEST(Pose2, composition_equals_a_value_computed_by_hand) {
  const Pose2 a_b{1.0, 2.0, kPi / 2.0};
  const Pose2 b_c{3.0, 4.0, 3.0 * kPi / 4.0};
  expect_pose_near(a_b * b_c, {-3.0, 5.0, -3.0 * kPi / 4.0}, 1e-15);
}

TEST(Pose2, acting_twice_is_acting_with_the_product) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const Pose2 a_b = random_pose(rng);
    const Pose2 b_c = random_pose(rng);
    const Vector<2> p{uniform(rng, -5.0, 5.0), uniform(rng, -5.0, 5.0)};
    expect_near((a_b * b_c).act(p), a_b.act(b_c.act(p)), 1e-13);
  }
}

TEST(Pose2, inverse_undoes_from_both_sides) {
  Rng rng(2);
  for (int i = 0; i < 100; ++i) {
    const Pose2 a_b = random_pose(rng);
    expect_pose_near(a_b * inverse(a_b), {}, 1e-13);
    expect_pose_near(inverse(a_b) * a_b, {}, 1e-13);
  }
  expect_pose_near(inverse(Pose2{0.0, 0.0, -kPi}), {0.0, 0.0, -kPi}, 1e-15);
}

TEST(Pose2, local_undoes_retract_across_the_cut) {
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Pose2 from = random_pose(rng);
    const Pose2 to = random_pose(rng);
    expect_pose_near(retract(from, local(to, from)), to, 1e-13);
  }
  EXPECT_NEAR(local({0.0, 0.0, kPi - 0.1}, {0.0, 0.0, -kPi + 0.1}).z(), -0.2, 1e-15);
}

TEST(Arc, is_straight_at_zero_turn) {
  const Pose2 motion = arc(1.5, -0.5, 0.0);
  EXPECT_EQ(motion.x, 1.5);
  EXPECT_EQ(motion.y, -0.5);
  EXPECT_EQ(motion.heading, 0.0);
}

TEST(Arc, is_a_quarter_of_the_unit_circle) {
  expect_pose_near(arc(kPi / 2.0, 0.0, kPi / 2.0), {1.0, 1.0, kPi / 2.0}, 1e-15);
  expect_pose_near(arc(kPi / 2.0, 0.0, -kPi / 2.0), {1.0, -1.0, -kPi / 2.0}, 1e-15);
  expect_pose_near(arc(0.0, kPi / 2.0, kPi / 2.0), {-1.0, 1.0, kPi / 2.0}, 1e-15);
}

TEST(Arc, is_accurate_to_rounding_for_the_smallest_turns) {
  for (double turn = 1.0; turn > 1e-18; turn *= 0.7) {
    for (const double signed_turn : {turn, -turn}) {
      const long double a = signed_turn;
      const long double half = std::sin(0.5L * a);
      const auto sine = static_cast<double>(std::sin(a) / a);
      const auto versine = static_cast<double>(2.0L * half * half / a);
      const Pose2 motion = arc(1.0, 0.0, signed_turn);
      ASSERT_NEAR(motion.x, sine, 4e-16) << signed_turn;
      ASSERT_NEAR(motion.y, versine, 4e-16 * std::abs(versine)) << signed_turn;
    }
  }
}

TEST(ArcTwist, undoes_arc) {
  Rng rng(4);
  for (int i = 0; i < 100; ++i) {
    const Vector<3> twist{uniform(rng, -2.0, 2.0), uniform(rng, -2.0, 2.0),
                          i % 2 == 0 ? uniform(rng, -kPi, kPi) : uniform(rng, -2e-4, 2e-4)};
    expect_near(arc_twist(arc(twist.x(), twist.y(), twist.z())), twist, 1e-13);
  }
}

TEST(ArcShare, is_nothing_at_0_and_everything_at_1) {
  for (const Pose2& motion : motions_to_try()) {
    expect_pose_near(arc_share(motion, 0.0), {}, 1e-15);
    expect_pose_near(arc_share(motion, 1.0), motion, 1e-14);
  }
}

TEST(ArcShare, shares_compose_to_the_whole) {
  for (const Pose2& motion : motions_to_try()) {
    SCOPED_TRACE(motion.heading);
    expect_pose_near(arc_share(motion, 0.5) * arc_share(motion, 0.5), motion, 1e-14);
    expect_pose_near(arc_share(motion, 0.2) * arc_share(motion, 0.8), motion, 1e-14);
    expect_pose_near(arc_share(motion, 2.0), motion * motion, 1e-13);
  }
}

TEST(ArcShare, half_of_a_half_circle_is_a_quarter_circle) {
  expect_pose_near(arc_share({0.0, 2.0, std::nextafter(kPi, 0.0)}, 0.5), {1.0, 1.0, kPi / 2.0},
                   1e-15);
}

TEST(Pose2, half_of_a_full_turn_is_no_farther_than_the_whole) {
  EXPECT_LT(arc_share({1.0, 0.0, 2.0 * kPi}, 0.5).position().norm(), 1.0);
}

}  // namespace
}  // namespace locfuse
