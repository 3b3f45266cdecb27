// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "locfuse/recovery/recovering_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::test_recovering_ekf {
namespace {

using testing::expect_refused;
using testing::in_band;
using testing::normal;
using testing::Rng;
using testing::uniform;

constexpr auto kStep = static_cast<Stamp>(kNanosecondsPerSecond / 10);
constexpr double kSigmaRange = 0.05;
constexpr double kSigmaBearing = 0.02;
const std::vector<Vector<2>> kPosts{{1.0, 1.0}, {9.0, 2.0}, {4.0, 9.0}, {6.5, 5.0}};

std::shared_ptr<const LandmarkMap> map_of(const std::vector<Vector<2>>& positions) {
  std::vector<Landmark> landmarks;
  for (const Vector<2>& position : positions) {
    landmarks.push_back({static_cast<Id>(landmarks.size()), position, 0.1});
  }
  return std::make_shared<const LandmarkMap>(landmarks);
}

RecoveringEkf::Config config() {
  RecoveringEkf::Config c;
  c.start.estimator.landmark = {kSigmaRange, kSigmaBearing};
  c.start.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  c.start.estimator.correlation_s = 0.0;  // its errors are independent
  return c;
}

RecoveringEkf robot_among(const std::vector<Vector<2>>& posts) {
  return {config(), {{}, {}, {map_of(posts), {}}}};
}

/// A robot that drives circles and sees every post within `reach`.
struct Drive {
  Pose2 truth;
  Stamp stamp = 0;
  Rng rng;
  double reach = 1e3;
  double wrong_share = 0.0;
  bool names = false;

  explicit Drive(unsigned seed) : rng(seed) {
    truth = {uniform(rng, 3.0, 7.0), uniform(rng, 3.0, 7.0), uniform(rng, -kPi, kPi)};
  }

  /// Where somebody puts it down.
  void carry_off() {
    const Pose2 before = truth;
    while (std::hypot(truth.x - before.x, truth.y - before.y) < 2.0) {
      truth = {uniform(rng, 3.0, 7.0), uniform(rng, 3.0, 7.0), uniform(rng, -kPi, kPi)};
    }
  }

  [[nodiscard]] std::vector<RangeBearing> look(const std::vector<Vector<2>>& posts) {
    std::vector<RangeBearing> sightings;
    for (std::size_t i = 0; i < posts.size(); ++i) {
      const Vector<2> d = inverse(truth).act(posts[i]);
      if (d.norm() > reach) {
        continue;
      }
      RangeBearing z;
      z.stamp = stamp;
      if (names) {
        z.landmark = static_cast<Id>(i);
      }
      const bool wrong = uniform(rng, 0.0, 1.0) < wrong_share;
      z.range =
          wrong ? uniform(rng, 0.0, 20.0) : std::max(d.norm() + normal(rng, kSigmaRange), 0.0);
      z.bearing = wrong ? uniform(rng, -kPi, kPi)
                        : wrap_angle(std::atan2(d.y(), d.x()) + normal(rng, kSigmaBearing));
      sightings.push_back(z);
    }
    return sightings;
  }

  void step(RecoveringEkf& ekf, const std::vector<Vector<2>>& posts) {
    const Pose2 motion = arc(0.04, 0.0, 0.03);
    const Pose2 odometry{motion.x + normal(rng, 0.03 * std::sqrt(0.04)),
                         motion.y + normal(rng, 0.01 * std::sqrt(0.04)),
                         motion.heading + normal(rng, 0.02 * std::sqrt(0.04))};
    truth = truth * motion;
    ekf.on(Increment{stamp, stamp + kStep, odometry});
    stamp += kStep;
    ekf.on_joint(look(posts));
  }

