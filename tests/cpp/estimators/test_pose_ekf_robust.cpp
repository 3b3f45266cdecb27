// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <functional>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_pose_ekf_robust {
namespace {

using testing::expect_refused;
using testing::in_band;
using testing::Rng;

constexpr int kRuns = 60;

PoseEkf::Config config_of(NoiseKind kind) {
  PoseEkf::Config config;
  config.correlation_s = 0.0;  // its errors are independent
  config.range.sigma_m = 0.1;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.range.gate = 1.0;
  config.range.noise = kind;
  return config;
}

/// Draws noise of sigma 1.
using Draw = std::function<double(Rng&)>;

double clean(Rng& rng) { return testing::normal(rng, 1.0); }

/// What the shape says that noise is; late is never early.
Draw own(NoiseKind kind) {
  return [shape = NoiseShape({kind})](Rng& rng) {
    double all = 0.0;
    for (const NoiseShape::Part& part : shape) {
      all += std::exp(part.log_share);
    }
    double left = testing::uniform(rng, 0.0, all);
    for (const NoiseShape::Part& part : shape) {
      left -= std::exp(part.log_share);
      if (left <= 0.0) {
        const double noise = part.mean + testing::normal(rng, std::sqrt(part.variance));
        return part.mean > 0.0 ? std::abs(noise) : noise;
      }
    }
    return 0.0;
  };
}

/// One range in ten is long by up to 3 m.
double behind_walls(Rng& rng) {
  const double late =
      testing::uniform(rng, 0.0, 1.0) < 0.1 ? testing::uniform(rng, 0.0, 30.0) : 0.0;
  return late + testing::normal(rng, 1.0);
}

struct Result {
  double nees = 0.0;     ///< mean over the runs, of position and heading at the end
  double squared = 0.0;  ///< mean of the squared distance at the end [m^2]
};

Result measure(const PoseEkf::Config& config, const Draw& draw) {
  Result result;
  testing::SimulatedNoise noise;
  noise.range = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    testing::Simulation run = testing::simulate(seed, 20.0, noise);
    Rng rng(1000 + seed);
    PoseEkf ekf(config, {testing::hall(), testing::one_tag()}, run.start);
    for (Message& message : run.messages) {
      if (auto* z = std::get_if<Range>(&message)) {
        z->range = std::max(0.01, z->range + 0.1 * draw(rng));
      }
      ekf.on(message);
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({run.x, run.y, wrap_angle(run.heading)}, end.pose);
    result.nees += error.dot(end.covariance.llt().solve(error)) / kRuns;
    result.squared += error.head<2>().squaredNorm() / kRuns;
  }
  return result;
}

TEST(RobustPoseEkf, is_as_sure_as_it_should_be_of_clean_ranges) {
  const Result plain = measure(config_of(NoiseKind::kGaussian), clean);
  EXPECT_TRUE(in_band(plain.nees, 3, kRuns)) << plain.nees;
  for (const NoiseKind kind : {NoiseKind::kOneSided, NoiseKind::kStudentT, NoiseKind::kCauchy}) {
    const Result result = measure(config_of(kind), clean);
    EXPECT_TRUE(in_band(result.nees, 3, kRuns)) << static_cast<int>(kind) << " " << result.nees;
    EXPECT_LT(result.squared, 1.35 * plain.squared) << static_cast<int>(kind);
  }
}

TEST(RobustPoseEkf, is_as_sure_as_it_should_be_of_the_noise_that_it_believes_in) {
  for (const NoiseKind kind : {NoiseKind::kOneSided, NoiseKind::kStudentT, NoiseKind::kCauchy}) {
    const Result result = measure(config_of(kind), own(kind));
    EXPECT_TRUE(in_band(result.nees, 3, kRuns)) << static_cast<int>(kind) << " " << result.nees;
    const Result plain = measure(config_of(NoiseKind::kGaussian), own(kind));
    EXPECT_FALSE(in_band(plain.nees, 3, kRuns)) << static_cast<int>(kind) << " " << plain.nees;
  }
}

TEST(RobustPoseEkf, survives_walls_that_break_the_plain_filter) {
  const Result plain = measure(config_of(NoiseKind::kGaussian), behind_walls);
  EXPECT_GT(plain.nees, 30.0);
  for (const NoiseKind kind : {NoiseKind::kOneSided, NoiseKind::kStudentT, NoiseKind::kCauchy}) {
    const Result result = measure(config_of(kind), behind_walls);
    EXPECT_LT(result.nees, 5.0) << static_cast<int>(kind) << " " << result.nees;
    EXPECT_LT(result.squared, 0.1 * plain.squared) << static_cast<int>(kind);
  }
}

TEST(RobustPoseEkf, fixes_and_poses_have_tails_of_their_own) {
  const PositionFix wild_fix{0, {30.0, 0.0}, Matrix<2, 2>::Identity()};
  const PoseObservation wild_pose{0, {30.0, 0.0, 0.0}, Matrix<3, 3>::Identity()};
  PoseEkf::Config config;
  config.position.gate = config.pose.gate = 1.0;
  PoseEkf plain = testing::ekf_at({}, config);
  plain.on(wild_fix);
  EXPECT_GT(plain.pose().x, 0.2);
  config.position.noise = NoiseKind::kStudentT;
  PoseEkf of_fix = testing::ekf_at({}, config);
  EXPECT_EQ(of_fix.on(wild_fix).verdict, Verdict::kFused);
  EXPECT_LT(of_fix.pose().x, 0.02);
  of_fix.on(wild_pose);
  EXPECT_GT(of_fix.pose().x, 0.2);
  config.pose.noise = NoiseKind::kCauchy;
  PoseEkf of_pose = testing::ekf_at({}, config);
  EXPECT_EQ(of_pose.on(wild_pose).verdict, Verdict::kFused);
  EXPECT_LT(of_pose.pose().x, 0.02);
}

TEST(RobustPoseEkf, refuses_what_has_no_long_side) {
  PoseEkf::Config config;
  config.position.noise = NoiseKind::kOneSided;
  expect_refused([&] { (void)testing::ekf_at({}, config); }, "position.noise is one_sided");
  config.position.noise = NoiseKind::kGaussian;
  config.pose.noise = NoiseKind::kOneSided;
  expect_refused([&] { (void)testing::ekf_at({}, config); }, "pose.noise is one_sided");
  config.pose.noise = NoiseKind::kGaussian;
  config.range.noise = NoiseKind::kStudentT;
  PoseEkf ekf = testing::ekf_at({}, config);
  expect_refused([&] { ekf.on_joint(std::vector<Range>{testing::range_to(0, {}, 0)}); },
                 "fuse them one by one");
}

// The spread that the fix leaves was a difference of numbers 1e18 times as large.
TEST(RobustPoseEkf, a_fix_after_an_exact_range_leaves_a_covariance) {
  PoseEkf::Config config;
  config.position.noise = NoiseKind::kCauchy;
  const PoseEkf prototype(config, {testing::hall(), testing::one_tag()},
                          {0, {}, Matrix<3, 3>::Identity()});
  for (double a = -3.0; a < 3.0; a += 0.01) {
    PoseEkf ekf =
        prototype.restarted({0, {3.0 * a, 2.0, a}, Vector<3>(1e8, 1e8, 1e-6).asDiagonal()});
    Range exact = testing::range_to(0, ekf.pose(), 0);
    exact.sigma = 1e-3;
    ekf.on(exact);
    EXPECT_EQ(ekf.belief().interventions, 1U) << a;  // 1 mm beside 10 km
    const Matrix<2, 2> noise = 1e-4 * Matrix<2, 2>::Identity();
    const Matrix<2, 2> S = ekf.belief().P.topLeftCorner<2, 2>() + noise;
    const Vector<2> off = S.llt().matrixL() * Vector<2>(0.5, 1.0);
    ekf.on(PositionFix{0, ekf.pose().position() + off, noise});
    EXPECT_TRUE(testing::is_covariance(Eigen::MatrixXd(ekf.belief().P))) << a;
    EXPECT_EQ(ekf.belief().interventions, 1U) << a;
  }
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_robust
