// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "locfuse/particles/switching_mcl.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse::test_switching_mcl {
namespace {

using testing::expect_refused;
using testing::Rng;
using InjectionReason = SwitchingMcl::InjectionReason;

constexpr auto kSecond = static_cast<Stamp>(kNanosecondsPerSecond);

double distance(const Vector<2>& a, const Vector<2>& b) { return (a - b).norm(); }

/// A room, a robot that stands in its middle, and a laser that may be covered.
class Standing {
 public:
  Standing() : room_(testing::random_room(rng_)), truth_(room_.middle) {}

  [[nodiscard]] SwitchingMcl estimator(const SwitchingMcl::Config& config = {},
                                       double drift = 0.4) const {
    Mcl::Config mcl;
    mcl.min_particles = mcl.max_particles = 2000;
    mcl.hold_s = 1e6;
    mcl.scouts = 0;
    mcl.spacing_m = 0.0;  // every scan is used at standstill
    mcl.odometry.sigma_xy_per_sqrt_s = drift;
    mcl.odometry.sigma_heading_per_sqrt_s = 0.01;
    Mcl particles(mcl, testing::on_map(room_.map), 0);
    particles.start_at({{start(truth_, 0.05), 1.0}});
    RecoveringEkf::Config by_uwb;
    by_uwb.start.estimator.odometry = mcl.odometry;
    by_uwb.start.estimator.hold_s = 1e6;
    RecoveringEkf uwb(by_uwb, {});
    uwb.start_at(start(truth_, 0.05));
    uwb.on(Velocity{0, 0.0, 0.0});  // it stands, as odometry says
    return {config, particles, uwb};
  }

  [[nodiscard]] static PoseEstimate start(const Pose2& pose, double sigma) {
    const Vector<3> sigmas(sigma, sigma, 0.02);
    return {0, pose, sigmas.cwiseAbs2().asDiagonal()};
  }

  [[nodiscard]] PositionFix fix(double seconds, const Vector<2>& off = {0.0, 0.0}) const {
    return {stamp(seconds), truth_.position() + off, 0.01 * Matrix<2, 2>::Identity()};
  }

  LaserScan scan(double seconds, bool is_covered) {
    LaserScan z = testing::scan_from(room_.walls, truth_, rng_, 0.02);
    if (is_covered) {
      std::fill(z.ranges.begin(), z.ranges.end(), std::numeric_limits<double>::quiet_NaN());
    }
    z.stamp = stamp(seconds);
    return z;
  }

  [[nodiscard]] static Stamp stamp(double seconds) {
    return static_cast<Stamp>(std::llround(seconds * static_cast<double>(kSecond)));
  }
  [[nodiscard]] const Pose2& truth() const { return truth_; }

