// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <limits>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_calibration {
namespace {

using testing::expect_refused;
using testing::in_band;
using testing::normal;
using testing::Rng;
using testing::same_bits;

constexpr Stamp kStep = 100'000'000;
constexpr double kStep_s = 0.1;
constexpr int kRuns = 60;
const Pose2 kMount{0.3, -0.1, 0.2};

const std::shared_ptr<const LandmarkMap>& posts() {
  static const auto map =
      std::make_shared<const LandmarkMap>(std::vector<Landmark>{{10, {6.0, 5.0}},
                                                                {11, {-4.0, 6.0}},
                                                                {12, {-5.0, -4.0}},
                                                                {13, {5.0, -6.0}},
                                                                {14, {1.0, 3.0}},
                                                                {15, {-1.0, -2.5}}});
  return map;
}

/// As much as each error is off, one standard deviation, in the order of the states.
Calibration::Config everything() {
  return {0.03, 0.05, 0.04, 0.02, 0.0, 0.05, 0.03, 0.05, 0.02, 0.05};
}

PoseEkf::Config config_of(const Calibration::Config& calibration) {
  PoseEkf::Config config;
  config.correlation_s = 0.0;  // its errors are independent
  config.odometry = {0.02, 0.02, 0.02, 0.02, 0.0, 0.0};
  config.landmark = {0.02, 0.01};
  config.landmark.gate = 1.0;
  config.calibration = calibration;
  return config;
}

/// A robot with errors of its own that winds among the posts, written out in scalars.
class Robot {
 public:
  explicit Robot(std::uint64_t seed) : rng_(seed) {
    const double sigma[10] = {0.03, 0.05, 0.04, 0.02, 0.05, 0.05, 0.03, 0.05, 0.02, 0.05};
    for (std::size_t k = 0; k < 10; ++k) {
      errors[k] = normal(rng_, sigma[k]);
    }
    x = normal(rng_, 0.1);
    y = normal(rng_, 0.1);
    heading = normal(rng_, 0.05);
  }

  /// Odometry of the next tenth of a second, which it drives in a hundred steps.
  Pose2 drive(int step) {
    const double speed = 0.5;
    const double rate = 0.5 * std::sin(0.07 * step) + 0.25;
    constexpr int kParts = 100;
    const double dt = kStep_s / kParts;
    double odometry_x = 0.0;
    double odometry_y = 0.0;
    double odometry_heading = 0.0;
    for (int i = 0; i < kParts; ++i) {
      const double turn = rate * dt + normal(rng_, 0.02 * std::sqrt((speed + rate) * dt));
      const double way = speed * dt + normal(rng_, 0.02 * std::sqrt(speed * dt));
      const double aside = normal(rng_, 0.02 * std::sqrt(speed * dt));
      const double along = heading + errors[1];
      x += way * std::cos(along) - aside * std::sin(along);
      y += way * std::sin(along) + aside * std::cos(along);
      heading += turn;
      past_[written_++ % past_.size()] = {x, y, heading};
      const double odometry_way = speed * dt / (1.0 + errors[0]);
      odometry_x += odometry_way * std::cos(odometry_heading);
      odometry_y += odometry_way * std::sin(odometry_heading);
      odometry_heading += (rate + errors[3]) * dt / (1.0 + errors[2]);
    }
    return {odometry_x, odometry_y, odometry_heading};
  }

  /// A post as it was seen some time ago.
  RangeBearing see(const Landmark& post, Stamp stamp) {
    const auto ago = static_cast<std::size_t>(std::max(0.0, std::round(errors[9] / 0.001)));
    const Pose2& then = past_[(written_ - 1 - std::min(ago, written_ - 1)) % past_.size()];
    const double c = std::cos(then.heading);
    const double s = std::sin(then.heading);
    const double mount_x = kMount.x + errors[4];
    const double mount_y = kMount.y + errors[5];
    const double dx = post.position.x() - (then.x + c * mount_x - s * mount_y);
    const double dy = post.position.y() - (then.y + s * mount_x + c * mount_y);
    const double range = (1.0 + errors[8]) * std::hypot(dx, dy) + errors[7];
    const double bearing = std::atan2(dy, dx) - then.heading - kMount.heading - errors[6];
    return {stamp, post.id, range + normal(rng_, 0.02), bearing + normal(rng_, 0.01), {}};
  }

