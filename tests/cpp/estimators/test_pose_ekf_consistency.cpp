// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_pose_ekf_consistency {
namespace {

using testing::in_band;

constexpr int kRuns = 50;

/// The filter that knows the noise of the simulation, and lets every range pass.
PoseEkf::Config well_informed() {
  PoseEkf::Config config;
  config.range.sigma_m = 0.1;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.gate_range = 1.0;
  return config;
}

struct Consistency {
  double nees = 0.0;  ///< mean over the runs, of position and heading at the end
  double nis = 0.0;   ///< mean over all ranges
  int ranges = 0;
};

Consistency measure(const PoseEkf::Config& config) {
  Consistency result;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const testing::Simulation run = testing::simulate(seed, 20.0);
    PoseEkf ekf(config, testing::hall(), testing::one_tag(), run.start);
    for (const Message& message : run.messages) {
      const Outcome outcome = ekf.on(message);
      if (outcome.dof == 1) {
        result.nis += outcome.nis;
        ++result.ranges;
      }
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({run.x, run.y, wrap_angle(run.heading)}, end.pose);
    result.nees += error.dot(end.covariance.llt().solve(error)) / kRuns;
  }
  result.nis /= result.ranges;
  return result;
}

TEST(PoseEkf, errors_and_innovations_are_as_large_as_it_believes) {
  const Consistency result = measure(well_informed());
  EXPECT_EQ(result.ranges, kRuns * 400);
  EXPECT_TRUE(in_band(result.nees, 3, kRuns)) << result.nees;
  EXPECT_TRUE(in_band(result.nis, 1, result.ranges)) << result.nis;
}

TEST(PoseEkf, trusting_ranges_ten_times_too_much_shows) {
  PoseEkf::Config config = well_informed();
  config.range.sigma_m = 0.01;
  const Consistency result = measure(config);
  EXPECT_FALSE(in_band(result.nees, 3, kRuns)) << result.nees;
  EXPECT_FALSE(in_band(result.nis, 1, result.ranges)) << result.nis;
}

TEST(PoseEkf, trusting_odometry_ten_times_too_much_shows) {
  PoseEkf::Config config = well_informed();
  config.odometry = {0.003, 0.001, 0.002, 0.003, 0.0, 0.0};
  EXPECT_FALSE(in_band(measure(config).nees, 3, kRuns));
}

TEST(PoseEkf, trusting_ranges_ten_times_too_little_shows) {
  PoseEkf::Config config = well_informed();
  config.range.sigma_m = 1.0;
  const Consistency result = measure(config);
  EXPECT_FALSE(in_band(result.nees, 3, kRuns)) << result.nees;
  EXPECT_FALSE(in_band(result.nis, 1, result.ranges)) << result.nis;
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_consistency
