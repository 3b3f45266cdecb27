// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "locfuse/particles/mcl_particle_filter.hpp"
#include "support/allocation_counter.hpp"
#include "support/rooms.hpp"

namespace locfuse::internal {
namespace {

/// Allocations by which so many particles are drawn from odometry and lines.
std::size_t allocations_of(int particles, double sigma_map) {
  testing::Walls walls;
  testing::add_box(walls, {5.0, 5.0, 0.0}, 8.0, 6.0);
  MclConfig config;
  config.min_particles = config.max_particles = particles;
  config.proposal = MclConfig::Proposal::kLineEkf;
  config.sigma_map_m = sigma_map;
  const auto recipe =
      make_mcl_recipe(config, testing::on_map(testing::map_of(walls, 200, 200, 0.05, {})));
  testing::Rng rng(1);
  const Pose2 pose{4.0, 4.5, 0.2};
  const LaserScan scan = testing::scan_from(walls, pose, rng, 0.01);
  ParticleFilter filter(recipe);
  RandomKeys keys(1);
  filter.start_at({{{0, pose, 1e-4 * Matrix<3, 3>::Identity()}, 1.0}}, keys);
  filter.add_motion(recipe->motion, {0.01, 0.0, 0.0}, 1'000'000'000);
  const std::size_t before = testing::allocations();
  EXPECT_EQ(filter.propagate_by_lines(scan, 0.05, keys).has_value(), sigma_map == 0.0);
  return testing::allocations() - before;
}

TEST(LineProposal, allocates_nothing_per_particle) {
  EXPECT_EQ(allocations_of(4'000, 0.0), allocations_of(100, 0.0));
  EXPECT_EQ(allocations_of(4'000, 0.03), allocations_of(100, 0.03));
}

}  // namespace
}  // namespace locfuse::internal