  std::array<double, 10> errors{};
  double x;
  double y;
  double heading;

 private:
  Rng rng_;
  std::array<Pose2, 500> past_{};
  std::size_t written_ = 0;
};

PoseEkf started(const PoseEkf::Config& config) {
  const Vector<3> sigma(0.1, 0.1, 0.05);
  return {config, {{}, {}, {posts(), kMount}}, {0, {}, sigma.cwiseAbs2().asDiagonal()}};
}

struct Result {
  double nees_of_pose = 0.0;
  double nees_of_all = 0.0;
  double nis = 0.0;
  int sightings = 0;
  std::array<double, 10> sigma{};  // mean, at the end
};

Result measure(const Calibration::Config& calibration) {
  Result result;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    Robot robot(seed);
    robot.errors[9] = std::abs(robot.errors[9]);  // nothing is seen before it happens
    PoseEkf ekf = started(config_of(calibration));
    for (int i = 0; i < 300; ++i) {
      ekf.on(Increment{i * kStep, (i + 1) * kStep, robot.drive(i)});
      for (const Landmark& post : posts()->landmarks()) {
        if ((i + post.id) % 3 == 0) {
          const Outcome outcome = ekf.on(robot.see(post, (i + 1) * kStep));
          result.nis += outcome.nis / outcome.dof;
          ++result.sightings;
        }
      }
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({robot.x, robot.y, wrap_angle(robot.heading)}, end.pose);
    result.nees_of_pose += error.dot(end.covariance.llt().solve(error)) / kRuns;
    const std::vector<CalibratedError> learnt = ekf.errors();
    Eigen::VectorXd all(static_cast<Eigen::Index>(3 + learnt.size()));
    all.head<3>() = error;
    for (std::size_t k = 0; k < learnt.size(); ++k) {
      all(static_cast<Eigen::Index>(3 + k)) = robot.errors[k] - learnt[k].value;
      result.sigma[k] += learnt[k].sigma / kRuns;
    }
    const Eigen::MatrixXd P = ekf.belief().P;
    result.nees_of_all += all.dot(P.llt().solve(all)) / kRuns;
  }
  result.nis /= result.sightings;
  return result;
}

TEST(Calibration, learns_every_error_and_knows_how_well) {
  const Result result = measure(everything());
  EXPECT_TRUE(in_band(result.nees_of_pose, 3, kRuns)) << result.nees_of_pose;
  EXPECT_TRUE(in_band(result.nees_of_all, 13, kRuns)) << result.nees_of_all;
  EXPECT_NEAR(result.nis, 1.0, 0.03);
  // Travel askew and a sensor turned on the body look the same but for what was known before: what
  // is left of the sensor's heading is at most 0.05 * 0.03 / hypot(0.05, 0.03).
  const double most[10] = {0.02, 0.035, 0.02, 0.01, 0.03, 0.03, 0.0257, 0.02, 0.01, 0.02};
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_LT(result.sigma[k], most[k]) << k;
  }
}

TEST(Calibration, without_it_the_same_robots_break_the_filter) {
  const Result result = measure({});
  EXPECT_GT(result.nees_of_pose, 100.0);
  EXPECT_GT(result.nis, 3.0);
}

TEST(Calibration, of_nothing_adds_no_state) {
  PoseEkf ekf = started(config_of({}));
  EXPECT_TRUE(ekf.errors().empty());
  EXPECT_EQ(ekf.belief().dimension(), 3);
}

/// One that has driven for a second.
PoseEkf driven(Robot& robot) {
  PoseEkf ekf = started(config_of(everything()));
  for (int i = 0; i < 10; ++i) {
    ekf.on(Increment{i * kStep, (i + 1) * kStep, robot.drive(i)});
    ekf.on(robot.see(posts()->landmarks()[0], (i + 1) * kStep));
  }
  return ekf;
}

