// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_pose_ekf_headings {
namespace {

using testing::in_band;
using testing::normal;
using testing::Rng;

constexpr Stamp kStep = 100'000'000;
constexpr int kRuns = 100;
constexpr double kSigmaHeading = 0.03;
constexpr double kSigmaFix = 0.5;
constexpr double kWander = 0.01;  // of the offset [rad / sqrt(s)]

PoseEkf::Config config_of(double sigma_offset = kPi) {
  PoseEkf::Config config;
  config.correlation_s = 0.0;
  config.odometry = {0.03, 0.03, 0.05, 0.05, 0.0, 0.0};
  config.position.gate = 1.0;
  config.heading.gate = 1.0;
  config.heading.least_sigma_rad = 0.01;
  config.calibration.sigma_heading_offset_rad = sigma_offset;
  config.calibration.sigma_heading_offset_rad_per_sqrt_s = sigma_offset > 0.0 ? kWander : 0.0;
  return config;
}

PoseEkf started(const PoseEkf::Config& config) {
  const Vector<3> sigma(0.3, 0.3, 0.2);
  return {config, {}, {0, {}, sigma.cwiseAbs2().asDiagonal()}};
}

/// A robot that winds about, written out in scalars, with a compass that is off.
class Robot {
 public:
  Robot(std::uint64_t seed, bool is_off) : rng_(seed), is_off_(is_off) {
    x = normal(rng_, 0.3);
    y = normal(rng_, 0.3);
    heading = normal(rng_, 0.2);
    offset = is_off ? testing::uniform(rng_, -3.0, 3.0) : 0.0;
  }
  Pose2 drive(int step) {
    const double rate = 0.5 * std::sin(0.07 * step) + 0.1;
    constexpr double dt = 0.001;
    Pose2 odometry;
    for (int i = 0; i < 100; ++i) {
      const double way = dt + normal(rng_, 0.03 * std::sqrt(dt));
      const double aside = normal(rng_, 0.03 * std::sqrt(dt));
      x += way * std::cos(heading) - aside * std::sin(heading);
      y += way * std::sin(heading) + aside * std::cos(heading);
      heading += rate * dt + normal(rng_, 0.05 * std::sqrt((1.0 + std::abs(rate)) * dt));
      odometry.x += dt * std::cos(odometry.heading);
      odometry.y += dt * std::sin(odometry.heading);
      odometry.heading += rate * dt;
    }
    offset += is_off_ ? normal(rng_, kWander * std::sqrt(0.1)) : 0.0;
    return odometry;
  }
  Heading compass(Stamp stamp) {
    return {stamp, heading + offset + normal(rng_, kSigmaHeading), kSigmaHeading};
  }
  PositionFix fix(Stamp stamp) {
    return {stamp,
            {x + normal(rng_, kSigmaFix), y + normal(rng_, kSigmaFix)},
            kSigmaFix * kSigmaFix * Matrix<2, 2>::Identity()};
  }
  double x;
  double y;
  double heading;
  double offset;

 private:
  Rng rng_;
  bool is_off_;
};

/// A filter on a minute of that robot, with a fix a second, which `read` gives the headings.
template <class Read>
PoseEkf driven(Robot& robot, const PoseEkf::Config& config, const Read& read) {
  PoseEkf ekf = started(config);
  for (int i = 0; i < 600; ++i) {
    const Stamp now = (i + 1) * kStep;
    ekf.on(Increment{i * kStep, now, robot.drive(i)});
    read(ekf, robot.compass(now));
    const PositionFix fix = robot.fix(now);
    if (i % 10 == 9) {
      ekf.on(fix);
    }
  }
  return ekf;
}

struct Result {
  double nees = 0.0;
  double nees_with_offset = 0.0;
  double sigma_heading = 0.0;
  double error_heading = 0.0;  // mean of squares
};

Result measure(const PoseEkf::Config& config, bool is_off, bool with_compass = true) {
  Result result;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    Robot robot(seed, is_off);
    const PoseEkf ekf = driven(robot, config, [&](PoseEkf& filter, const Heading& z) {
      if (with_compass) {
        EXPECT_EQ(filter.on(z).verdict, Verdict::kFused);
      }
    });
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local({robot.x, robot.y, wrap_angle(robot.heading)}, end.pose);
    result.nees += error.dot(end.covariance.llt().solve(error)) / kRuns;
    result.sigma_heading += std::sqrt(end.covariance(2, 2)) / kRuns;
    result.error_heading += error(2) * error(2) / kRuns;
    if (const auto learnt = ekf.errors(); !learnt.empty()) {
      Vector<4> all;
      all << error, wrap_angle(robot.offset - learnt.front().value);
      result.nees_with_offset += all.dot(ekf.belief().P.llt().solve(all)) / kRuns;
    }
  }
  return result;
}