  [[nodiscard]] double off(const RecoveringEkf& ekf) const {
    const Pose2 pose = ekf.estimator()->estimate().pose;
    return std::hypot(pose.x - truth.x, pose.y - truth.y);
  }
};

TEST(RecoveringEkf, starts_from_landmarks_alone_and_is_right_whenever_it_says_so) {
  int ready_at_once = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    RecoveringEkf ekf = robot_among(kPosts);
    Drive drive(seed);
    EXPECT_TRUE(ekf.is_lost());
    EXPECT_EQ(ekf.state().status, StartStatus::kWaiting);
    for (int k = 0; k < 20 && ekf.is_lost(); ++k) {
      drive.step(ekf, kPosts);
      ready_at_once += k == 0 && !ekf.is_lost() ? 1 : 0;
    }
    ASSERT_FALSE(ekf.is_lost()) << seed;
    EXPECT_EQ(ekf.state().status, StartStatus::kReady);
    EXPECT_LT(drive.off(ekf), 0.3) << seed;
  }
  EXPECT_GT(ready_at_once, 190);
}

TEST(RecoveringEkf, notices_that_it_was_carried_off_and_finds_itself_again) {
  double nees = 0.0;
  constexpr int kRuns = 100;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    RecoveringEkf ekf = robot_among(kPosts);
    Drive drive(seed);
    for (int k = 0; k < 50; ++k) {
      drive.step(ekf, kPosts);
    }
    ASSERT_EQ(ekf.alarms(), 0) << seed;
    drive.carry_off();
    int steps = 0;
    while (ekf.alarms() == 0 && ++steps < 20) {
      drive.step(ekf, kPosts);
    }
    EXPECT_LE(steps, 7) << seed;  // suspicion lasts half a second
    for (int k = 0; k < 30; ++k) {
      drive.step(ekf, kPosts);
    }
    ASSERT_FALSE(ekf.is_lost()) << seed;
    EXPECT_LT(drive.off(ekf), 0.2) << seed;
    const PoseEstimate now = ekf.estimator()->estimate();
    const Vector<3> error = local(now.pose, drive.truth);
    nees += error.dot(now.covariance.inverse() * error);
  }
  EXPECT_TRUE(in_band(nees / kRuns, 3, kRuns)) << nees / kRuns;
}

TEST(RecoveringEkf, what_it_reports_while_it_is_lost_says_so) {
  RecoveringEkf::Config settings = config();
  settings.restart = false;
  for (unsigned seed = 0; seed < 50; ++seed) {
    RecoveringEkf ekf{settings, {{}, {}, {map_of(kPosts), {}}}};
    Drive drive(seed);
    ekf.start_at({0, drive.truth, 0.01 * Matrix<3, 3>::Identity()});
    for (int k = 0; k < 50; ++k) {
      drive.step(ekf, kPosts);
    }
    const double sigma = ekf.current().sigma_position();
    EXPECT_LT(sigma, 0.1) << seed;
    drive.carry_off();
    for (int k = 0; k < 20; ++k) {
      drive.step(ekf, kPosts);
    }
    ASSERT_TRUE(ekf.is_lost()) << seed;
    for (const PoseEstimate& lost : {ekf.current(), ekf.estimate()}) {
      const Vector<3> off = local(lost.pose, drive.truth);
      EXPECT_LT(off.dot(lost.covariance.inverse() * off), 4.0) << seed;
    }
    EXPECT_LT(ekf.estimator()->estimate().sigma_position(), 0.5) << seed;  // the belief stays
  }
}

/// A tag alone: ranges to the corners of a hall at 10 Hz, and no odometry.
struct Walk {
  Vector<2> place{5.0, 5.0};
  Stamp stamp = 0;
  Rng rng;
  std::shared_ptr<const AnchorMap> hall = std::make_shared<const AnchorMap>(std::vector<Anchor>{
      {0, {0.0, 0.0, 0.0}}, {1, {20.0, 0.0, 0.0}}, {2, {20.0, 40.0, 0.0}}, {3, {0.0, 40.0, 0.0}}});

  explicit Walk(unsigned seed) : rng(seed) {}

