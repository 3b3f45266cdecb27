// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "locfuse/recovery/initializer.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/start.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_initializer_headings {
namespace {

using testing::kSecond;

constexpr Stamp kTick = kSecond / 10;

/// A robot in a room with four anchors around, and what measures it.
struct Robot {
  testing::Rng rng;
  testing::Room room;
  Pose2 pose;
  std::shared_ptr<const AnchorMap> anchors = std::make_shared<const AnchorMap>(std::vector<Anchor>{
      {0, {-6.0, -6.0, 2.0}}, {1, {6.0, -6.0, 2.0}}, {2, {6.0, 6.0, 2.0}}, {3, {-6.0, 6.0, 1.0}}});
  Tag tag{0, {0.3, -0.2, 1.0}};
  Stamp now = 0;

  explicit Robot(std::uint64_t seed) : rng(seed), room(testing::random_room(rng)) {
    pose = room.middle * Pose2{0.4, -0.5, testing::uniform(rng, -kPi, kPi)};
  }

  [[nodiscard]] Initializer initializer(bool with_map = true) const {
    World world{anchors, {tag}};
    if (with_map) {
      world.matcher = std::make_shared<const ScanMatcher>(room.map);
    }
    return {config().start, world};
  }

  [[nodiscard]] static RecoveringEkf::Config config() {
    RecoveringEkf::Config config;
    config.start.method = StartMethod::kSrlsHeadings;
    config.start.estimator.range = {0.1, 0.0};
    config.start.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
    return config;
  }

  [[nodiscard]] Range range(std::size_t anchor) {
    const Vector<2> at = pose.act(tag.position.head<2>());
    const Anchor& to = anchors->anchors()[anchor];
    const Vector<3> place(at.x(), at.y(), tag.position.z());
    return {now, tag.id, to.id, (place - to.position).norm() + testing::normal(rng, 0.1), {}};
  }

  template <class Estimator>
  void measure(Estimator& initializer) {
    for (std::size_t i = 0; i < 4; ++i) {
      initializer.on(range(i));
    }
  }

  [[nodiscard]] LaserScan scan() {
    LaserScan seen = testing::scan_from(room.walls, pose, rng, 0.01);
    seen.stamp = now;
    return seen;
  }

  template <class Estimator>
  void drive(Estimator& initializer, const Pose2& motion) {
    initializer.on(Increment{now, now + kTick, motion});
    pose = pose * motion;
    now += kTick;
  }

  [[nodiscard]] double nees(const PoseEstimate& estimate) const {
    const Vector<3> error = local(estimate.pose, pose);
    return error.dot(estimate.covariance.inverse() * error);
  }
};

TEST(InitializerHeadings, starts_from_the_ranges_of_an_instant_and_a_scan) {
  int ready = 0;
  double nees = 0.0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Robot robot(seed);
    Initializer initializer = robot.initializer();
    robot.measure(initializer);
    EXPECT_EQ(initializer.state().reason, "no range between a known tag and a known anchor");
    initializer.on(robot.scan());
    const Initializer::State state = initializer.state();
    ASSERT_TRUE(state.headings.has_value());
    if (state.status != StartStatus::kReady) {
      EXPECT_FALSE(state.reason.empty());
      continue;
    }
    ++ready;
    const PoseEstimate& start = state.hypotheses.at(0).estimate;
    EXPECT_EQ(start.stamp, robot.now);
    EXPECT_NEAR(std::remainder(start.pose.heading, kPi / 18.0), 0.0, 1e-9);
    nees += robot.nees(start);
    EXPECT_EQ(initializer.estimator().current().pose.x, start.pose.x);
  }
  EXPECT_GE(ready, 80);
  EXPECT_GT(nees / ready, 2.2);  // of 3
  EXPECT_LT(nees / ready, 3.8);
}

TEST(InitializerHeadings, carries_the_position_along_the_drive_to_the_scan) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Robot robot(seed);
    Initializer initializer = robot.initializer();
    robot.measure(initializer);
    initializer.on(robot.range(0));  // begins the next epoch
    EXPECT_EQ(initializer.state().reason, "no scan since ranges gave a position");
    for (int i = 0; i < 8; ++i) {
      robot.drive(initializer, {0.1, 0.0, 0.1});
    }
    initializer.on(robot.scan());
    const Initializer::State state = initializer.state();
    if (state.status == StartStatus::kReady) {
      EXPECT_LT(robot.nees(state.hypotheses.at(0).estimate), 16.3);  // one in a thousand
    }
  }
}

