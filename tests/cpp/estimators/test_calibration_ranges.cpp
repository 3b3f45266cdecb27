// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <array>
#include <cmath>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::test_calibration_ranges {
namespace {

using testing::in_band;
using testing::normal;
using testing::Rng;

constexpr Stamp kStep = 100'000'000;
constexpr int kRuns = 60;
constexpr double kSigmaOffset = 0.3;
constexpr double kSigmaScale = 0.03;
constexpr double kSigmaDelay = 0.1;

PoseEkf::Config config_of(double offset, double scale, double delay) {
  PoseEkf::Config config;
  config.correlation_s = 0.0;  // its errors are independent
  config.odometry = {0.02, 0.02, 0.02, 0.02, 0.0, 0.0};
  config.range.sigma_m = 0.05;
  config.range.gate = 1.0;
  config.calibration.sigma_anchor_offset_m = offset;
  config.calibration.sigma_anchor_scale = scale;
  config.calibration.sigma_range_delay_s = delay;
  return config;
}

PoseEkf::Config everything() { return config_of(kSigmaOffset, kSigmaScale, kSigmaDelay); }

/// A robot that winds through the hall among anchors that are off, written out in scalars.
class Robot {
 public:
  explicit Robot(std::uint64_t seed, const PoseEkf::Config& config = everything())
      : correlation_s_(config.calibration.anchor_offset_correlation_s), rng_(seed) {
    // Nothing is measured before it happens.
    delay = std::abs(normal(rng_, config.calibration.sigma_range_delay_s));
    for (std::size_t k = 0; k < 4; ++k) {
      offset[k] = normal(rng_, config.calibration.sigma_anchor_offset_m);
      scale[k] = normal(rng_, config.calibration.sigma_anchor_scale);
    }
    x = normal(rng_, 0.1);
    y = normal(rng_, 0.1);
    heading = normal(rng_, 0.05);
    past_.fill({x, y, heading});
  }

  /// Odometry of the next tenth of a second, driven in a hundred steps.
  Pose2 drive(int step, double speed = 1.0) {
    const double rate = speed > 0.0 ? 0.4 * std::sin(0.05 * step) + 0.15 : 0.0;
    constexpr double dt = 0.001;
    Pose2 odometry;
    for (int i = 0; i < 100; ++i) {
      const double way = speed * dt + normal(rng_, 0.02 * std::sqrt(speed * dt));
      const double aside = normal(rng_, 0.02 * std::sqrt(speed * dt));
      x += way * std::cos(heading) - aside * std::sin(heading);
      y += way * std::sin(heading) + aside * std::cos(heading);
      heading += rate * dt + normal(rng_, 0.02 * std::sqrt((speed + std::abs(rate)) * dt));
      past_[written_++ % past_.size()] = {x, y, heading};
      odometry.x += speed * dt * std::cos(odometry.heading);
      odometry.y += speed * dt * std::sin(odometry.heading);
      odometry.heading += rate * dt;
    }
    for (double& of_anchor : offset) {
      if (correlation_s_ > 0.0) {
        const double kept = std::exp(-0.1 / correlation_s_);
        of_anchor = kept * of_anchor + normal(rng_, kSigmaOffset * std::sqrt(1.0 - kept * kept));
      }
    }
    return odometry;
  }

  Range measure(Id anchor, Stamp stamp) {
    const auto k = static_cast<std::size_t>(anchor);
    const auto ago = static_cast<std::size_t>(std::round(delay / 0.001));
    const Pose2& then = past_[(written_ + past_.size() - 1 - ago) % past_.size()];
    const Range plain = testing::range_to(anchor, then, stamp);
    return {stamp, 0, anchor, (1.0 + scale[k]) * plain.range + offset[k] + normal(rng_, 0.05), {}};
  }

  double delay;
  std::array<double, 4> offset{};
  std::array<double, 4> scale{};
  double x;
  double y;
  double heading;