  [[nodiscard]] RecoveringEkf started_at(const Vector<2>& start) const {
    RecoveringEkf ekf({}, {hall, {{0, Vector<3>::Zero()}}});
    ekf.start_at({0, {start.x(), start.y(), 0.0}, 0.01 * Matrix<3, 3>::Identity()});
    return ekf;
  }

  /// One anchor reads `wrong` metres too long.
  void step(RecoveringEkf& ekf, double speed, double wrong = 0.0) {
    place.x() += place.x() < 15.0 ? 0.1 * speed : 0.0;
    place.y() += place.x() < 15.0 ? 0.0 : 0.1 * speed;
    stamp += kStep;
    for (const Anchor& anchor : hall->anchors()) {
      const double range = (place - anchor.position.head<2>()).norm() + normal(rng, 0.1);
      ekf.on(Range{stamp, 0, anchor.id, range + (anchor.id == 1 ? wrong : 0.0), {}});
    }
  }

  [[nodiscard]] double off(const RecoveringEkf& ekf) const {
    return (ekf.current().pose.position() - place).norm();
  }
};

TEST(RecoveringEkf, follows_a_robot_that_never_says_how_it_moves) {
  for (const double speed : {0.0, 0.5, 2.0, 3.0}) {
    for (unsigned seed = 0; seed < 5; ++seed) {
      Walk walk(seed);
      RecoveringEkf ekf = walk.started_at(walk.place);
      for (int k = 0; k < 120; ++k) {
        walk.step(ekf, speed);
        ASSERT_LT(walk.off(ekf), 0.6) << speed << " m/s, seed " << seed << ", step " << k;
      }
      EXPECT_EQ(ekf.alarms(), 0) << speed;
    }
  }
}

/// The wrong variant: what stands as odometry says is not followed.
TEST(RecoveringEkf, odometry_that_says_that_it_stands_is_believed) {
  Walk walk(1);
  RecoveringEkf ekf = walk.started_at(walk.place);
  double most = 0.0;
  for (int k = 0; k < 20; ++k) {
    ekf.on(Velocity{walk.stamp, 0.0, 0.0});
    walk.step(ekf, 2.0);
    most = std::max(most, walk.off(ekf));
  }
  EXPECT_GT(most, 1.0);
}

TEST(RecoveringEkf, comes_back_without_odometry_to_where_ranges_say_that_it_is) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    for (const double wrong : {0.0, 12.0}) {
      Walk walk(seed);
      RecoveringEkf ekf = walk.started_at({5.0, 30.0});  // which is wrong
      for (int k = 0; k < 30; ++k) {
        walk.step(ekf, 1.5, wrong);
      }
      EXPECT_EQ(ekf.restarts(), 1) << seed;
      EXPECT_LT(walk.off(ekf), 0.6) << seed << ", an anchor is " << wrong << " m wrong";
      EXPECT_GT(ekf.current().covariance(2, 2), 1.0) << "nothing tells the heading";
    }
  }
}

TEST(RecoveringEkf, two_anchors_do_not_say_on_which_side_of_them_it_is) {
  Walk walk(3);
  walk.hall = std::make_shared<const AnchorMap>(
      std::vector<Anchor>{{0, {0.0, 0.0, 0.0}}, {1, {20.0, 0.0, 0.0}}});
  RecoveringEkf ekf = walk.started_at({5.0, 30.0});
  for (int k = 0; k < 50; ++k) {
    walk.step(ekf, 1.0);
  }
  EXPECT_EQ(ekf.restarts(), 0);
}

TEST(RecoveringEkf, a_share_of_wrong_sightings_raises_no_alarm) {
  RecoveringEkf ekf = robot_among(kPosts);
  Drive drive(5);
  drive.wrong_share = 0.01;
  for (int k = 0; k < 8000; ++k) {
    drive.step(ekf, kPosts);
  }
  EXPECT_EQ(ekf.alarms(), 0);
  EXPECT_LT(drive.off(ekf), 0.2);
}

