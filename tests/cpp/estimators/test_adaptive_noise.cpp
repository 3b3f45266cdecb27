// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/bits.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_adaptive_noise {
namespace {

using testing::in_band;

constexpr int kRuns = 50;
constexpr double kSigma = 0.1;  // of the ranges of the simulation [m]

PoseEkf::Config config_with(double sigma, double messages) {
  PoseEkf::Config config;
  config.correlation_s = 0.0;  // its errors are independent
  config.range.sigma_m = sigma;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.adaptive.messages = messages;
  return config;
}

struct Ends {
  double nees = 0.0;    ///< mean over runs
  double factor = 0.0;  ///< of the variance
};

Ends ends_of(const PoseEkf::Config& config) {
  Ends ends;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const testing::Simulation run = testing::simulate(seed, 60.0);
    PoseEkf ekf(config, {testing::hall(), testing::one_tag()}, run.start);
    for (const Message& message : run.messages) {
      ekf.on(message);
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({run.x, run.y, wrap_angle(run.heading)}, end.pose);
    ends.nees += error.dot(end.covariance.llt().solve(error)) / kRuns;
    ends.factor += ekf.adaptive().factor(Source::kRanges) / kRuns;
  }
  return ends;
}

TEST(AdaptiveNoise, a_wrong_reported_sigma_is_corrected) {
  for (const double wrong : {1.0 / 3.0, 1.0, 3.0}) {
    const Ends ends = ends_of(config_with(wrong * kSigma, 200.0));
    const double right = 1.0 / (wrong * wrong);
    EXPECT_NEAR(ends.factor / right, 1.0, 0.1) << wrong;
    EXPECT_TRUE(in_band(ends.nees, 3, kRuns, 0.99)) << wrong << ": " << ends.nees;
  }
}

TEST(AdaptiveNoise, without_it_a_wrong_reported_sigma_shows) {
  for (const double wrong : {1.0 / 3.0, 3.0}) {
    const Ends ends = ends_of(config_with(wrong * kSigma, 0.0));
    EXPECT_NEAR(ends.factor, 1.0, 1e-12);
    EXPECT_FALSE(in_band(ends.nees, 3, kRuns, 0.99)) << wrong << ": " << ends.nees;
  }
}

TEST(AdaptiveNoise, keeps_between_its_limits) {
  PoseEkf::Config config = config_with(3.0 * kSigma, 50.0);
  config.adaptive.least = 0.5;
  EXPECT_NEAR(ends_of(config).factor, 0.5, 0.01);
  config = config_with(kSigma / 3.0, 50.0);
  config.adaptive.most = 2.0;
  EXPECT_NEAR(ends_of(config).factor, 2.0, 0.04);
}

TEST(AdaptiveNoise, what_is_not_fused_says_nothing) {
  const testing::Simulation run = testing::simulate(1, 1.0);
  PoseEkf ekf(config_with(kSigma, 20.0), {testing::hall(), testing::one_tag()}, run.start);
  const PoseEkf before = ekf;
  EXPECT_EQ(ekf.on(Range{run.start.stamp, 0, 0, 90.0, {}}).verdict, Verdict::kGated);
  EXPECT_EQ(ekf.adaptive().factor(Source::kRanges), 1.0);
  EXPECT_TRUE(testing::same_bits(ekf.belief().P, before.belief().P));
}

TEST(AdaptiveNoise, each_kind_has_a_factor_of_its_own_and_a_model_of_the_callers_none) {
  const testing::Simulation run = testing::simulate(1, 1.0);
  PoseEkf ekf(config_with(kSigma, 20.0), {testing::hall(), testing::one_tag()}, run.start);
  const Pose2 at = ekf.current().pose;
  ekf.on(PositionFix{0, at.position(), 0.01 * Matrix<2, 2>::Identity()});
  EXPECT_LT(ekf.adaptive().factor(Source::kPositions), 1.0);  // no innovation at all
  EXPECT_EQ(ekf.adaptive().factor(Source::kRanges), 1.0);
  EXPECT_EQ(ekf.adaptive().factor(Source::kPoses), 1.0);
  Linearization<Eigen::Dynamic, 3> own;
  own.residual = Vector<1>(0.0);
  own.jacobian = Matrix<1, 3>(1.0, 0.0, 0.0);
  own.noise = Matrix<1, 1>(0.01);
  const double positions = ekf.adaptive().factor(Source::kPositions);
  EXPECT_EQ(ekf.fuse(0, own, Gate(0.999)).verdict, Verdict::kFused);
  EXPECT_EQ(ekf.adaptive().factor(Source::kPositions), positions);
  EXPECT_EQ(ekf.adaptive().factor(Source::kPoses), 1.0);
}

TEST(AdaptiveNoise, refuses_a_config_out_of_range) {
  for (const double messages : {-1.0, 1.0, std::numeric_limits<double>::infinity()}) {
    testing::expect_refused([&] { AdaptiveNoise({messages, 0.1, 100.0}); }, "adaptive.messages");
  }
  testing::expect_refused([] { AdaptiveNoise({100.0, 0.0, 100.0}); }, "adaptive.least");
  testing::expect_refused([] { AdaptiveNoise({100.0, 0.1, 0.5}); }, "adaptive.most");
}

// Rounding left a determinant of noise below 0, whose root is NaN, for good.
TEST(AdaptiveNoise, stays_a_number_where_a_determinant_rounds_below_zero) {
  PoseEkf::Config config;
  config.adaptive.messages = 10;
  PoseEkf ekf = testing::ekf_at({0.0, 0.0, 0.3}, config);
  PositionFix fix{0, {0.01, 0.005}, Matrix<2, 2>::Zero()};
  fix.covariance << 0x1.2e6ef2p-1, 0x1.67fe7b649ea81p-1, 0x1.67fe7b649ea81p-1, 0x1.ac829p-1;
  ASSERT_EQ(ekf.on(fix).verdict, Verdict::kFused);
  EXPECT_GT(ekf.adaptive().factor(Source::kPositions), 0.0);
}

}  // namespace
}  // namespace locfuse::test_adaptive_noise
