// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>
#include <functional>

#include "locfuse/error.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "locfuse/recovery/initializer.hpp"
#include "locfuse/replay/start.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_initializer {
namespace {

using testing::kSecond;

constexpr Stamp kTick = kSecond / 10;

std::shared_ptr<const AnchorMap> corners() {
  return std::make_shared<const AnchorMap>(std::vector<Anchor>{
      {0, {0.0, 0.0, 1.0}}, {1, {10.0, 0.0, 1.0}}, {2, {9.0, 8.0, 1.0}}, {3, {-1.0, 9.0, 1.0}}});
}

/// A robot whose steps are given, and its messages; every one without noise unless asked.
struct Robot {
  Pose2 pose;
  std::vector<Tag> tags;
  std::shared_ptr<const AnchorMap> anchors;
  double sigma = 0.0;
  testing::Rng rng{1};
  Stamp now = 0;

  void feed(Initializer& initializer) {
    for (const Tag& tag : tags) {
      const Vector<2> at = pose.act(tag.position.head<2>());
      for (const Anchor& anchor : anchors->anchors()) {
        const double distance =
            std::hypot(at.x() - anchor.position.x(), at.y() - anchor.position.y(),
                       tag.position.z() - anchor.position.z());
        initializer.on(Range{now, tag.id, anchor.id, distance + testing::normal(rng, sigma), {}});
      }
    }
  }