/// Nobody carries it off, and every fifth sighting is wrong.
TEST(RecoveringEkf, many_wrong_sightings_raise_no_alarm) {
  RecoveringEkf::Config c = config();
  c.health.wrong_share = 0.2;
  RecoveringEkf ekf(c, {{}, {}, {map_of(kPosts), {}}});
  Drive drive(6);
  drive.wrong_share = 0.2;
  drive.names = true;
  for (int k = 0; k < 36000; ++k) {  // an hour
    drive.step(ekf, kPosts);
  }
  EXPECT_EQ(ekf.alarms(), 0);
  EXPECT_LT(drive.off(ekf), 0.2);
}

/// Turned about the middle of two posts, each of them is where the other was; the third is not.
TEST(RecoveringEkf, notices_a_third_that_fits_nothing_where_two_fit) {
  const std::vector<Vector<2>> three{{1.0, 1.0}, {9.0, 1.0}, {5.0, 9.0}};
  RecoveringEkf ekf = robot_among(three);
  Drive drive(11);
  drive.truth = {5.85, 4.94, 0.57};
  ekf.start_at({0, {14.0 - 5.85, 10.0 - 4.94, 0.57 - kPi}, 0.0025 * Matrix<3, 3>::Identity()});
  int steps = 0;
  while (ekf.alarms() == 0 && ++steps < 20) {
    drive.step(ekf, three);
  }
  EXPECT_LT(steps, 15);  // half a second of them under suspicion
  for (int k = 0; k < 20; ++k) {
    drive.step(ekf, three);
  }
  ASSERT_FALSE(ekf.is_lost());
  EXPECT_LT(drive.off(ekf), 0.2);
}

TEST(RecoveringEkf, a_square_stays_ambiguous) {
  const std::vector<Vector<2>> square{{0.0, 0.0}, {8.0, 0.0}, {8.0, 8.0}, {0.0, 8.0}};
  RecoveringEkf ekf = robot_among(square);
  Drive drive(3);
  for (int k = 0; k < 50; ++k) {
    drive.step(ekf, square);
  }
  EXPECT_TRUE(ekf.is_lost());
  const Initializer::State state = ekf.state();
  EXPECT_EQ(state.status, StartStatus::kAmbiguous);
  EXPECT_EQ(state.hypotheses.size(), 4U);
  EXPECT_EQ(state.reason, "4 poses fit");
  RecoveringEkf named = robot_among(square);
  drive.names = true;
  drive.step(named, square);
  drive.step(named, square);
  EXPECT_FALSE(named.is_lost());
  EXPECT_LT(drive.off(named), 0.3);
}

TEST(RecoveringEkf, two_landmarks_that_fit_may_do_so_by_chance) {
  RecoveringEkf ekf = robot_among(kPosts);
  Drive drive(4);
  for (const RangeBearing& z : drive.look({kPosts[0], kPosts[1]})) {
    ekf.on(z);
  }
  EXPECT_TRUE(ekf.is_lost());
  EXPECT_EQ(ekf.state().status, StartStatus::kAmbiguous);
}

TEST(RecoveringEkf, a_wrong_sighting_among_the_first_is_outvoted) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    RecoveringEkf ekf = robot_among(kPosts);
    Drive drive(seed);
    std::vector<RangeBearing> first = drive.look(kPosts);
    first[seed % 4].range = uniform(drive.rng, 0.5, 12.0);
    first[seed % 4].bearing = uniform(drive.rng, -kPi, kPi);
    ekf.on_joint(first);
    for (int k = 0; k < 12; ++k) {
      drive.step(ekf, kPosts);
    }
    ASSERT_FALSE(ekf.is_lost()) << seed;
    EXPECT_LT(drive.off(ekf), 0.3) << seed;
  }
}

