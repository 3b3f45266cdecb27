// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <array>
#include <cmath>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/robot.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_pose_ekf_consistency {
namespace {

using testing::in_band;

constexpr int kRuns = 50;

/// The filter that knows the noise of the simulation, and lets every range pass.
PoseEkf::Config well_informed() {
  PoseEkf::Config config;
  config.correlation_s = 0.0;  // its errors are independent
  config.range.sigma_m = 0.1;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.range.gate = 1.0;
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
    PoseEkf ekf(config, {testing::hall(), testing::one_tag()}, run.start);
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

/// Mean over 60 runs of 100 s of the NEES of 3 at the end, where errors of ranges keep half of
/// their variance over a correlation time, independent between anchors or common to all.
double nees_where_errors_last(double seconds, double reported, double correlation_s,
                              bool are_common = false) {
  PoseEkf::Config config = well_informed();
  config.correlation_s = correlation_s;
  config.range.sigma_m = 0.1 * std::sqrt(seconds > 0.0 ? 2.0 : 1.0) * reported;
  constexpr int kSeeds = 60;
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    testing::Simulation run = testing::simulate(seed, 100.0);
    testing::Rng rng(1000 + seed);
    std::array<double, 4> lasting{};
    for (double& error : lasting) {
      error = testing::normal(rng, 0.1);
    }
    const double kept = seconds > 0.0 ? std::exp(-0.2 / seconds) : 0.0;
    PoseEkf ekf(config, {testing::hall(), testing::one_tag()}, run.start);
    for (Message& message : run.messages) {
      if (Range* z = std::get_if<Range>(&message); z != nullptr && seconds > 0.0) {
        double& error = lasting.at(are_common ? 0 : static_cast<std::size_t>(z->anchor));
        if (!are_common || z->anchor == 0) {
          error = kept * error + std::sqrt(1.0 - kept * kept) * testing::normal(rng, 0.1);
        }
        z->range += error;
      }
      ekf.on(message);
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({run.x, run.y, wrap_angle(run.heading)}, end.pose);
    sum += error.dot(end.covariance.llt().solve(error)) / kSeeds;
  }
  return sum;
}

TEST(PoseEkf, what_is_gated_leaves_the_reported_covariance_as_it_was) {
  const testing::Simulation run = testing::simulate(1, 20.0);
  PoseEkf ekf(PoseEkf::Config{}, {testing::hall(), testing::one_tag()}, run.start);
  for (const Message& message : run.messages) {
    ekf.on(message);
    const Stamp later = ekf.estimate().stamp + 100'000'000;
    const PoseEkf before = ekf;
    ASSERT_EQ(ekf.on(Range{later, 0, 0, 90.0, {}}).verdict, Verdict::kGated);
    ASSERT_EQ(ekf.current().covariance, before.current().covariance);
    ASSERT_EQ(ekf.estimate(later).covariance, before.estimate(later).covariance);
  }
  EXPECT_FALSE(ekf.belief().correlated.is_empty());
}

TEST(PoseEkf, errors_that_last_are_known_to) {
  constexpr double kDefault = PoseEkf::Config{}.correlation_s;
  for (const double seconds : {1.0, 5.0, 20.0}) {
    const double with = nees_where_errors_last(seconds, 1.0, kDefault);
    const double without = nees_where_errors_last(seconds, 1.0, 0.0);
    EXPECT_TRUE(with > 1.5 && with < 4.5) << seconds << " s: " << with << " of 3";
    EXPECT_GT(without, 2.0 * with) << seconds << " s: " << without << " of 3";
    const double reported_half = nees_where_errors_last(seconds, 0.5, kDefault);
    EXPECT_TRUE(reported_half > 1.5 && reported_half < 6.0)
        << seconds << " s: " << reported_half << " of 3";
  }
  const double independent = nees_where_errors_last(0.0, 1.0, kDefault);
  EXPECT_TRUE(independent > 1.5 && independent < 3.6) << independent << " of 3";
  const double reported_half = nees_where_errors_last(0.0, 0.5, kDefault);
  EXPECT_TRUE(reported_half > 1.5 && reported_half < 5.0) << reported_half << " of 3";
}

TEST(PoseEkf, errors_that_all_anchors_share_are_known_to) {
  constexpr double kDefault = PoseEkf::Config{}.correlation_s;
  for (const double seconds : {1.0, 5.0, 20.0}) {
    const double with = nees_where_errors_last(seconds, 1.0, kDefault, true);
    EXPECT_TRUE(with > 1.5 && with < 5.0) << seconds << " s: " << with << " of 3";
    const double reported_half = nees_where_errors_last(seconds, 0.5, kDefault, true);
    EXPECT_TRUE(reported_half > 1.5 && reported_half < 9.0)
        << seconds << " s: " << reported_half << " of 3";
  }
}

/// Mean over 60 runs of 300 s of the NEES of the position at the end, of a robot that stands where
/// half of the variance of each range is an error that stays.
double nees_of_standing(double correlation_s) {
  PoseEkf::Config config = well_informed();
  config.correlation_s = correlation_s;
  config.range.sigma_m = 0.1 * std::sqrt(2.0);
  constexpr int kSeeds = 60;
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    testing::Rng rng(seed);
    const Pose2 truth{2.0 + testing::normal(rng, 0.1), -1.0 + testing::normal(rng, 0.1), 0.4};
    const PoseEstimate start{0, {2.0, -1.0, 0.4}, Vector<3>(0.01, 0.01, 0.01).asDiagonal()};
    std::array<double, 4> stays{};
    for (double& error : stays) {
      error = testing::normal(rng, 0.1);
    }
    PoseEkf ekf(config, {testing::hall(), testing::one_tag()}, start);
    for (int k = 1; k <= 1500; ++k) {
      const Stamp stamp = k * testing::kSecond / 5;
      ekf.on(Velocity{stamp, 0.0, 0.0});
      for (Id anchor = 0; anchor < 4; ++anchor) {
        const double error = stays.at(static_cast<std::size_t>(anchor)) + testing::normal(rng, 0.1);
        ekf.on(testing::range_to(anchor, truth, stamp, error));
      }
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<2> error = end.pose.position() - truth.position();
    sum +=
        error.dot(Matrix<2, 2>(end.covariance.topLeftCorner<2, 2>()).llt().solve(error)) / kSeeds;
  }
  return sum;
}

TEST(PoseEkf, a_robot_that_stands_is_not_surer_for_it) {
  const double with = nees_of_standing(PoseEkf::Config{}.correlation_s);
  EXPECT_TRUE(with > 0.3 && with < 4.0) << with << " of 2";
  EXPECT_GT(nees_of_standing(0.0), 20.0);
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_consistency