  void step(Initializer& initializer, const Pose2& motion) {
    initializer.on(Increment{now, now + kTick, motion});
    pose = pose * motion;
    now += kTick;
    feed(initializer);
  }
};

std::vector<Tag> centred() { return {{0, {0.0, 0.0, 1.0}}}; }

Initializer initializer_of(const Robot& robot, Initializer::Config config = {}) {
  config.estimator.range.sigma_m = 0.05;
  config.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  return {config, {robot.anchors, robot.tags}};
}

TEST(Initializer, has_nothing_to_say_before_the_first_message) {
  const Robot robot{{}, centred(), corners()};
  const Initializer initializer = initializer_of(robot);
  EXPECT_EQ(initializer.state().status, StartStatus::kWaiting);
  EXPECT_TRUE(initializer.state().hypotheses.empty());
  EXPECT_FALSE(initializer.state().reason.empty());
  testing::expect_refused([&] { (void)initializer.estimator(); }, "not ready");
}

TEST(Initializer, waits_for_a_heading_as_long_as_one_tag_stands_still) {
  Robot robot{{3.0, 4.0, 1.0}, centred(), corners(), 0.05};
  Initializer initializer = initializer_of(robot);
  for (int i = 0; i < 200; ++i) {
    robot.step(initializer, {});
  }
  const Initializer::State state = initializer.state();
  EXPECT_EQ(state.status, StartStatus::kWaiting);
  ASSERT_EQ(state.hypotheses.size(), 1U);
  EXPECT_NEAR(state.hypotheses[0].estimate.pose.x, 3.0, 0.1);
  EXPECT_NEAR(state.hypotheses[0].estimate.pose.y, 4.0, 0.1);
  EXPECT_GT(std::sqrt(state.hypotheses[0].estimate.covariance(2, 2)), 1.0);
  EXPECT_NE(state.reason.find("heading"), std::string::npos);
}

TEST(Initializer, stops_averaging_ranges_of_a_robot_that_stands) {
  Robot robot{{3.0, 4.0, 1.0}, centred(), corners(), 0.05};
  Initializer initializer = initializer_of(robot);
  for (int i = 0; i < 20; ++i) {
    robot.step(initializer, {});
  }
  const Matrix<3, 3> after_20 = initializer.state().hypotheses[0].estimate.covariance;
  for (int i = 0; i < 200; ++i) {
    robot.step(initializer, {});
  }
  const Matrix<3, 3> after_220 = initializer.state().hypotheses[0].estimate.covariance;
  EXPECT_NEAR(after_220(0, 0) / after_20(0, 0), 1.0, 0.05);
}

TEST(Initializer, knows_heading_from_a_short_drive) {
  for (const double heading : {0.0, 0.7, 2.0, -kPi, -2.5, -0.3}) {
    Robot robot{{3.0, 4.0, heading}, centred(), corners()};
    Initializer initializer = initializer_of(robot);
    int steps = 0;
    for (; steps < 60 && initializer.state().status != StartStatus::kReady; ++steps) {
      robot.step(initializer, {0.05, 0.0, 0.0});
    }
    ASSERT_LT(steps, 60) << heading;
    EXPECT_GT(0.05 * steps, 0.2) << "a heading to 5 degrees needs a way longer than the noise";
    const PoseEstimate found = initializer.estimator().estimate();
    testing::expect_pose_near(found.pose, robot.pose, 0.05);
  }
}

/// Mean NEES over `runs` drives of `seconds`, in which it is ready from some moment on.
double nees_after(double seconds, int runs) {
  double nees = 0.0;
  for (int seed = 1; seed <= runs; ++seed) {
    const testing::Simulation run = testing::simulate(static_cast<std::uint64_t>(seed), seconds);
    Initializer::Config config;
    config.estimator.range.sigma_m = 0.1;
    config.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
    Initializer initializer(config, {testing::hall(), testing::one_tag()});
    for (const Message& message : run.messages) {
      initializer.on(message);
    }
    EXPECT_EQ(initializer.state().status, StartStatus::kReady) << seed;
    const PoseEstimate found = initializer.estimator().estimate();
    const Vector<3> error = local({run.x, run.y, wrap_angle(run.heading)}, found.pose);
    nees += error.dot(found.covariance.llt().solve(error)) / runs;
  }
  return nees;
}

TEST(Initializer, errs_as_much_as_it_believes_once_it_is_ready) {
  constexpr int kRuns = 60;
  const double nees = nees_after(5.0, kRuns);
  EXPECT_GE(nees, chi_squared_quantile(3 * kRuns, 0.005) / kRuns);
  EXPECT_LE(nees, chi_squared_quantile(3 * kRuns, 0.995) / kRuns);
}

/// A start of a drive of up to a minute: when it was ready, and how wrong it was then.
struct Start {
  double seconds = -1.0;
  double nees = 0.0;
};

Start start_of(Robot robot, Initializer initializer, double step_m,
               const std::function<void(Robot&, Initializer&)>& measure) {
  for (int i = 0; i < 600; ++i) {
    const Pose2 motion{step_m, 0.0, i > 60 && i < 76 ? -0.1 : 0.0};
    const double turn_sigma =
        std::sqrt(4e-4 * step_m + 9e-4 * std::abs(motion.heading));  // as OdometryMotion has it
    initializer.on(Increment{robot.now,
                             robot.now + kTick,
                             {motion.x + testing::normal(robot.rng, 0.03 * std::sqrt(step_m)), 0.0,
                              motion.heading + testing::normal(robot.rng, turn_sigma)}});
    robot.pose = robot.pose * motion;
    robot.now += kTick;
    measure(robot, initializer);
    if (initializer.state().status == StartStatus::kReady) {
      const PoseEstimate found = initializer.estimator().estimate();
      const Vector<3> error = local(robot.pose, found.pose);
      return {seconds_between(0, robot.now), error.dot(found.covariance.llt().solve(error))};
    }
  }
  return {};
}

/// Of a robot that stands outside the hull of its anchors, 12 m from the next one.
Start start_outside(int seed, double sigma, double stated) {
  const auto far = std::make_shared<const AnchorMap>(std::vector<Anchor>{{0, {10.0, 10.0, 2.0}},
                                                                         {1, {18.0, 10.0, 2.0}},
                                                                         {2, {18.0, 18.0, 2.0}},
                                                                         {3, {10.0, 18.0, 0.5}}});
  Robot robot{{3.0, 1.0, 0.5 * kPi}, {{0, {0.0, 0.0, 0.3}}}, far, sigma};
  robot.rng.seed(static_cast<unsigned>(seed));
  Initializer::Config config;
  config.estimator.range.sigma_m = stated;
  config.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  return start_of(robot, {config, {far, robot.tags}}, 0.04,
                  [](Robot& one, Initializer& initializer) { one.feed(initializer); });
}

/// Outside the hull a heading and a place that are both wrong explain much: what is stated of the
/// noise decides whether they are believed.
TEST(Initializer, is_not_sure_of_a_start_that_ranges_do_not_fit) {
  constexpr int kSeeds = 100;
  constexpr double kWrong = 40.0;  // chance: one in 1e8
  int wrong = 0;
  int ready = 0;
  double seconds = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Start start = start_outside(seed, 0.2, 0.1);
    wrong += start.nees > kWrong ? 1 : 0;
    ready += start.seconds > 0.0 ? 1 : 0;
    seconds += start_outside(seed, 0.2, 0.2).seconds / kSeeds;
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(ready, 90);
  EXPECT_LT(seconds, 5.0);  // where the noise is as it is stated nothing is waited for
}

/// Fixes of `sigma` at 1 Hz, of a robot that drives at 1.5 m/s.
Start start_by_fixes(int seed, double sigma) {
  Robot robot{{30.0, -20.0, 0.3 * seed}, centred(), std::make_shared<const AnchorMap>()};
  robot.rng.seed(static_cast<unsigned>(seed));
  const Matrix<2, 2> R = sigma * sigma * Matrix<2, 2>::Identity();
  return start_of(robot, initializer_of(robot), 0.15, [&](Robot& one, Initializer& initializer) {
    if (one.now % kSecond == 0) {
      const Vector<2> error(testing::normal(one.rng, sigma), testing::normal(one.rng, sigma));
      initializer.on(PositionFix{one.now, one.pose.position() + error, R});
    }
  });
}

TEST(Initializer, is_ready_by_fixes_that_are_metres_off_and_errs_as_much_as_it_believes) {
  constexpr int kSeeds = 100;
  for (const double sigma : {1.0, 2.0, 3.0}) {
    double nees = 0.0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      const Start start = start_by_fixes(seed, sigma);
      ASSERT_GT(start.seconds, 0.0) << sigma << " m, " << seed;
      EXPECT_LT(start.nees, 30.0) << sigma << " m, " << seed;
      nees += start.nees / kSeeds;
    }
    EXPECT_GE(nees, chi_squared_quantile(3 * kSeeds, 0.005) / kSeeds) << sigma;
    EXPECT_LE(nees, chi_squared_quantile(3 * kSeeds, 0.995) / kSeeds) << sigma;
  }
}