/// A camera that reports one after the other: what is seen again says nothing new, a new name does.
TEST(RecoveringEkf, names_at_different_stamps_are_evidence_each) {
  const std::vector<Vector<2>> square{{0.0, 0.0}, {8.0, 0.0}, {8.0, 8.0}, {0.0, 8.0}};
  RecoveringEkf ekf = robot_among(square);
  Drive drive(3);
  for (const RangeBearing& z : drive.look({square[0], square[1]})) {  // without names
    ekf.on(z);
  }
  const std::size_t poses = ekf.state().hypotheses.size();
  ASSERT_GT(poses, 4U);
  drive.names = true;
  const std::vector<RangeBearing> named = drive.look(square);
  for (std::size_t i = 2; i < 4; ++i) {
    RangeBearing z = named[i];
    z.stamp += static_cast<Stamp>(i) * 1000;
    ekf.on(z);
  }
  ASSERT_FALSE(ekf.is_lost());
  EXPECT_LT(drive.off(ekf), 0.3);
}

TEST(RecoveringEkf, out_of_sight_of_landmarks_it_drives_on_by_odometry) {
  RecoveringEkf ekf = robot_among(kPosts);
  Drive drive(8);
  drive.step(ekf, kPosts);
  ASSERT_FALSE(ekf.is_lost());
  drive.reach = 0.0;
  for (int k = 0; k < 600; ++k) {
    drive.step(ekf, kPosts);
  }
  EXPECT_FALSE(ekf.is_lost());
  drive.reach = 1e3;
  for (int k = 0; k < 20; ++k) {
    drive.step(ekf, kPosts);
  }
  EXPECT_EQ(ekf.alarms(), 0);
  EXPECT_LT(drive.off(ekf), 0.2);
}

TEST(RecoveringEkf, position_fixes_find_it_again_too) {
  RecoveringEkf ekf(config(), {});
  Drive drive(9);
  const auto fix = [&] {
    PositionFix z;
    z.stamp = drive.stamp;
    z.position = {drive.truth.x + normal(drive.rng, 0.05), drive.truth.y + normal(drive.rng, 0.05)};
    z.covariance = 0.05 * 0.05 * Matrix<2, 2>::Identity();
    return z;
  };
  ekf.on(fix());
  const auto drive_on = [&](int steps) {
    for (int k = 0; k < steps; ++k) {
      drive.step(ekf, {});
      ekf.on(fix());
    }
  };
  drive_on(150);
  ASSERT_FALSE(ekf.is_lost());
  drive.truth.x += 100.0;
  drive_on(25);  // one source alone may be wrong for a while
  EXPECT_EQ(ekf.alarms(), 0);
  EXPECT_EQ(ekf.health().state, HealthState::kDeadReckoning);
  drive_on(1500);
  EXPECT_EQ(ekf.alarms(), 1);
  EXPECT_EQ(ekf.restarts(), 1);
  ASSERT_FALSE(ekf.is_lost());
  EXPECT_LT(drive.off(ekf), 0.2);
}

/// A vehicle whose receiver is silent for a while, and then says for some time that it is
/// elsewhere, each fix in agreement with the others and with the wheels.
struct Garage {
  RecoveringEkf ekf;
  Drive drive{12};
  double seconds = 0.0;

  /// Drives for half a minute on good fixes, and without any for `silence` [s].
  explicit Garage(double silence, const World& world = {}) : ekf(config(), world) {
    ekf.on(fix(0.0));
    drive_on(30.0, 0.0);
    EXPECT_FALSE(ekf.is_lost());
    drive_on(silence, std::nullopt);
  }

  [[nodiscard]] bool is_right() const { return !ekf.is_lost() && drive.off(ekf) < 0.5; }

  [[nodiscard]] PositionFix fix(double off) {
    PositionFix z;
    z.stamp = drive.stamp;
    z.position = {drive.truth.x + off + normal(drive.rng, 0.1),
                  drive.truth.y + normal(drive.rng, 0.1)};
    z.covariance = 0.01 * Matrix<2, 2>::Identity();
    return z;
  }