TEST(InitializerHeadings, goes_on_with_the_next_epoch_and_scan_and_says_why) {
  Robot robot(2);
  Initializer initializer = robot.initializer();
  initializer.on(robot.scan());
  EXPECT_EQ(initializer.state().reason, "no range between a known tag and a known anchor");
  initializer.on(robot.range(0));
  initializer.on(robot.range(1));
  robot.now += kSecond;
  initializer.on(robot.range(0));
  EXPECT_EQ(initializer.state().reason,
            "ranges of a tag to fewer than three anchors within epoch_s");
  robot.now += kSecond;
  robot.measure(initializer);
  LaserScan blind = robot.scan();
  std::fill(blind.ranges.begin(), blind.ranges.end(), std::nan(""));
  initializer.on(blind);
  EXPECT_EQ(initializer.state().reason, "the last scan has no return");
  initializer.on(robot.scan());  // at a position that was used
  EXPECT_EQ(initializer.state().status, StartStatus::kWaiting);
  robot.now += kSecond;
  robot.measure(initializer);
  initializer.on(robot.scan());
  EXPECT_EQ(initializer.state().status, StartStatus::kReady) << initializer.state().reason;
}

TEST(InitializerHeadings, names_a_wrong_map_and_a_missing_one) {
  Robot robot(4);
  testing::Walls hall;
  testing::add_box(hall, {}, 15.0, 14.0);
  robot.room.map = testing::map_of(hall, 320, 320, 0.05, {-8.0, -8.0, 0.0});
  Initializer initializer = robot.initializer();
  robot.measure(initializer);
  initializer.on(robot.scan());
  EXPECT_NE(initializer.state().reason.find("is it the map of this place?"), std::string::npos)
      << initializer.state().reason;
  EXPECT_EQ(initializer.state().status, StartStatus::kWaiting);
  Initializer without = robot.initializer(false);
  robot.measure(without);
  without.on(robot.scan());
  EXPECT_EQ(without.state().reason, "no map to compare a scan with");
}

TEST(InitializerHeadings, takes_no_notice_of_poses_fixes_and_landmarks) {
  Robot robot(5);
  Initializer initializer = robot.initializer();
  initializer.on(PoseObservation{0, robot.pose, 1e-4 * Matrix<3, 3>::Identity()});
  initializer.on(PositionFix{0, robot.pose.position(), 1e-4 * Matrix<2, 2>::Identity()});
  EXPECT_EQ(initializer.state().status, StartStatus::kWaiting);
  EXPECT_TRUE(initializer.state().hypotheses.empty());
}

TEST(InitializerHeadings, is_the_same_to_the_bit_whatever_order_messages_arrive_in) {
  Robot robot(6);
  StartSearch in_order(robot.initializer());
  StartSearch late(robot.initializer());
  std::vector<Range> ranges;
  for (std::size_t i = 0; i < 4; ++i) {
    ranges.push_back(robot.range(i));
  }
  const LaserScan scan = robot.scan();
  for (const Range& z : ranges) {
    in_order.on(Message{z});
  }
  in_order.on(scan);
  late.on(scan);
  for (const Range& z : ranges) {
    late.on(Message{z});
  }
  in_order.finish();
  late.finish();
  ASSERT_TRUE(in_order.is_ready()) << in_order.state().reason;
  ASSERT_TRUE(late.is_ready());
  const PoseEstimate& a = in_order.state().hypotheses.at(0).estimate;
  const PoseEstimate& b = late.state().hypotheses.at(0).estimate;
  EXPECT_EQ(a.pose.x, b.pose.x);
  EXPECT_EQ(a.pose.y, b.pose.y);
  EXPECT_EQ(a.pose.heading, b.pose.heading);
  EXPECT_EQ(a.covariance, b.covariance);
}

TEST(InitializerHeadings, a_robot_that_was_carried_off_is_found_without_scans) {
  Robot robot(2);
  RecoveringEkf ekf(
      Robot::config(),
      {robot.anchors, {robot.tag}, {}, {}, std::make_shared<const ScanMatcher>(robot.room.map)});
  robot.measure(ekf);
  ekf.on(robot.scan());
  ASSERT_TRUE(ekf.has_started()) << ekf.state().reason;
  for (int i = 0; i < 50; ++i) {
    robot.drive(ekf, {0.05, 0.0, 0.03});
    robot.measure(ekf);
  }
  EXPECT_FALSE(ekf.is_lost());
  robot.pose = Pose2{-robot.pose.x, 3.0 - robot.pose.y, robot.pose.heading + 2.0};
  for (int i = 0; i < 300 && ekf.restarts() == 0; ++i) {
    robot.drive(ekf, {0.05, 0.0, 0.03});
    robot.measure(ekf);
  }
  EXPECT_EQ(ekf.restarts(), 1);
  EXPECT_LT(robot.nees(ekf.current()), 16.3);
}

}  // namespace
}  // namespace locfuse::test_initializer_headings