TEST(Initializer, names_the_key_that_a_position_is_too_vague_for) {
  Robot robot{{3.0, 4.0, 1.0}, centred(), corners(), 0.0};
  Initializer::Config config;
  config.sigma_xy_ready_m = 0.01;
  Initializer initializer = initializer_of(robot, config);
  for (int i = 0; i < 20; ++i) {
    robot.step(initializer, {0.05, 0.0, 0.0});
  }
  EXPECT_NE(initializer.state().reason.find("more than 0.01 m (initializer.sigma_xy_ready_m)"),
            std::string::npos)
      << initializer.state().reason;
}

TEST(Initializer, two_tags_know_the_heading_standing_still) {
  Robot robot{{3.0, 4.0, 2.2}, {{0, {0.8, 0.0, 1.0}}, {1, {-0.8, 0.0, 1.0}}}, corners(), 0.02};
  Initializer initializer = initializer_of(robot);
  for (int i = 0; i < 10; ++i) {
    robot.step(initializer, {});
  }
  ASSERT_EQ(initializer.state().status, StartStatus::kReady) << initializer.state().reason;
  EXPECT_NEAR(angle_difference(initializer.estimator().pose().heading, 2.2), 0.0, 0.1);
}

/// Drives towards and away from a wall with two anchors; its mirror image receives the same.
Robot before_a_wall() {
  const auto wall = std::make_shared<const AnchorMap>(
      std::vector<Anchor>{{0, {0.0, 0.0, 1.0}}, {1, {6.0, 0.0, 1.0}}});
  return {{2.0, 3.0, 0.5}, centred(), wall, 0.02};
}