 private:
  Rng rng_{7};
  testing::Room room_;
  Pose2 truth_;
};

TEST(SwitchingMcl, while_particles_are_certain_uwb_changes_no_bit) {
  Standing world;
  SwitchingMcl switching = world.estimator({}, 0.05);
  Mcl alone = switching.mcl();
  for (int i = 1; i <= 20; ++i) {
    const LaserScan z = world.scan(0.5 * i, false);
    switching.on(world.fix(0.5 * i, {0.2, 0.1}));  // off by less than elsewhere_m
    switching.on(z);
    alone.on(z);
  }
  EXPECT_TRUE(switching.injections().empty());
  EXPECT_EQ(switching.mcl().belief().x, alone.belief().x);
  EXPECT_EQ(switching.mcl().belief().weight, alone.belief().weight);
}

TEST(SwitchingMcl, injects_the_uwb_pose_where_particles_have_spread) {
  Standing world;
  SwitchingMcl switching = world.estimator();
  for (int i = 1; i <= 10 && switching.injections().empty(); ++i) {
    switching.on(world.fix(0.5 * i));
    switching.on(world.scan(0.5 * i, true));
  }
  ASSERT_EQ(switching.injections().size(), 1U);
  const SwitchingMcl::Injection& event = switching.injections().front();
  EXPECT_EQ(event.reason, InjectionReason::kUncertain);
  // sigma 0.4 per root of a second is 0.5 m after 1.6 s: at the scan of 2 s, and doubt_s is 2 s.
  EXPECT_EQ(event.stamp, Standing::stamp(4.0));
  EXPECT_NEAR(event.before.sigma_position(), 0.4 * 2.0, 0.05);
  EXPECT_LT(event.after.sigma_position(), 0.12);
  const PoseEstimate now = switching.estimate();
  EXPECT_LT(distance(now.pose.position(), world.truth().position()), 0.15);
  EXPECT_NEAR(switching.mcl().overall_estimate().sigma_position(), event.after.sigma_position(),
              0.03);
  EXPECT_EQ(now.stamp, event.stamp);
}

/// Injections within ten seconds of a covered laser.
std::size_t injections_in_ten_seconds(const SwitchingMcl::Config& config, double uwb_until = 1e9,
                                      double drift = 0.4) {
  Standing world;
  SwitchingMcl switching = world.estimator(config, drift);
  for (int i = 1; i <= 20; ++i) {
    if (0.5 * i <= uwb_until) {
      switching.on(world.fix(0.5 * i));
    }
    switching.on(world.scan(0.5 * i, true));
  }
  return switching.injections().size();
}

TEST(SwitchingMcl, does_not_switch_to_uwb_that_is_out_of_range_or_uncertain) {
  EXPECT_GE(injections_in_ten_seconds({}), 1U);
  EXPECT_EQ(injections_in_ten_seconds({}, 1.0), 0U);  // silent since then
  SwitchingMcl::Config strict;
  strict.uwb_sigma_m = 0.01;
  EXPECT_EQ(injections_in_ten_seconds(strict), 0U);
}

TEST(SwitchingMcl, does_not_switch_to_uwb_whose_fixes_contradict_one_another) {
  Standing world;
  for (const bool is_consistent : {true, false}) {
    SwitchingMcl switching = world.estimator();
    for (int i = 1; i <= 60; ++i) {
      const double off = is_consistent ? 0.1 : 0.35;  // one or three and a half sigma
      switching.on(world.fix(0.25 * i, {i % 2 == 0 ? off : -off, 0.0}));
      switching.on(world.scan(0.25 * i, i > 40));
    }
    EXPECT_EQ(switching.uwb_nis() < 1.4, is_consistent) << switching.uwb_nis();
    EXPECT_EQ(switching.injections().empty(), !is_consistent);
  }
}

TEST(SwitchingMcl, a_short_suspicion_does_not_switch) {
  Standing world;
  SwitchingMcl::Config patient;
  patient.sigma_unsure_m = 0.25;
  patient.sigma_sure_m = patient.uwb_sigma_m = 0.2;
  patient.doubt_s = 3.0;
  SwitchingMcl switching = world.estimator(patient, 0.15);
  double widest = 0.0;
  for (int i = 1; i <= 96; ++i) {
    switching.on(world.fix(0.5 * i));
    switching.on(world.scan(0.5 * i, i % 24 > 0 && i % 24 < 8));  // uncovered after 4 s
    widest = std::max(widest, switching.mcl().overall_estimate().sigma_position());
  }
  EXPECT_GT(widest, patient.sigma_unsure_m);
  EXPECT_TRUE(switching.injections().empty());
}

TEST(SwitchingMcl, particles_are_suspect_until_they_are_certain_again) {
  // Hysteresis: between the two thresholds the state stays.
  SwitchingMcl::Config wide;
  wide.sigma_unsure_m = 1.25;  // reached in 9.8 s
  wide.sigma_sure_m = 0.3;
  wide.doubt_s = 0.4;
  EXPECT_EQ(injections_in_ten_seconds(wide), 0U);
  wide.sigma_unsure_m = 0.8;
  EXPECT_EQ(injections_in_ten_seconds(wide), 2U);
}

TEST(SwitchingMcl, certain_particles_that_contradict_uwb_are_suspect) {
  Standing world;
  SwitchingMcl switching = world.estimator({}, 0.01);
  const Pose2 wrong = world.truth() * Pose2{1.2, 0.0, 0.0};
  SwitchingMcl::Config config;
  config.elsewhere_m = 0.5;
  Mcl particles = switching.mcl();
  particles.start_at({{Standing::start(wrong, 0.05), 1.0}});
  switching = SwitchingMcl(config, particles, switching.uwb());
  for (int i = 1; i <= 10 && switching.injections().empty(); ++i) {
    switching.on(world.fix(0.5 * i));
    switching.on(world.scan(0.5 * i, true));
  }
  ASSERT_EQ(switching.injections().size(), 1U);
  EXPECT_EQ(switching.injections().front().reason, InjectionReason::kElsewhere);
  EXPECT_LT(distance(switching.estimate().pose.position(), world.truth().position()), 0.15);
}

TEST(SwitchingMcl, the_overall_covariance_is_that_of_all_clusters) {
  Standing world;
  SwitchingMcl switching = world.estimator();
  Mcl two = switching.mcl();
  const PoseEstimate here = Standing::start(world.truth(), 0.05);
  const PoseEstimate there = Standing::start(world.truth() * Pose2{2.0, 0.0, 0.0}, 0.05);
  two.start_at({{here, 0.5}, {there, 0.5}});
  EXPECT_LT(two.estimate().sigma_position(), 0.07);
  EXPECT_NEAR(two.overall_estimate().sigma_position(), 1.0, 0.02);
}

TEST(Mcl, an_injected_pose_leaves_odometry_as_it_was) {
  Standing world;
  Mcl mcl = world.estimator().mcl();
  mcl.on(Velocity{0, 0.5, 0.0});
  PoseEstimate pose = Standing::start(world.truth(), 0.001);
  pose.stamp = kSecond;
  mcl.inject(pose);
  mcl.on(Velocity{2 * kSecond, 0.0, 0.0});
  const PoseEstimate now = mcl.estimate();
  EXPECT_EQ(now.stamp, 2 * kSecond);
  const Vector<2> ahead = (world.truth() * Pose2{0.5, 0.0, 0.0}).position();
  EXPECT_LT(distance(now.pose.position(), ahead), 0.05);
}

TEST(Mcl, a_share_of_the_particles_is_replaced) {
  Standing world;
  Mcl mcl = world.estimator().mcl();
  const Pose2 there = world.truth() * Pose2{1.5, 0.0, 0.0};
  mcl.inject(Standing::start(there, 0.05), 0.25);
  ASSERT_EQ(mcl.hypotheses().size(), 2U);
  EXPECT_NEAR(mcl.hypotheses()[0].probability, 0.75, 0.01);
  EXPECT_NEAR(mcl.hypotheses()[1].probability, 0.25, 0.01);
  EXPECT_LT(distance(mcl.hypotheses()[1].estimate.pose.position(), there.position()), 0.02);
}

TEST(Mcl, refuses_to_inject_an_invalid_pose) {
  Standing world;
  Mcl mcl = world.estimator().mcl();
  mcl.on(world.scan(1.0, false));
  const Mcl before = mcl;
  const auto at = [&](double seconds) {
    PoseEstimate pose = Standing::start(world.truth(), 0.1);
    pose.stamp = Standing::stamp(seconds);
    return pose;
  };
  expect_refused([&] { mcl.inject(at(0.5)); }, "before the last message");
  expect_refused([&] { mcl.inject(at(1.0), 0.0); }, "share");
  expect_refused([&] { mcl.inject(at(1.0), 1.5); }, "share");
  PoseEstimate flat = at(1.0);
  flat.covariance(0, 0) = 0.0;
  expect_refused([&] { mcl.inject(flat); }, "positive definite");
  EXPECT_EQ(mcl.belief().x, before.belief().x);
}

TEST(SwitchingMcl, refuses_thresholds_that_would_fire_again_and_again) {
  Standing world;
  const auto refused = [&](void (*change)(SwitchingMcl::Config&), const char* what) {
    SwitchingMcl::Config config;
    change(config);
    expect_refused([&] { (void)world.estimator(config); }, what);
  };
  refused([](auto& c) { c.sigma_sure_m = 0.6; }, "sigma_sure_m <= sigma_unsure_m");
  refused([](auto& c) { c.sigma_sure_rad = 0.4; }, "sigma_sure_rad <= sigma_unsure_rad");
  refused([](auto& c) { c.uwb_sigma_m = 0.35; }, "uwb_sigma_m <= sigma_sure_m");
  refused([](auto& c) { c.uwb_sigma_rad = 0.3; }, "uwb_sigma_rad <= sigma_sure_rad");
  refused([](auto& c) { c.share = 0.0; }, "0 < share <= 1");
  refused([](auto& c) { c.doubt_s = -1.0; }, "doubt_s");
  refused([](auto& c) { c.elsewhere_m = std::nan(""); }, "elsewhere_m");
}

TEST(SwitchingMcl, a_copy_is_a_snapshot) {
  Standing world;
  SwitchingMcl switching = world.estimator();
  switching.on(world.fix(0.5));
  SwitchingMcl copy = switching;
  for (int i = 2; i <= 10; ++i) {
    const LaserScan z = world.scan(0.5 * i, true);
    switching.on(world.fix(0.5 * i));
    switching.on(z);
    copy.on(world.fix(0.5 * i));
    copy.on(z);
  }
  EXPECT_FALSE(copy.injections().empty());
  EXPECT_EQ(copy.mcl().belief().x, switching.mcl().belief().x);
}

/// With an age of less than a nanosecond every scan of one stamp inflated it, up to infinity.
TEST(SwitchingMcl, inflates_the_uwb_filter_once_per_stamp) {
  const Standing standing;
  SwitchingMcl::Config config;
  config.uwb_age_s = 1e-10;
  SwitchingMcl robot = standing.estimator(config);
  for (int i = 0; i < 200; ++i) {
    const Vector<2> at(i % 2 == 0 ? 50.0 : -50.0, 0.0);
    robot.on(PositionFix{kSecond, at, 0.01 * Matrix<2, 2>::Identity()});
  }
  robot.on(PositionFix{kSecond, standing.truth().position(), 0.01 * Matrix<2, 2>::Identity()});
  LaserScan none{kSecond, testing::laser(), std::vector<double>(360, std::nan(""))};
  for (int i = 0; i < 400; ++i) {
    robot.on(none);
  }
  EXPECT_TRUE(Eigen::MatrixXd(robot.uwb().estimator()->belief().P).allFinite());
}

TEST(SwitchingMcl, remembers_the_last_thousand_injections) {
  Standing world;
  SwitchingMcl::Config hasty;
  hasty.doubt_s = 1e-3;
  hasty.sigma_unsure_rad = hasty.sigma_sure_rad = hasty.uwb_sigma_rad = 10.0;  // it stands
  SwitchingMcl switching = world.estimator(hasty);
  std::size_t times = 0;
  Stamp last = 0;
  for (int i = 1; times < 1010 && i < 5000; ++i) {
    switching.on(world.fix(2.0 * i));
    switching.on(world.scan(2.0 * i, true));
    if (!switching.injections().empty() && switching.injections().back().stamp > last) {
      last = switching.injections().back().stamp;
      ++times;
    }
  }
  EXPECT_EQ(times, 1010U);
  EXPECT_EQ(switching.injections().size(), 1000U);
}

}  // namespace
}  // namespace locfuse::test_switching_mcl