TEST(Calibration, a_message_that_is_not_fused_changes_no_bit) {
  Robot robot(4);
  PoseEkf::Config config = config_of(everything());
  config.landmark.gate = 0.99;
  PoseEkf ekf = started(config);
  ekf.on(Increment{0, kStep, robot.drive(0)});
  ekf.on(robot.see(posts()->landmarks()[0], kStep));
  const GaussianBelief before = ekf.belief();
  RangeBearing wrong = robot.see(posts()->landmarks()[1], 5 * kStep);
  *wrong.range += 30.0;
  EXPECT_EQ(ekf.on(wrong).verdict, Verdict::kGated);
  EXPECT_EQ(ekf.on(RangeBearing{6 * kStep, 99, 1.0, 0.0, {}}).verdict, Verdict::kNotModelled);
  EXPECT_EQ(ekf.on(RangeBearing{0, 10, 1.0, 0.0, {}}).verdict, Verdict::kStale);
  EXPECT_TRUE(same_bits(ekf.belief(), before));
}

TEST(Calibration, an_estimate_ahead_changes_no_bit) {
  Robot robot(5);
  const PoseEkf ekf = driven(robot);
  const GaussianBelief before = ekf.belief();
  EXPECT_GT(ekf.estimate(20 * kStep).covariance(0, 0), ekf.estimate().covariance(0, 0));
  EXPECT_TRUE(same_bits(ekf.belief(), before));
}

TEST(Calibration, sightings_without_names_find_the_same_landmarks) {
  Robot robot(6);
  PoseEkf named = driven(robot);
  PoseEkf alone = named;
  PoseEkf together = named;
  std::vector<RangeBearing> seen;
  for (const Landmark& post : posts()->landmarks()) {
    seen.push_back(robot.see(post, 10 * kStep));
    EXPECT_EQ(named.on(seen.back()).verdict, Verdict::kFused);
    seen.back().landmark.reset();
    EXPECT_EQ(alone.on(seen.back()).verdict, Verdict::kFused);
  }
  for (const Outcome& outcome : together.on_joint(seen)) {
    EXPECT_EQ(outcome.verdict, Verdict::kFused);
  }
  EXPECT_TRUE(same_bits(alone.belief(), named.belief()));
  EXPECT_TRUE(same_bits(together.belief(), named.belief()));
}

TEST(Calibration, started_anew_it_has_learnt_nothing) {
  Robot robot(7);
  const PoseEkf ekf = driven(robot).restarted(started({}).current());
  ASSERT_EQ(ekf.errors().size(), 10);
  EXPECT_EQ(ekf.errors()[0].name, "scale");
  EXPECT_EQ(ekf.errors()[0].value, 0.0);
  EXPECT_NEAR(ekf.errors()[0].sigma, 0.03, 1e-15);
}

TEST(Calibration, refuses_what_cannot_be) {
  expect_refused([] { Calibration({-0.1}); }, "calibration.sigma_scale", "-0.1");
  expect_refused([] { Calibration({1e160}); }, "calibration.sigma_scale", "expected 0 to 1e6");
  Calibration::Config config;
  config.sigma_delay_s = std::numeric_limits<double>::quiet_NaN();
  expect_refused([&] { Calibration{config}; }, "calibration.sigma_delay_s", "nan");
  config = {};
  config.sigma_turn_bias_radps_per_sqrt_s = 0.1;
  expect_refused([&] { Calibration{config}; }, "sigma_turn_bias_radps is 0", "both or neither");
  config = {};
  config.anchor_offset_correlation_s = 5.0;
  expect_refused([&] { Calibration{config}; }, "sigma_anchor_offset_m is 0", "both or neither");
}

TEST(Calibration, a_bias_that_wanders_is_never_known_for_good) {
  Calibration::Config config;
  config.sigma_turn_bias_radps = 0.02;
  config.sigma_turn_bias_radps_per_sqrt_s = 0.01;
  PoseEkf ekf = started(config_of(config));
  ekf.on(Increment{0, 40 * kStep, {}});
  ekf.advance_to(40 * kStep);
  EXPECT_NEAR(ekf.errors()[0].sigma, std::sqrt(0.0004 + 4.0 * 0.0001), 1e-12);
}

}  // namespace
}  // namespace locfuse::test_calibration