TEST(Initializer, keeps_both_sides_of_a_line_of_anchors_while_it_drives_straight) {
  Robot robot = before_a_wall();
  Initializer initializer = initializer_of(robot);
  for (int i = 0; i < 40; ++i) {
    robot.step(initializer, {0.05, 0.0, 0.0});
    EXPECT_NE(initializer.state().status, StartStatus::kReady);
  }
  const Initializer::State state = initializer.state();
  EXPECT_EQ(state.status, StartStatus::kAmbiguous);
  ASSERT_EQ(state.hypotheses.size(), 2U);
  EXPECT_NEAR(state.hypotheses[0].estimate.pose.y, -state.hypotheses[1].estimate.pose.y, 0.2);
}

TEST(Initializer, a_turn_tells_the_sides_of_a_line_of_anchors_apart) {
  Robot robot = before_a_wall();
  Initializer initializer = initializer_of(robot);
  for (int i = 0; i < 80 && initializer.state().status != StartStatus::kReady; ++i) {
    robot.step(initializer, {0.05, 0.0, 0.04});
  }
  ASSERT_EQ(initializer.state().status, StartStatus::kReady) << initializer.state().reason;
  testing::expect_pose_near(initializer.estimator().estimate().pose, robot.pose, 0.1);
}

TEST(Initializer, survives_a_first_epoch_with_a_range_that_is_metres_wrong) {
  for (std::size_t wrong = 0; wrong < 4; ++wrong) {
    Robot robot{{3.0, 4.0, -1.0}, centred(), corners(), 0.05};
    Initializer initializer = initializer_of(robot);
    for (const Anchor& anchor : robot.anchors->anchors()) {
      const double distance = (robot.pose.position() - anchor.position.head<2>()).norm();
      const double error = anchor.id == static_cast<Id>(wrong) ? 5.0 : 0.0;
      initializer.on(Range{0, 0, anchor.id, distance + error, {}});
    }
    for (int i = 0; i < 40; ++i) {
      robot.step(initializer, {0.05, 0.0, 0.0});
    }
    ASSERT_EQ(initializer.state().status, StartStatus::kReady) << wrong;
    testing::expect_pose_near(initializer.estimator().estimate().pose, robot.pose, 0.1);
  }
}

TEST(Initializer, is_ready_with_the_first_good_pose) {
  const Robot robot{{}, centred(), corners()};
  Initializer initializer = initializer_of(robot);
  const Matrix<3, 3> P = 1e-4 * Matrix<3, 3>::Identity();
  initializer.on(PoseObservation{kSecond, {1.0, 2.0, 3.0}, P});
  ASSERT_EQ(initializer.state().status, StartStatus::kReady);
  const PoseEstimate found = initializer.estimator().current();
  testing::expect_pose_near(found.pose, {1.0, 2.0, 3.0}, 1e-12);
  testing::expect_near(found.covariance, P, 1e-12);
  EXPECT_EQ(found.stamp, kSecond);
}

TEST(Initializer, drives_on_from_position_fixes) {
  Robot robot{{3.0, 4.0, 2.0}, centred(), std::make_shared<const AnchorMap>()};
  Initializer initializer = initializer_of(robot);
  const Matrix<2, 2> R = 4e-4 * Matrix<2, 2>::Identity();
  for (int i = 0; i < 20; ++i) {
    robot.step(initializer, {0.05, 0.0, 0.0});
    initializer.on(PositionFix{robot.now, robot.pose.position(), R});
  }
  ASSERT_EQ(initializer.state().status, StartStatus::kReady) << initializer.state().reason;
  testing::expect_pose_near(initializer.estimator().estimate().pose, robot.pose, 0.05);
}

TEST(Initializer, the_rest_of_a_motion_that_began_before_the_start_is_driven) {
  const Robot robot{{}, centred(), corners()};
  Initializer initializer = initializer_of(robot);
  initializer.on(Increment{0, kSecond, {1.0, 0.0, 0.0}});
  initializer.on(PoseObservation{kSecond / 4, {0.0, 0.0, 0.0}, 1e-4 * Matrix<3, 3>::Identity()});
  testing::expect_pose_near(initializer.estimator().estimate(kSecond).pose, {0.75, 0.0, 0.0}, 1e-9);
}