  /// Drives on, and returns how far off the pose was at most while it was not said to be lost.
  double drive_on(double duration, std::optional<double> off) {
    double most = 0.0;
    for (const double end = seconds + duration; seconds < end; seconds += 0.1) {
      drive.step(ekf, {});
      if (off) {
        ekf.on(fix(*off));
      }
      most = std::max(most, ekf.is_lost() ? 0.0 : drive.off(ekf));
    }
    return most;
  }
};

TEST(RecoveringEkf, fixes_that_are_wrong_after_a_silence_do_not_win) {
  for (const double silence : {0.0, 20.0, 70.0, 300.0}) {
    Garage garage(silence);
    EXPECT_LT(garage.drive_on(25.0, 60.0), 10.0) << silence;
    EXPECT_EQ(garage.ekf.restarts(), 0) << silence;
    EXPECT_LT(garage.drive_on(20.0, 0.0), 10.0) << silence;
    EXPECT_TRUE(garage.is_right()) << silence;
  }
}

TEST(RecoveringEkf, fixes_that_stay_elsewhere_are_believed_in_the_end) {
  Garage garage(70.0);
  garage.drive.truth.x += 60.0;
  garage.drive_on(150.0, 0.0);
  EXPECT_EQ(garage.ekf.restarts(), 1);
  EXPECT_TRUE(garage.is_right());
}

/// The first fixes after a silence are those of neither place.
TEST(RecoveringEkf, fixes_that_were_wrong_for_a_moment_do_not_keep_it_lost) {
  Garage garage(70.0);
  garage.drive.truth.x += 60.0;
  garage.drive_on(3.0, 90.0);
  garage.drive_on(240.0, 0.0);
  EXPECT_TRUE(garage.is_right());
}

TEST(RecoveringEkf, an_anchor_that_agrees_with_the_pose_does_not_speak_for_wrong_fixes) {
  Garage garage(70.0, {testing::hall(), testing::one_tag()});
  const auto range = [&] {
    garage.ekf.on(testing::range_to(0, garage.drive.truth, garage.drive.stamp, 0.0));
  };
  for (int k = 0; k < 25; ++k) {
    EXPECT_LT(garage.drive_on(1.0, 60.0), 10.0) << k;
    range();
  }
  EXPECT_EQ(garage.ekf.restarts(), 0);
  garage.drive_on(20.0, 0.0);
  EXPECT_TRUE(garage.is_right());
}

/// One in ten of wrong fixes comes near enough to be fused, were they not left out.
TEST(RecoveringEkf, a_receiver_that_is_wrong_as_a_whole_is_left_out_until_it_agrees) {
  Garage garage(0.0);
  garage.drive_on(3.0, 3.0);
  const GaussianBelief before = garage.ekf.belief();
  const Outcome near = garage.ekf.on(garage.fix(0.0));
  EXPECT_EQ(near.verdict, Verdict::kGated);
  EXPECT_EQ(near.reason, Reason::kSourceExcluded);
  EXPECT_LT(near.nis, near.limit);
  EXPECT_EQ(garage.ekf.belief().x, before.x);
  garage.drive_on(3.0, 0.0);
  EXPECT_EQ(garage.ekf.on(garage.fix(0.0)).verdict, Verdict::kFused);
}

/// A robot in a hall with four anchors that receives none of them for longer than `invalid_s`,
/// while its wheels spin for half a minute: they report a longer way, and straight on.
struct Outage {
  static constexpr double kBegins = 10.0;
  static constexpr double kEnds = 80.0;

  static RecoveringEkf::Config settings() {
    RecoveringEkf::Config c;
    c.start.estimator.correlation_s = 0.0;  // its errors are independent
    c.start.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
    c.start.estimator.range.sigma_m = 0.1;
    return c;
  }

  RecoveringEkf ekf{settings(), {testing::hall(), testing::one_tag()}};
  Rng rng;
  Pose2 truth;
  int steps = 0;
  int disagreements = 0;  // of is_lost and of the state