 private:
  double correlation_s_;
  Rng rng_;
  std::array<Pose2, 1000> past_{};
  std::size_t written_ = 0;
};

PoseEkf started(const PoseEkf::Config& config) {
  const Vector<3> sigma(0.1, 0.1, 0.05);
  return {config, {testing::hall(), testing::one_tag()}, {0, {}, sigma.cwiseAbs2().asDiagonal()}};
}

PoseEkf driven(Robot& robot, const PoseEkf::Config& config, int steps, double speed = 1.0) {
  PoseEkf ekf = started(config);
  for (int i = 0; i < steps; ++i) {
    ekf.on(Increment{i * kStep, (i + 1) * kStep, robot.drive(i, speed)});
    ekf.on(robot.measure(i % 4, (i + 1) * kStep));
  }
  return ekf;
}

struct Result {
  double nees_of_pose = 0.0;
  double nees_of_all = 0.0;
  double sigma_offset = 0.0;  // mean, at the end
  double sigma_delay = 0.0;
};

/// Robots whose errors are as `simulated` has them, to a filter that believes `config`.
Result measure(const PoseEkf::Config& config, const PoseEkf::Config& simulated = everything()) {
  Result result;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    Robot robot(seed, simulated);
    const PoseEkf ekf = driven(robot, config, 600);
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({robot.x, robot.y, wrap_angle(robot.heading)}, end.pose);
    result.nees_of_pose += error.dot(end.covariance.llt().solve(error)) / kRuns;
    const std::vector<CalibratedError> learnt = ekf.errors();
    Eigen::VectorXd all(static_cast<Eigen::Index>(3 + learnt.size()));
    all.head<3>() = error;
    for (std::size_t k = 0; k < learnt.size(); ++k) {
      const auto anchor = static_cast<std::size_t>(learnt[k].anchor.value_or(0));
      const bool is_offset = learnt[k].name == "anchor offset";
      const double truth = !learnt[k].anchor ? robot.delay
                           : is_offset       ? robot.offset[anchor]
                                             : robot.scale[anchor];
      all(static_cast<Eigen::Index>(3 + k)) = truth - learnt[k].value;
      (is_offset ? result.sigma_offset : result.sigma_delay) += (is_offset          ? 0.25
                                                                 : learnt[k].anchor ? 0.0
                                                                                    : 1.0) *
                                                                learnt[k].sigma / kRuns;
    }
    const Eigen::MatrixXd P = ekf.belief().P;
    result.nees_of_all += all.dot(P.llt().solve(all)) / kRuns;
  }
  return result;
}

TEST(RangeCalibration, learns_every_anchor_and_the_delay_and_knows_how_well) {
  const Result result = measure(everything());
  EXPECT_TRUE(in_band(result.nees_of_pose, 3, kRuns)) << result.nees_of_pose;
  EXPECT_TRUE(in_band(result.nees_of_all, 12, kRuns)) << result.nees_of_all;
  EXPECT_LT(result.sigma_offset, 0.5 * kSigmaOffset);
  EXPECT_LT(result.sigma_delay, 0.3 * kSigmaDelay);
}

TEST(RangeCalibration, considered_errors_are_accounted_for_and_never_learnt) {
  PoseEkf::Config config = everything();
  config.calibration.consider = true;
  const Result result = measure(config);
  EXPECT_TRUE(in_band(result.nees_of_pose, 3, kRuns)) << result.nees_of_pose;
  EXPECT_TRUE(in_band(result.nees_of_all, 12, kRuns)) << result.nees_of_all;
  Robot robot(1);
  for (const CalibratedError& error : driven(robot, config, 100).errors()) {
    EXPECT_EQ(error.value, 0.0) << error.name;
    EXPECT_NEAR(error.sigma, error.sigma_start, 1e-12) << error.name;
  }
}

TEST(RangeCalibration, without_it_the_same_robots_break_the_filter) {
  EXPECT_GT(measure(config_of(0.0, 0.0, 0.0)).nees_of_pose, 30.0);
}

PoseEkf::Config wandering() {
  PoseEkf::Config config = config_of(kSigmaOffset, 0.0, 0.0);
  config.calibration.anchor_offset_correlation_s = 5.0;
  return config;
}

TEST(RangeCalibration, offsets_that_wander_are_followed_and_known_as_well_as_they_can_be) {
  const Result result = measure(wandering(), wandering());
  EXPECT_TRUE(in_band(result.nees_of_pose, 3, kRuns)) << result.nees_of_pose;
  EXPECT_TRUE(in_band(result.nees_of_all, 7, kRuns)) << result.nees_of_all;
}

TEST(RangeCalibration, taken_for_constant_offsets_that_wander_break_the_filter) {
  EXPECT_GT(measure(config_of(kSigmaOffset, 0.0, 0.0), wandering()).nees_of_pose, 30.0);
}