TEST(Headings, of_a_compass_that_is_turned_anyhow_are_consistent) {
  const Result result = measure(config_of(), true);
  EXPECT_TRUE(in_band(result.nees, 3, kRuns)) << result.nees;
  EXPECT_TRUE(in_band(result.nees_with_offset, 4, kRuns)) << result.nees_with_offset;
  const Result without = measure(config_of(), true, false);
  EXPECT_LT(result.error_heading, 0.8 * without.error_heading);
  EXPECT_LT(result.sigma_heading, 0.9 * without.sigma_heading);
}

TEST(Headings, of_a_compass_that_is_right_are_consistent) {
  const Result result = measure(config_of(0.0), false);
  EXPECT_TRUE(in_band(result.nees, 3, kRuns)) << result.nees;
  EXPECT_LT(std::sqrt(result.error_heading), kSigmaHeading);
}

/// As if the compass were right, the same robots break the filter.
TEST(Headings, without_the_offset_as_a_state_a_turned_compass_is_rejected_or_misleads) {
  PoseEkf::Config config = config_of(0.0);
  config.heading.gate = 0.999;
  Robot robot(3, true);
  PoseEkf ekf = started(config);
  int rejected = 0;
  for (int i = 0; i < 50; ++i) {
    ekf.on(Increment{i * kStep, (i + 1) * kStep, robot.drive(i)});
    rejected += ekf.on(robot.compass((i + 1) * kStep)).verdict == Verdict::kGated ? 1 : 0;
  }
  const PoseEstimate end = ekf.estimate();
  const double off = wrap_angle(end.pose.heading - robot.heading);
  EXPECT_GT(rejected, 20);
  EXPECT_GT(std::abs(off), 5.0 * std::sqrt(end.covariance(2, 2)));
}

TEST(Headings, courses_give_a_robot_that_drives_its_heading) {
  PoseEkf::Config config = config_of();
  config.heading.antenna_forward_m = 0.5;
  for (const double forward : {1.0, -1.0}) {
    Rng rng(5);
    PoseEkf ekf(config, {}, {0, {0.0, 0.0, 2.6}, Vector<3>(0.1, 0.1, 0.5).asDiagonal()});
    const double turn = 0.3;
    double heading = 2.0;
    ekf.on(Velocity{0, forward, turn});
    for (int i = 1; i <= 50; ++i) {
      const Stamp now = i * kStep;
      heading += 0.1 * turn;
      ekf.on(Velocity{now, forward, turn});
      const double beta = std::atan2(0.5 * turn, forward);
      EXPECT_EQ(ekf.on(Heading{now, heading + beta + normal(rng, 0.1), 0.1, true}).verdict,
                Verdict::kFused);
    }
    const PoseEstimate end = ekf.estimate();
    EXPECT_LT(std::sqrt(end.covariance(2, 2)), 0.05);
    EXPECT_LT(std::abs(wrap_angle(end.pose.heading - heading)),
              3.0 * std::sqrt(end.covariance(2, 2)));
    EXPECT_TRUE(ekf.errors().empty());  // they have no offset
  }
}

