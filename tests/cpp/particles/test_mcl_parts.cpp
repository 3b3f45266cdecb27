// SPDX-License-Identifier: Apache-2.0
// The parts of an Mcl by themselves.
#include <gtest/gtest.h>

#include <cmath>

#include "locfuse/particles/mcl_health.hpp"
#include "locfuse/particles/mcl_map_sharpness.hpp"
#include "locfuse/particles/mcl_particle_filter.hpp"
#include "locfuse/particles/mcl_recovery.hpp"
#include "support/rooms.hpp"

namespace locfuse::internal {
namespace {

using locfuse::testing::Rng;

/// A room, a robot in it and what its laser sees.
struct World {
  Rng rng{1};
  locfuse::testing::Room room = locfuse::testing::random_room(rng);
  Pose2 pose = room.middle * Pose2{0.0, -1.0, 0.3};
  LaserScan scan = locfuse::testing::scan_from(room.walls, pose, rng, 0.02);
  MclConfig config;
  RandomKeys keys{1};

  [[nodiscard]] std::shared_ptr<const MclRecipe> recipe() const {
    return make_mcl_recipe(config, locfuse::testing::on_map(room.map));
  }
  [[nodiscard]] EndPoints points(const MclRecipe& recipe) const {
    return recipe.fields.front().end_points(scan, recipe.config.beams);
  }
};

PoseEstimate near(const Pose2& pose, double sigma) {
  return {0, pose, sigma * sigma * Matrix<3, 3>::Identity()};
}

TEST(MclRecipe, cells_and_world_are_inverse) {
  const auto recipe = World().recipe();
  const Pose2 pose{1.3, -0.4, 2.9};
  EXPECT_LT(local(recipe->to_world(recipe->to_cells(pose)), pose).norm(), 1e-12);
}

TEST(MapSharpness, narrows_by_one_field_per_scan_down_to_the_estimate) {
  const World world;
  const auto recipe = world.recipe();
  MapSharpness sharpness(recipe);
  sharpness.reset();
  EXPECT_EQ(sharpness.level(), recipe->fields.size() - 1);
  const double widest = sharpness.sigma_hit();
  sharpness.update(world.points(*recipe), near(world.pose, 0.01), 0.0);
  EXPECT_DOUBLE_EQ(sharpness.sigma_hit(), 0.5 * widest);
  EXPECT_GT(sharpness.explained(), 0.95);
  EXPECT_TRUE(sharpness.fit_is_nominal());
  for (int k = 0; k < 5; ++k) {
    sharpness.update(world.points(*recipe), near(world.pose, 0.15), 0.0);
  }
  EXPECT_GE(sharpness.sigma_hit(), 0.15);
  sharpness.widen();
  EXPECT_DOUBLE_EQ(sharpness.sigma_hit(), widest);
}

TEST(MapSharpness, a_wrong_pose_is_not_nominal) {
  const World world;
  const auto recipe = world.recipe();
  MapSharpness sharpness(recipe);
  sharpness.reset();
  for (int k = 0; k < 20; ++k) {
    sharpness.update(world.points(*recipe), near(world.pose, 0.01), 0.0);
  }
  ASSERT_TRUE(sharpness.fit_is_nominal());
  for (int k = 0; k < 10; ++k) {
    sharpness.update(world.points(*recipe), near(world.pose * Pose2{1.5, 1.0, 0.8}, 0.01), 0.0);
  }
  EXPECT_FALSE(sharpness.fit_is_nominal());
}

TEST(ParticleFilter, propagates_the_pending_motion_once) {
  World world;
  const auto recipe = world.recipe();
  ParticleFilter filter(recipe);
  filter.start_at({{near(world.pose, 0.01), 1.0}}, world.keys);
  EXPECT_FALSE(filter.has_pending_motion());
  filter.add_motion(recipe->motion, {0.2, 0.0, 0.1}, 1'000'000'000);
  EXPECT_TRUE(filter.has_pending_motion());
  EXPECT_EQ(filter.best().estimate.stamp, 0);
  const PoseEstimate predicted = filter.predicted(filter.best().estimate);
  filter.propagate(world.keys);
  EXPECT_FALSE(filter.has_pending_motion());
  EXPECT_EQ(filter.best().estimate.stamp, 1'000'000'000);
  EXPECT_EQ(filter.best().estimate.pose.x, predicted.pose.x);
  EXPECT_LT(local(predicted.pose, world.pose * Pose2{0.2, 0.0, 0.1}).norm(), 0.01);
}

TEST(ParticleFilter, a_scan_moves_the_weight_to_where_it_fits) {
  World world;
  const auto recipe = world.recipe();
  ParticleFilter filter(recipe);
  const Pose2 wrong = world.pose * Pose2{1.5, 1.0, 0.8};
  filter.start_at({{near(world.pose, 0.05), 0.5}, {near(wrong, 0.05), 0.5}}, world.keys);
  ASSERT_EQ(filter.hypotheses().size(), 2U);
  EXPECT_FALSE(filter.is_converged());
  filter.weigh(recipe->fields.back(), world.points(*recipe));
  filter.resample({1.0, false, false}, world.keys);
  EXPECT_GT(filter.best().probability, 0.99);
  EXPECT_LT(local(filter.best().estimate.pose, world.pose).norm(), 0.2);
}

TEST(ParticleRecovery, lost_tracking_gives_half_of_the_weight_to_candidates) {
  World world;
  const auto recipe = world.recipe();
  ParticleFilter filter(recipe);
  MapSharpness sharpness(recipe);
  ParticleRecovery recovery(recipe);
  sharpness.reset();
  const Pose2 wrong = world.pose * Pose2{1.5, 1.0, 0.8};
  filter.start_at({{near(wrong, 0.05), 1.0}}, world.keys);
  const EndPoints points = world.points(*recipe);
  filter.weigh(sharpness.field(), points);
  recovery.update({points, 0.1, filter.best_log_likelihood(), true}, sharpness, filter, world.keys);
  double tracked = 0.0;
  for (const PoseHypothesis& h : filter.hypotheses()) {
    tracked += local(h.estimate.pose, wrong).norm() < 0.3 ? h.probability : 0.0;
  }
  EXPECT_NEAR(tracked, 0.5, 0.1);
}

TEST(MclHealth, removes_near_returns_only_if_many_are_covered) {
  World world;
  for (std::size_t i = 0; i < 100; ++i) {
    world.scan.ranges[i] = 0.15;
  }
  const MclHealth health(world.recipe());
  const ScanEvidence evidence = health.evidence_of(world.scan, near(world.pose, 0.01));
  EXPECT_NEAR(evidence.covered, 100.0 / 360.0, 0.05);
  EXPECT_GT(evidence.explained, 0.95);
  EXPECT_LT(evidence.by_chance, 0.8);
  const auto clear = MclHealth::without_cover(world.scan, evidence);
  ASSERT_TRUE(clear);
  EXPECT_TRUE(std::isnan(clear->ranges[0]));
  EXPECT_EQ(clear->ranges[200], world.scan.ranges[200]);
  ScanEvidence hardly = evidence;
  hardly.covered = 0.05;
  EXPECT_FALSE(MclHealth::without_cover(world.scan, hardly));
}

}  // namespace
}  // namespace locfuse::internal