TEST(Initializer, find_start_stops_at_the_message_that_makes_it_ready) {
  const Robot robot{{}, centred(), corners()};
  Initializer initializer = initializer_of(robot);
  MessageLog log;
  log.add(Velocity{0, 0.0, 0.0});
  log.add(PoseObservation{kSecond, {1.0, 2.0, 3.0}, 1e-4 * Matrix<3, 3>::Identity()});
  log.add(Range{2 * kSecond, 0, 0, 4.0, {}});
  const StartRun run = find_start(initializer, log, {});
  EXPECT_EQ(run.used_until, kSecond);
  ASSERT_EQ(run.steps.size(), 1U);
  EXPECT_EQ(run.steps[0].state.status, StartStatus::kReady);
}

TEST(Initializer, refuses_a_config_out_of_range) {
  const Robot robot{{}, centred(), corners()};
  Initializer::Config config;
  config.headings = 2;
  testing::expect_refused([&] { (void)initializer_of(robot, config); }, "headings");
  config = {};
  config.probability_ready = 1.0;
  testing::expect_refused([&] { (void)initializer_of(robot, config); }, "probability_ready");
}

std::shared_ptr<const LandmarkMap> poles() {
  return std::make_shared<const LandmarkMap>(
      std::vector<Landmark>{{0, {4.0, 3.0}}, {1, {-5.0, 6.0}}, {2, {2.0, -7.0}}, {3, {4.2, 3.1}}});
}

Initializer among_poles() {
  Initializer::Config config;
  config.headings = 12;
  return {config, {testing::hall(), testing::one_tag(), {poles(), {}}}};
}

// The weight of a constellation was NaN, and what was left of a merge that threw was used.
TEST(Initializer, survives_sightings_of_a_micrometre) {
  const auto diagonal = [](double a, double b) -> Matrix<2, 2> {
    return Vector<2>(a, b).asDiagonal();
  };
  const std::vector<Message> messages{
      RangeBearing{50000000, 0, 6.261432390160774, -2.1571894614785303, {}},
      PositionFix{50000000,
                  {-0.85564706100723242, -0.8251679296599681},
                  diagonal(1.3538632139704171e-08, 4.1771049872992867)},
      RangeBearing{50000000, 1, 8.0011090701333103, -0.70478302299150497,
                   diagonal(1.4805135103717454e-12, 1.0454069705930488e-12)},
      Increment{450000000, 500000000, {-0.18677380402771684, 0.0, 0.18702645510607252}},
      Increment{650000000, 700000000, {-0.094561104378498406, 0.0, 0.19534305235588334}},
      RangeBearing{750000000, 2, 6.5337854794459043, 2.0076651158603891, {}}};
  Initializer initializer = among_poles();
  for (const Message& message : messages) {
    initializer.on(message);
    for (const Initializer::Hypothesis& hypothesis : initializer.state().hypotheses) {
      const Matrix<3, 3>& P = hypothesis.estimate.covariance;
      ASSERT_EQ(P.llt().info(), Eigen::Success) << P;
    }
  }
}

TEST(Initializer, a_sighting_at_the_landmark_itself_does_not_stop_the_start) {
  const Pose2 pose{4.0, 3.0, 0.0};
  const Vector<2> other = poles()->find(1)->position - pose.position();
  for (int k = -30; k < 30; ++k) {
    Initializer initializer = among_poles();
    initializer.on(RangeBearing{0, 0, 0.0, 0.1 * k, {}});
    initializer.on(RangeBearing{0, 1, other.norm(), std::atan2(other.y(), other.x()), {}});
    for (int j = 1; j < 20; ++j) {
      initializer.on(PoseObservation{j * kSecond, pose, 1e-4 * Matrix<3, 3>::Identity()});
    }
    EXPECT_EQ(initializer.state().status, StartStatus::kReady) << k;
  }
}

TEST(Initializer, refuses_a_map_that_is_known_to_no_number_and_headings_without_end) {
  const Robot robot{{}, centred(), corners()};
  Initializer::Config config;
  config.sigma_map_m = 1e154;
  testing::expect_refused([&] { (void)initializer_of(robot, config); }, "sigma_map_m");
  config = {};
  config.headings = 3600;
  testing::expect_refused([&] { (void)initializer_of(robot, config); }, "headings");
}