TEST(Headings, a_course_at_rest_or_without_odometry_is_not_modelled) {
  const Heading course{kStep, 0.3, 0.1, true};
  PoseEkf ekf = started(config_of());
  EXPECT_EQ(ekf.on(course).reason, Reason::kNoDirection);
  ekf.on(Velocity{0, 0.1, 0.0});
  const Outcome outcome = ekf.on(course);
  EXPECT_EQ(outcome.verdict, Verdict::kNotModelled);
  EXPECT_EQ(outcome.reason, Reason::kNoDirection);
  ekf.on(Velocity{kStep, 1.0, 0.0});
  EXPECT_EQ(ekf.on(Heading{2 * kStep, 0.3, 0.1, true}).verdict, Verdict::kFused);
  // Long after the last odometry nobody knows where the body points.
  EXPECT_EQ(ekf.on(Heading{100 * kStep, 0.3, 0.1, true}).reason, Reason::kNoDirection);
}

TEST(Headings, that_are_not_fused_change_no_bit) {
  PoseEkf::Config config = config_of(0.1);
  config.heading.gate = 0.99;
  PoseEkf ekf = started(config);
  ekf.on(Velocity{0, 1.0, 0.1});
  const PoseEkf before = ekf;
  const auto is_unchanged = [&] {
    return ekf.belief().x == before.belief().x &&
           ekf.belief().P.rows() == before.belief().P.rows() &&
           ekf.belief().P == before.belief().P && ekf.belief().stamp == before.belief().stamp;
  };
  EXPECT_EQ(ekf.on(Heading{kStep, 2.0}).verdict, Verdict::kGated);
  EXPECT_TRUE(is_unchanged());
  EXPECT_EQ(ekf.on(Heading{-kStep, 0.0}).verdict, Verdict::kStale);
  EXPECT_TRUE(is_unchanged());
  testing::expect_refused([&] { ekf.on(Heading{kStep, std::nan("")}); }, "Heading.heading");
  EXPECT_TRUE(is_unchanged());
  EXPECT_EQ(ekf.on(Heading{kStep, 0.1}).verdict, Verdict::kFused);
  EXPECT_EQ(ekf.belief().dimension(), 4);
  const PoseEkf with = ekf;
  EXPECT_EQ(ekf.on(Heading{2 * kStep, 2.0}).verdict, Verdict::kGated);
  EXPECT_EQ(ekf.belief().x, with.belief().x);
  EXPECT_EQ(ekf.belief().P, with.belief().P);
}

/// As of an inertial unit that leaves its orientation at that of no rotation.
TEST(Headings, that_stand_still_while_the_body_turns_are_rejected) {
  for (const double sigma : {0.0, kPi}) {
    PoseEkf ekf = started(config_of(sigma));
    ekf.on(Velocity{0, 0.0, 0.5});
    int fused = 0;
    for (int i = 1; i <= 50; ++i) {
      ekf.on(Velocity{i * kStep, 0.0, 0.5});
      const Outcome outcome = ekf.on(Heading{i * kStep, 0.0, 0.05});
      fused += outcome.verdict == Verdict::kFused ? 1 : 0;
      EXPECT_EQ(outcome.verdict == Verdict::kImplausible, outcome.reason == Reason::kFrozen);
    }
    EXPECT_LE(fused, 4);
    EXPECT_NEAR(wrap_angle(ekf.pose().heading - 2.5), 0.0, 0.2);
    EXPECT_EQ(ekf.on(Heading{51 * kStep, 2.55, 0.05}).verdict, Verdict::kFused);
  }
}