TEST(RangeCalibration, offsets_that_wander_are_considered_as_large_as_they_are) {
  PoseEkf::Config config = wandering();
  config.calibration.consider = true;
  const Result result = measure(config, wandering());
  EXPECT_TRUE(in_band(result.nees_of_pose, 3, kRuns)) << result.nees_of_pose;
  Robot robot(1, wandering());
  for (const CalibratedError& error : driven(robot, config, 100).errors()) {
    EXPECT_EQ(error.value, 0.0) << error.name;
    EXPECT_NEAR(error.sigma, kSigmaOffset, 1e-12) << error.name;
  }
}

/// By hand: with P the variance before, after T it is P e^(-2 T / t) + s^2 (1 - e^(-2 T / t)).
TEST(RangeCalibration, what_was_learnt_of_an_offset_is_forgotten_with_time) {
  Robot robot(3, wandering());
  PoseEkf ekf = driven(robot, wandering(), 50);
  const CalibratedError before = ekf.errors()[2];
  ASSERT_LT(before.sigma, 0.9 * kSigmaOffset);
  ASSERT_GT(std::abs(before.value), 0.01);
  ekf.advance_to(50 * kStep + 2'000'000'000);
  const CalibratedError after = ekf.errors()[2];
  const double kept = std::exp(-2.0 / 5.0);
  EXPECT_NEAR(after.value, kept * before.value, 1e-12);
  EXPECT_NEAR(after.sigma * after.sigma,
              std::pow(kept * before.sigma, 2) + (1.0 - kept * kept) * std::pow(kSigmaOffset, 2),
              1e-12);
  ekf.advance_to(1'000'000'000'000);
  EXPECT_NEAR(ekf.errors()[2].value, 0.0, 1e-12);
  EXPECT_NEAR(ekf.errors()[2].sigma, kSigmaOffset, 1e-12);
}

TEST(RangeCalibration, a_delay_shows_by_driving_only) {
  Robot still(1);
  Robot moving(1);
  const PoseEkf::Config config = config_of(0.0, 0.0, kSigmaDelay);
  EXPECT_NEAR(driven(still, config, 100, 0.0).errors()[0].sigma, kSigmaDelay, 1e-12);
  EXPECT_LT(driven(moving, config, 100).errors()[0].sigma, 0.5 * kSigmaDelay);
}

TEST(RangeCalibration, names_each_error_and_whose_it_is) {
  const std::vector<CalibratedError> errors = started(everything()).errors();
  ASSERT_EQ(errors.size(), 9U);
  EXPECT_EQ(errors[0].name, "range delay");
  EXPECT_FALSE(errors[0].anchor.has_value());
  EXPECT_EQ(errors[3].name, "anchor offset");
  EXPECT_EQ(errors[3].anchor, std::optional<Id>(1));
  EXPECT_EQ(errors[4].name, "anchor scale");
  EXPECT_DOUBLE_EQ(errors[4].sigma_start, kSigmaScale);
}

TEST(RangeCalibration, what_is_not_fused_changes_no_bit) {
  Robot robot(2);
  PoseEkf::Config config = everything();
  config.range.gate = 0.999;
  config.calibration.anchor_offset_correlation_s = 5.0;
  PoseEkf ekf = driven(robot, config, 20);
  const GaussianBelief before = ekf.belief();
  EXPECT_EQ(ekf.on(Range{21 * kStep, 0, 1, 60.0, {}}).verdict, Verdict::kGated);
  EXPECT_EQ(ekf.on(Range{21 * kStep, 0, 9, 5.0, {}}).verdict, Verdict::kNotModelled);
  EXPECT_EQ(ekf.on(Range{21 * kStep, 7, 1, 5.0, {}}).verdict, Verdict::kNotModelled);
  EXPECT_TRUE(testing::same_bits(ekf.belief(), before));
  testing::expect_refused([&] { ekf.on_joint({robot.measure(0, 21 * kStep)}); },
                          "fuse them one by one");
}

TEST(RangeCalibration, without_anchors_no_offset_wanders) {
  PoseEkf::Config config;
  config.calibration.sigma_anchor_offset_m = kSigmaOffset;
  config.calibration.anchor_offset_correlation_s = 5.0;
  PoseEkf ekf(config, {}, {0, {1.0, 1.0, 0.0}, 0.01 * Matrix<3, 3>::Identity()});
  EXPECT_EQ(ekf.on(Velocity{kStep, 0.1, 0.0}).verdict, Verdict::kFused);
  const PositionFix fix{2 * kStep, {1.0, 1.0}, Matrix<2, 2>::Identity()};
  EXPECT_EQ(ekf.on(fix).verdict, Verdict::kFused);
}

}  // namespace
}  // namespace locfuse::test_calibration_ranges