  explicit Outage(unsigned seed) : rng(seed) {
    truth = {uniform(rng, -6.0, 6.0), uniform(rng, -6.0, 6.0), uniform(rng, -kPi, kPi)};
    ekf.start_at({0, truth, 0.01 * Matrix<3, 3>::Identity()});
  }

  void step(bool receives, bool spins) {
    const double home = wrap_angle(std::atan2(-truth.y, -truth.x) - truth.heading);
    const bool is_far = truth.position().norm() > 6.0;
    const Pose2 motion = arc(0.05, 0.0, is_far ? 0.15 * std::min(std::max(home, -1.0), 1.0) : 0.03);
    truth = truth * motion;
    const double turn = std::sqrt(0.0004 * 0.05 + 0.0009 * std::abs(motion.heading));
    const Pose2 odometry{motion.x + normal(rng, 0.03 * std::sqrt(0.05)) + (spins ? 0.03 : 0.0),
                         motion.y + normal(rng, 0.01 * std::sqrt(0.05)),
                         (spins ? 0.0 : motion.heading) + normal(rng, turn)};
    const Stamp begin = steps++ * kStep;
    ekf.on(Increment{begin, begin + kStep, odometry});
    compare();
    for (Id anchor = 0; receives && anchor < 4; ++anchor) {
      ekf.on(testing::range_to(anchor, truth, begin + kStep, normal(rng, 0.1)));
      compare();
    }
  }

  void compare() {
    disagreements += ekf.is_lost() == (ekf.health().state == HealthState::kLost) ? 0 : 1;
  }

  [[nodiscard]] Vector<3> error() const { return local(ekf.estimate().pose, truth); }
};

/// It said `lost` without acting on it, held the pose for right, and the anchors for wrong.
TEST(RecoveringEkf, lost_by_silence_it_searches_and_believes_anchors_rather_than_odometry) {
  double nees = 0.0;
  constexpr int kRuns = 60;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    Outage run(seed);
    bool was_lost = false;
    double worst_error = 0.0;
    for (int k = 0; k < 1000; ++k) {
      const double time = 0.1 * k;
      const bool is_silent = time > Outage::kBegins && time < Outage::kEnds;
      run.step(!is_silent && k % 2 == 0, is_silent && time < Outage::kBegins + 30.0);
      was_lost = was_lost || (is_silent && run.ekf.is_lost());
      worst_error = std::max(worst_error, is_silent ? run.error().head<2>().norm() : 0.0);
      if (time > Outage::kEnds && !run.ekf.is_lost()) {
        ASSERT_LT(run.error().head<2>().norm(), 1.0) << "seed " << seed << " at " << time;
      }
    }
    EXPECT_GT(worst_error, 5.0) << seed;  // else it shows nothing
    EXPECT_TRUE(was_lost) << seed;
    EXPECT_EQ(run.disagreements, 0) << seed;
    ASSERT_FALSE(run.ekf.is_lost()) << seed;
    EXPECT_EQ(run.ekf.alarms(), 1) << seed;
    EXPECT_LT(run.error().head<2>().norm(), 0.2) << seed;
    nees += run.error().dot(run.ekf.estimate().covariance.inverse() * run.error());
  }
  EXPECT_TRUE(in_band(nees / kRuns, 3, kRuns)) << nees / kRuns;
}

TEST(RecoveringEkf, lost_by_silence_alone_it_goes_on_where_it_is) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Outage run(seed);
    for (int k = 0; k < 1000; ++k) {
      const bool is_silent = k > 100 && k < 800;
      run.step(!is_silent, false);
    }
    ASSERT_FALSE(run.ekf.is_lost()) << seed;
    EXPECT_EQ(run.ekf.alarms(), 1) << seed;
    EXPECT_EQ(run.ekf.restarts(), 0) << seed;
    EXPECT_EQ(run.disagreements, 0) << seed;
    EXPECT_LT(run.error().head<2>().norm(), 0.2) << seed;
  }
}