/// Weights of 1e18 have no digits for their differences.
TEST(Initializer, probabilities_are_1_together_whatever_the_ranges_cost) {
  const auto line = std::make_shared<const AnchorMap>(std::vector<Anchor>{{0, {-4.0, 0.0, 1.0}},
                                                                          {1, {0.0, 0.0, 1.0}},
                                                                          {2, {4.0, 0.0, 1.0}},
                                                                          {3, {-8.0, 0.0, 1.0}},
                                                                          {4, {8.0, 0.0, 1.0}},
                                                                          {5, {12.0, 0.0, 1.0}}});
  const auto geometry = std::make_shared<LaserGeometry>();
  geometry->angle_increment = 0.1;
  geometry->range_max = 10.0;
  for (const double sigma : {1e-2, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10}) {
    Initializer initializer({}, {line, centred()});
    const double ranges[]{5.0, 4.0, 6.0, 8.0, 11.0, 9.0};
    for (Id anchor = 0; anchor < 6; ++anchor) {
      initializer.on(Range{0, 0, anchor, ranges[anchor], sigma});
    }
    initializer.on(LaserScan{kTick / 10, geometry, {1.0, 2.0}});
    double total = 0.0;
    for (const Initializer::Hypothesis& hypothesis : initializer.state().hypotheses) {
      total += hypothesis.probability;
    }
    EXPECT_NEAR(total, 1.0, 1e-9) << sigma;
    EXPECT_EQ(initializer.state().hypotheses.size(), 2U) << sigma;  // both sides of the line
  }
}

std::vector<double> numbers_of(const Initializer& initializer) {
  std::vector<double> numbers;
  for (const Initializer::Hypothesis& hypothesis : initializer.state().hypotheses) {
    const Pose2& pose = hypothesis.estimate.pose;
    numbers.insert(numbers.end(), {static_cast<double>(hypothesis.estimate.stamp), pose.x, pose.y,
                                   pose.heading, hypothesis.probability});
  }
  return numbers;
}

/// One component had taken it, the next had not.
TEST(Initializer, what_it_throws_for_changes_nothing) {
  Initializer::Config config;
  config.estimator.adaptive.messages = 5;
  Initializer initializer(config, {testing::hall(), {{0, {2.0, 0.0, 1.0}}}});
  initializer.on(PositionFix{0, {1.0, 2.0}, 1e-2 * Matrix<2, 2>::Identity()});
  for (Id anchor = 0; anchor < 4; ++anchor) {
    initializer.on(Range{kTick, 0, anchor, 12.0 + anchor, {}});
  }
  Initializer other = initializer;
  const std::vector<double> before = numbers_of(initializer);
  EXPECT_THROW(initializer.on(Range{10 * kTick, 0, 0, 12.0, 1e154}), NumericalError);
  EXPECT_EQ(numbers_of(initializer), before);
  for (Id anchor = 0; anchor < 4; ++anchor) {
    initializer.on(Range{11 * kTick, 0, anchor, 13.0, {}});
    other.on(Range{11 * kTick, 0, anchor, 13.0, {}});
  }
  EXPECT_EQ(numbers_of(initializer), numbers_of(other));
}

TEST(Initializer, sightings_without_end_at_one_stamp_are_not_all_paired) {
  Initializer initializer = among_poles();
  for (int k = 0; k < 100'000; ++k) {
    initializer.on(RangeBearing{0, {}, 30.0 + k * 1e-3, 0.1, {}});
  }
  initializer.on(PoseObservation{0, {4.0, 3.0, 0.0}, 1e-4 * Matrix<3, 3>::Identity()});
  EXPECT_FALSE(initializer.state().hypotheses.empty());
}

TEST(Initializer, takes_no_notice_of_landmarks_that_are_not_on_the_map) {
  Initializer initializer = among_poles();
  Initializer other = initializer;
  for (Initializer* robot : {&initializer, &other}) {
    robot->on(RangeBearing{0, 0, 2.0, 0.1, {}});
    robot->on(RangeBearing{0, 1, 9.0, 2.0, {}});
  }
  for (Id unknown = 100; unknown < 120; ++unknown) {
    initializer.on(RangeBearing{0, unknown, 5.0, -1.0, {}});
  }
  EXPECT_EQ(numbers_of(initializer), numbers_of(other));
}

}  // namespace
}  // namespace locfuse::test_initializer