/// Once seen, it is frozen until it changes, even where the body is turned back to it.
TEST(Headings, that_stand_still_are_rejected_on_a_winding_way) {
  for (const bool is_course : {false, true}) {
    PoseEkf ekf = started(config_of());
    Rng rng(3);
    int fused = 0;
    for (int i = 0; i < 300; ++i) {
      ekf.on(Velocity{i * kStep, 1.0, std::sin(0.1 * i)});
      const Heading z{i * kStep, 0.3 + normal(rng, 1e-9), 0.1, is_course};
      fused += ekf.on(z).verdict == Verdict::kFused ? 1 : 0;
    }
    EXPECT_LE(fused, 8);
  }
}

/// What it reads more may change by a few degrees in seconds, as near iron: not sure and wrong.
TEST(Headings, of_a_compass_beside_iron_do_not_mislead) {
  PoseEkf::Config config = config_of();
  config.calibration.sigma_heading_offset_rad_per_sqrt_s =
      Calibration::Config{}.sigma_heading_offset_rad_per_sqrt_s;
  config.heading = {};
  config.correlation_s = 10.0;
  config.position.gate = 0.999;
  int beyond = 0;
  constexpr int kRobots = 40;
  for (std::uint64_t seed = 1; seed <= kRobots; ++seed) {
    Robot robot(seed, false);
    const PoseEkf ekf = driven(robot, config, [&](PoseEkf& filter, Heading z) {
      z.heading += 0.17 * std::sin(robot.heading);
      filter.on(z);
    });
    const PoseEstimate end = ekf.estimate();
    const double off = wrap_angle(end.pose.heading - robot.heading);
    beyond += std::abs(off) > 3.0 * std::sqrt(end.covariance(2, 2)) ? 1 : 0;
  }
  EXPECT_LE(beyond, 1);
}

/// A robot that stands may read the same for hours.
TEST(Headings, that_stand_still_while_the_body_does_are_fused) {
  PoseEkf ekf = started(config_of());
  for (int i = 1; i <= 50; ++i) {
    ekf.on(Velocity{i * kStep, 1.0, 0.0});
    EXPECT_EQ(ekf.on(Heading{i * kStep, 0.7, 0.05}).verdict, Verdict::kFused);
  }
}

TEST(Headings, of_a_filter_that_starts_anew_are_learnt_anew) {
  PoseEkf ekf = started(config_of());
  ekf.on(Heading{kStep, 2.0});
  ASSERT_EQ(ekf.errors().size(), 1U);
  EXPECT_EQ(ekf.errors().front().name, "heading offset");
  EXPECT_NEAR(ekf.errors().front().value, 2.0, 0.05);
  const PoseEkf again = ekf.restarted({2 * kStep, {}, Matrix<3, 3>::Identity()});
  EXPECT_TRUE(again.errors().empty());
}

/// Poses of another localizer are kept apart from what everything else says: both learn the offset.
TEST(Headings, go_with_poses_of_another_localizer) {
  PoseEkf::Config config = config_of();
  config.correlation_s = 10.0;
  PoseEkf ekf = started(config);
  ekf.on(Velocity{0, 1.0, 0.1});
  Rng rng(8);
  for (int i = 1; i <= 200; ++i) {
    const Stamp now = i * kStep;
    const double t = 0.1 * i;
    const double heading = 0.1 * t;
    const Pose2 pose{std::sin(heading) / 0.1, (1.0 - std::cos(heading)) / 0.1, heading};
    if (i > 20) {
      EXPECT_EQ(ekf.on(Heading{now, heading + 1.0 + normal(rng, 0.02), 0.02}).verdict,
                Verdict::kFused);
    }
    EXPECT_EQ(
        ekf.on(PoseObservation{
                   now, retract(pose, {normal(rng, 0.1), normal(rng, 0.1), normal(rng, 0.05)}),
                   Vector<3>(0.01, 0.01, 0.0025).asDiagonal()})
            .verdict,
        Verdict::kFused);
  }
  ASSERT_EQ(ekf.errors().size(), 1U);
  EXPECT_LT(std::abs(ekf.errors().front().value - 1.0), 3.0 * ekf.errors().front().sigma);
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_headings