TEST(RecoveringEkf, starts_where_it_is_put) {
  RecoveringEkf ekf = robot_among(kPosts);
  const PoseEstimate start{0, {1.0, 2.0, 0.5}, 0.01 * Matrix<3, 3>::Identity()};
  ekf.start_at(start);
  ASSERT_FALSE(ekf.is_lost());
  EXPECT_EQ(ekf.estimator()->pose().x, 1.0);
  EXPECT_EQ(ekf.on(Increment{0, kStep, {0.1, 0.0, 0.0}}).verdict, Verdict::kFused);
}

TEST(RecoveringEkf, bad_input_is_refused) {
  RecoveringEkf::Config c = config();
  c.health.risk = 0.0;
  expect_refused([&] { RecoveringEkf(c, {}); }, "risk is 0, expected");
  RecoveringEkf ekf = robot_among(kPosts);
  RangeBearing z;
  z.range = std::numeric_limits<double>::infinity();
  expect_refused([&] { ekf.on(z); }, "inf");
  RangeBearing other;
  other.stamp = 1;
  other.range = 1.0;
  other.bearing = 0.0;
  z.range = 1.0;
  expect_refused([&] { ekf.on_joint({z, other}); }, "expected one stamp");
  EXPECT_TRUE(ekf.on_joint({}).empty());
  EXPECT_TRUE(ekf.is_lost());
}

/// A lever arm takes this covariance, which is one by a single rounding, out of the search's hands.
TEST(RecoveringEkf, what_a_search_cannot_use_is_fused_by_the_filter_alike) {
  RecoveringEkf::Config with_lever;
  with_lever.start.estimator.position.antenna_forward_m = 0.37;
  with_lever.start.estimator.position.antenna_left_m = 0.21;
  RecoveringEkf robot(with_lever, {testing::hall(), testing::one_tag()});
  robot.start_at({0, {2.0, -1.0, 0.4}, Vector<3>(0.01, 0.01, 0.0025).asDiagonal()});
  constexpr Stamp kSecond = 10 * kStep;
  robot.on(Velocity{kSecond, 0.0, 0.0});
  robot.on(Velocity{100 * kSecond, 0.0, 0.0});
  ASSERT_TRUE(robot.is_lost());
  Matrix<2, 2> P;
  P << 0x1.ffd02daf57326p-3, 0x1.18ef68457fd26p-1, 0x1.18ef68457fd26p-1, 0x1.346962583a6eep+0;
  EXPECT_EQ(robot.on(PositionFix{100 * kSecond, {2.3, -0.8}, P}).verdict, Verdict::kFused);
}

/// Given together they began another start, in the past.
TEST(RecoveringEkf, stale_sightings_are_no_start) {
  Drive drive(1);
  drive.names = true;
  RecoveringEkf robot = robot_among(kPosts);
  robot.start_at({100 * kStep, {}, 0.01 * Matrix<3, 3>::Identity()});
  for (int k = 101; k < 800 && !robot.is_lost(); ++k) {
    RangeBearing wrong;
    wrong.stamp = k * kStep;
    wrong.landmark = k % 3;
    wrong.range = 40.0 + 3.0 * (k % 3);
    wrong.bearing = 0.7 * k;
    robot.on(wrong);
  }
  ASSERT_TRUE(robot.is_lost());
  for (int k = 1; k < 20; ++k) {
    drive.stamp = k;
    for (const Outcome& outcome : robot.on_joint(drive.look(kPosts))) {
      ASSERT_EQ(outcome.verdict, Verdict::kStale);
    }
  }
  EXPECT_TRUE(robot.is_lost());
  EXPECT_EQ(robot.restarts(), 0);
  EXPECT_GE(robot.current().stamp, 100 * kStep);
}

}  // namespace
}  // namespace locfuse::test_recovering_ekf
