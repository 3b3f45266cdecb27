// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "locfuse/replay/live.hpp"
#include "locfuse/replay/live_mcl.hpp"
#include "locfuse/replay/odometry_timeline.hpp"
#include "locfuse/replay/replay.hpp"
#include "support/bits.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse::test_odometry_timeline {
namespace {

using testing::Rng;
using testing::same_bits;

constexpr Stamp kSecond = 1'000'000'000;
constexpr Stamp kTick = 20'000'000;  // of the gyro; wheels every second one, scans every fifth
constexpr Stamp kLate = kSecond / 2;
constexpr int kTicks = 120;
const auto kNoSink = [](std::size_t, const Outcome&) {};

enum class Wheels { kNone, kVelocities, kIncrements };

/// What makes the odometry of a drive.
struct Parts {
  Wheels wheels;
  bool gyro;
  bool scans;
};

struct Drive {
  testing::Room room;
  PoseEstimate start;
  std::vector<Message> messages;  // in order of stamps
};

/// A circle in a room, with ranges now and then.
Drive drive(const Parts& parts, std::uint64_t seed = 3) {
  Rng rng(seed);
  Drive run;
  run.room = testing::random_room(rng);
  Pose2 pose = run.room.middle * Pose2{0.0, -1.0, 0.0};
  run.start = {0, pose, 0.01 * Matrix<3, 3>::Identity()};
  const Pose2 step = arc(0.01, 0.0, 0.01);
  for (int i = 1; i <= kTicks; ++i) {
    const Stamp now = i * kTick;
    pose = pose * step;
    if (parts.gyro) {
      const double rate = 0.51 + testing::normal(rng, 0.01);
      run.messages.push_back(Imu{now, {0.0, 0.0, rate}, Vector<3>(0.0, 0.0, 9.81)});
    }
    const bool is_driven = i % 2 == 0;
    if (is_driven && parts.wheels == Wheels::kVelocities) {
      run.messages.push_back(Velocity{now, 0.5 + testing::normal(rng, 0.01), 0.5});
    } else if (is_driven && parts.wheels == Wheels::kIncrements) {
      const Pose2 moved{0.0201, 0.0002, 0.02 + testing::normal(rng, 0.001)};
      run.messages.push_back(Increment{now - 2 * kTick, now, moved, {}});
    }
    if (i % 5 == 0) {
      LaserScan scan = testing::scan_from(run.room.walls, pose, rng, 0.01);
      scan.stamp = now;
      run.messages.push_back(scan);
    }
    if (i % 3 == 0) {
      const double range = pose.position().norm() + testing::normal(rng, 0.05);
      run.messages.push_back(Range{now, 0, 0, range, 0.05});
    }
  }
  return run;
}

/// The same in order of arrival: one in five of what makes odometry comes half a second later.
std::vector<Message> with_late(const std::vector<Message>& messages, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<std::pair<Stamp, Message>> arrivals;
  for (const Message& message : messages) {
    const bool may_be_late = !std::holds_alternative<Range>(message);
    const bool is_late = may_be_late && testing::uniform(rng, 0.0, 1.0) < 0.2;
    arrivals.emplace_back(stamp_of(message) + (is_late ? kLate : 0), message);
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Message> order;
  for (auto& [arrival, message] : arrivals) {
    order.push_back(std::move(message));
  }
  return order;
}

OdometryTimeline timeline_of(const Parts& parts, TimelineOptions options = {}) {
  Odometer::Config config;
  if (parts.gyro) {
    config.gyro.emplace();
  }
  if (parts.scans) {
    config.scans.emplace();
  }
  return OdometryTimeline(Odometer(config), 2 * kSecond, options);
}

World world_of(const Drive& run) {
  return {std::make_shared<const AnchorMap>(std::vector<Anchor>{{0, {0.0, 0.0, 0.0}}}),
          std::vector<Tag>{{0, {0.0, 0.0, 0.0}}},
          {},
          run.room.map};
}

/// Feeds what makes odometry to one timeline, and what that makes, and all else, to another.
template <class Receiver>
void feed(const std::vector<Message>& messages, OdometryTimeline& odometry,
          const Receiver& receive) {
  for (const Message& message : messages) {
    if (std::holds_alternative<Range>(message)) {
      receive(message);
    } else {
      receive(odometry.on(message));
    }
  }
}

class LateParts : public ::testing::TestWithParam<Parts> {};

TEST_P(LateParts, give_a_filter_the_bits_of_the_sorted_log) {
  const Drive run = drive(GetParam());
  const auto belief_of = [&](const std::vector<Message>& messages, int& made_again) {
    OdometryTimeline odometry = timeline_of(GetParam());
    Timeline<PoseEkf> filter(PoseEkf({}, world_of(run), run.start), 2 * kSecond);
    feed(messages, odometry, [&](const auto& what) {
      if constexpr (std::is_same_v<std::decay_t<decltype(what)>, std::vector<MadeMotion>>) {
        made_again += are_made_again(what) ? 1 : 0;
      }
      filter.on(what, kNoSink);
    });
    return filter.estimator().belief();
  };
  int never = 0;
  const GaussianBelief sorted = belief_of(run.messages, never);
  EXPECT_EQ(never, 0);
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    int made_again = 0;
    EXPECT_TRUE(same_bits(belief_of(with_late(run.messages, seed), made_again), sorted)) << seed;
    EXPECT_GT(made_again, 3);
  }
}

TEST_P(LateParts, give_live_particles_and_a_live_filter_the_bits_of_the_sorted_log) {
  const Drive run = drive(GetParam());
  MclConfig config;
  config.max_particles = config.min_particles = 500;
  const auto estimates_of = [&](const std::vector<Message>& messages) {
    OdometryTimeline odometry = timeline_of(GetParam());
    Mcl mcl(config, world_of(run), 0);
    mcl.start_at({{run.start, 1.0}});
    LiveMcl particles(mcl);
    RecoveringEkf ekf({}, world_of(run));
    ekf.start_at(run.start);
    Live filter(ekf);
    for (const Message& message : messages) {
      if (std::holds_alternative<Range>(message)) {
        filter.on(message);
      } else {
        const std::vector<MadeMotion> made = odometry.on(message);
        particles.on(made);
        filter.on(made);
      }
      if (std::holds_alternative<LaserScan>(message)) {
        particles.on(message);
      }
    }
    particles.finish();
    return std::pair(particles.estimate(), filter.estimator().estimate());
  };
  const auto sorted = estimates_of(run.messages);
  const auto late = estimates_of(with_late(run.messages, 4));
  for (const auto& [found, expected] :
       {std::pair(late.first, sorted.first), std::pair(late.second, sorted.second)}) {
    EXPECT_EQ(found.stamp, expected.stamp);
    EXPECT_EQ(found.pose.x, expected.pose.x);
    EXPECT_EQ(found.pose.y, expected.pose.y);
    EXPECT_EQ(found.pose.heading, expected.pose.heading);
    EXPECT_TRUE(same_bits(found.covariance, expected.covariance));
  }
}

/// The motions of a log, with what was made of it in place.
TEST_P(LateParts, a_log_of_what_is_made_is_replayed_to_the_same_bits) {
  const Drive run = drive(GetParam());
  const auto replayed = [&](const std::vector<Message>& messages) {
    OdometryTimeline odometry = timeline_of(GetParam());
    MessageLog log;
    Stamp arrival = 0;
    log.add_rows(0, [](std::size_t) { return MessageLog::Arrival{}; });
    feed(messages, odometry, [&](const auto& what) {
      ++arrival;
      if constexpr (std::is_same_v<std::decay_t<decltype(what)>, std::vector<MadeMotion>>) {
        log.add_rows(what.size(), [&](std::size_t i) {
          return MessageLog::Arrival{arrival, what[i].message()};
        });
      } else {
        log.add(what, arrival);
      }
    });
    return std::pair(log, replay(PoseEkf({}, world_of(run), run.start), log, {}));
  };
  const auto sorted = replayed(run.messages);
  const auto late = replayed(with_late(run.messages, 5));
  EXPECT_EQ(late.second.last.pose.x, sorted.second.last.pose.x);
  EXPECT_TRUE(same_bits(late.second.last.covariance, sorted.second.last.covariance));
  const std::vector<bool> replaced = late.first.replaced();
  ASSERT_EQ(replaced.size(), late.first.arrivals().size());
  for (std::size_t i = 0; i < replaced.size(); ++i) {
    EXPECT_EQ(late.second.outcomes[i].reason == Reason::kReplaced, replaced[i]) << i;
  }
  EXPECT_TRUE(sorted.first.replaced().empty());
}

INSTANTIATE_TEST_SUITE_P(Odometry, LateParts,
                         ::testing::Values(Parts{Wheels::kVelocities, true, false},
                                           Parts{Wheels::kIncrements, true, false},
                                           Parts{Wheels::kNone, false, true},
                                           Parts{Wheels::kVelocities, false, true},
                                           Parts{Wheels::kIncrements, true, true}));

const Parts kGyro{Wheels::kIncrements, true, false};

TEST(OdometryTimeline, a_late_sample_changes_the_motions_from_it_on) {
  OdometryTimeline odometry = timeline_of(kGyro);
  EXPECT_TRUE(odometry.on(Imu{0, {0.0, 0.0, 0.1}}).empty());
  const std::vector<MadeMotion> first = odometry.on(Increment{0, kTick, {0.1, 0.0, 0.0}, {}});
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].origin, 1U);
  EXPECT_FALSE(first[0].again);
  ASSERT_EQ(odometry.on(Increment{kTick, 2 * kTick, {0.1, 0.0, 0.0}, {}}).size(), 1U);
  const std::vector<MadeMotion> again = odometry.on(Imu{kTick + 1, {0.0, 0.0, 0.5}});
  ASSERT_EQ(again.size(), 1U);  // the first ended before the sample
  EXPECT_EQ(again[0].origin, 2U);
  EXPECT_TRUE(again[0].again);
  EXPECT_TRUE(odometry.on(Imu{kTick + 1, {0.0, 0.0, 0.9}}).empty());  // one of that stamp holds
}

Increment wheels_at(Stamp stamp) { return {stamp - kTick, stamp, {0.1, 0.0, 0.0}, {}}; }

TEST(OdometryTimeline, what_is_older_than_the_history_is_stale_and_changes_nothing) {
  OdometryTimeline odometry = timeline_of(kGyro);
  EXPECT_EQ(odometry.on(wheels_at(4 * kSecond)).size(), 1U);
  EXPECT_EQ(odometry.outcome().verdict, Verdict::kFused);
  for (const Message& late : {Message(wheels_at(kSecond)), Message(Imu{kSecond, {}, {}})}) {
    EXPECT_TRUE(odometry.on(late).empty());
    EXPECT_EQ(odometry.outcome().reason, Reason::kTooLate);
  }
}

TEST(OdometryTimeline, one_wrong_stamp_makes_no_other_late) {
  OdometryTimeline odometry = timeline_of(kGyro);
  EXPECT_EQ(odometry.on(wheels_at(kTick)).size(), 1U);
  EXPECT_TRUE(odometry.on(wheels_at(3600 * kSecond)).empty());
  EXPECT_EQ(odometry.outcome().reason, Reason::kTooFarAhead);
  EXPECT_TRUE(odometry.on(Imu{3600 * kSecond, {}, {}}).empty());
  EXPECT_EQ(odometry.outcome().reason, Reason::kTooFarAhead);
  EXPECT_EQ(odometry.on(wheels_at(2 * kTick)).size(), 1U);
}

TEST(OdometryTimeline, a_gyro_with_another_clock_leaves_the_wheels_as_they_come) {
  for (const Stamp ahead : {-60 * kSecond, -6 * kSecond, 4 * kSecond, 3600 * kSecond}) {
    OdometryTimeline odometry = timeline_of(kGyro);
    for (int i = 1; i <= 200; ++i) {
      odometry.on(Imu{i * kTick + ahead + 100 * kSecond, {0.0, 0.0, 3.0}});
      const Increment wheels = wheels_at(i * kTick + 100 * kSecond);
      const std::vector<MadeMotion> made = odometry.on(wheels);
      ASSERT_EQ(made.size(), 1U) << ahead;
      EXPECT_EQ(made[0].increment.motion.heading, 0.0);
    }
  }
}

TEST(OdometryTimeline, wheels_with_another_clock_leave_all_scans_their_motion) {
  const Drive run = drive({Wheels::kIncrements, false, true});
  for (const Stamp ahead : {-6 * kSecond, 3 * kSecond, 60 * kSecond}) {
    OdometryTimeline odometry = timeline_of({Wheels::kIncrements, false, true});
    std::size_t scans = 0;
    std::size_t made = 0;
    for (const Message& message : run.messages) {
      scans += std::holds_alternative<LaserScan>(message) ? 1 : 0;
      const bool is_wheels = std::holds_alternative<Increment>(message);
      made += odometry.on(is_wheels ? earlier(message, -ahead) : message).size();
    }
    EXPECT_EQ(made + 1, scans) << ahead;
  }
}

TEST(OdometryTimeline, a_pause_of_wheels_ends_with_the_second_message_though_the_gyro_is_dead) {
  OdometryTimeline odometry = timeline_of(kGyro);
  odometry.on(Imu{0, {}, {}});
  odometry.on(wheels_at(kTick));
  EXPECT_TRUE(odometry.on(wheels_at(9 * kSecond)).empty());
  EXPECT_EQ(odometry.on(wheels_at(9 * kSecond + kTick)).size(), 2U);
}

TEST(OdometryTimeline, wheels_bridge_a_pause_of_the_laser) {
  const Parts parts{Wheels::kIncrements, false, true};
  const Drive run = drive(parts);
  TimelineOptions options;
  options.clock_jump = ClockJump::kReset;
  OdometryTimeline odometry = timeline_of(parts, options);
  const Stamp pause_begin = kSecond;
  for (const Stamp pause : {8 * kSecond, 30 * kSecond}) {
    OdometryTimeline other = odometry;
    Pose2 sum;
    std::size_t made = 0;
    const auto take = [&](const Message& message) {
      for (const MadeMotion& motion : other.on(message)) {
        sum = sum * motion.increment.motion;
        ++made;
      }
    };
    std::size_t scans = 0;
    bool has_paused = false;
    for (const Message& message : run.messages) {
      const bool is_scan = std::holds_alternative<LaserScan>(message);
      if (std::holds_alternative<Range>(message)) {
        continue;
      }
      if (stamp_of(message) > pause_begin && !has_paused) {  // stands still, at 50 Hz
        for (Stamp at = stamp_of(message); at < stamp_of(message) + pause; at += kTick) {
          take(Increment{at - kTick, at, {}, {}});
        }
        has_paused = true;
      }
      scans += is_scan ? 1 : 0;
      take(has_paused ? earlier(message, -pause) : message);
    }
    EXPECT_EQ(made + 1, scans) << pause;
    EXPECT_NEAR(sum.heading, 0.01 * (kTicks - 5), 0.02);
    EXPECT_NEAR(sum.position().norm(), 2.0 * std::sin(0.005 * (kTicks - 5)), 0.05);
  }
}

TEST(OdometryTimeline, says_a_motion_once_where_those_held_come_in_the_wrong_order) {
  OdometryTimeline odometry = timeline_of(kGyro);
  odometry.on(Velocity{0, 0.5, 0.0});
  odometry.on(Velocity{9 * kSecond + 2 * kTick, 0.5, 0.0});
  const std::vector<MadeMotion> made = odometry.on(Velocity{9 * kSecond + kTick, 0.5, 0.0});
  ASSERT_EQ(made.size(), 1U);
  EXPECT_EQ(made[0].increment.begin, 9 * kSecond + kTick);
  EXPECT_EQ(made[0].increment.stamp, 9 * kSecond + 2 * kTick);
  EXPECT_FALSE(made[0].again);
}

/// Where a drive ends by the motions of scans, of which the fourth and the fifth are of one stamp,
/// in an order of arrival.
Pose2 end_by(const std::vector<LaserScan>& scans, const std::vector<std::size_t>& order) {
  OdometryTimeline odometry = timeline_of({Wheels::kNone, false, true});
  std::map<std::size_t, Increment> motions;
  for (const std::size_t i : order) {
    for (const MadeMotion& made : odometry.on(scans[i])) {
      motions[made.origin] = made.increment;
    }
  }
  std::map<Stamp, Pose2> by_begin;
  for (const auto& [origin, motion] : motions) {
    if (motion.stamp > motion.begin) {
      EXPECT_TRUE(by_begin.emplace(motion.begin, motion.motion).second);
    }
  }
  Pose2 sum;
  for (const auto& [begin, motion] : by_begin) {
    sum = sum * motion;
  }
  return sum;
}

TEST(OdometryTimeline, of_two_scans_of_one_stamp_one_makes_a_motion_whichever_comes_first) {
  const Drive run = drive({Wheels::kNone, false, true});
  std::vector<LaserScan> scans;
  for (const Message& message : run.messages) {
    if (const auto* scan = std::get_if<LaserScan>(&message)) {
      scans.push_back(*scan);
    }
  }
  scans.resize(6);
  scans[4].stamp = scans[3].stamp;
  for (const double turned : {0.0, 0.1}) {  // of one laser, and of two
    LaserGeometry geometry = *scans[4].geometry;
    geometry.pose_in_body.heading += turned;
    geometry.angle_min -= turned;
    scans[4].geometry = std::make_shared<const LaserGeometry>(geometry);
    const Pose2 end = end_by(scans, {0, 1, 2, 3, 4, 5});
    const Pose2 other = end_by(scans, {0, 1, 2, 4, 3, 5});
    EXPECT_EQ(end.x, other.x);
    EXPECT_EQ(end.heading, other.heading);
  }
}

TEST(OdometryTimeline, starts_anew_where_the_clock_went_back) {
  for (const ClockJump policy : {ClockJump::kReset, ClockJump::kContinue}) {
    TimelineOptions options;
    options.clock_jump = policy;
    OdometryTimeline odometry = timeline_of({Wheels::kIncrements, true, false}, options);
    std::size_t made = 0;
    for (const Stamp begin : {1000 * kSecond, Stamp{0}}) {
      for (int i = 0; i < 30; ++i) {
        const Stamp now = begin + i * kTick;
        made += odometry.on(Imu{now, {0.0, 0.0, 0.1}}).size();
        made += odometry.on(Increment{now, now + kTick, {0.1, 0.0, 0.0}, {}}).size();
      }
    }
    EXPECT_GE(made, 59U);  // those that showed the jump count
  }
}

TEST(OdometryTimeline, what_is_not_valid_is_forgotten) {
  OdometryTimeline odometry = timeline_of(kGyro);
  odometry.on(Imu{0, {0.0, 0.0, 0.1}});
  EXPECT_THROW(odometry.on(Imu{1, {0.0, 0.0, std::nan("")}}), std::invalid_argument);
  EXPECT_EQ(odometry.on(Increment{0, kTick, {0.1, 0.0, 0.0}, {}}).size(), 1U);
  EXPECT_THROW(Odometer({}), std::invalid_argument);
}

TEST(OdometryTimeline, takes_no_other_messages) {
  OdometryTimeline odometry = timeline_of(kGyro);
  EXPECT_TRUE(odometry.on(Range{0, 0, 0, 1.0, {}}).empty());
  EXPECT_EQ(odometry.outcome().reason, Reason::kNotUsed);
}

PoseEkf ekf_at_rest() { return {{}, {}, {0, {}, 0.01 * Matrix<3, 3>::Identity()}}; }

MadeMotion motion_of(std::size_t origin, Stamp begin, double forward, bool again = false) {
  return {origin, again, false, Increment{begin, begin + kSecond, {forward, 0.0, 0.0}, {}}};
}

TEST(Timeline, a_motion_that_is_made_again_is_in_place_of_the_one_before) {
  Timeline<PoseEkf> timeline(ekf_at_rest(), 10 * kSecond);
  std::map<std::size_t, Outcome> outcomes;
  const auto sink = [&](std::size_t index, const Outcome& outcome) { outcomes[index] = outcome; };
  timeline.on(std::vector{motion_of(7, 0, 0.5)}, sink);
  timeline.on(std::vector{motion_of(8, kSecond, 0.5)}, sink);
  timeline.on(std::vector{motion_of(9, 2 * kSecond, 0.5)}, sink);
  timeline.on(std::vector{motion_of(8, kSecond, 0.7, true), motion_of(9, 2 * kSecond, 0.6, true)},
              sink);
  Timeline<PoseEkf> expected(ekf_at_rest(), 10 * kSecond);
  for (const auto& [origin, forward] :
       std::map<std::size_t, double>{{7, 0.5}, {8, 0.7}, {9, 0.6}}) {
    expected.on(std::vector{motion_of(origin, Stamp(origin - 7) * kSecond, forward)}, kNoSink);
  }
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.estimator().belief()));
  EXPECT_EQ(outcomes[0].verdict, Verdict::kFused);
  EXPECT_EQ(outcomes[1].reason, Reason::kReplaced);
  EXPECT_EQ(outcomes[2].reason, Reason::kReplaced);
  EXPECT_EQ(outcomes[4].verdict, Verdict::kFused);
}

TEST(Timeline, one_that_is_made_again_of_none_in_the_history_changes_nothing) {
  Timeline<PoseEkf> timeline(ekf_at_rest(), 10 * kSecond);
  timeline.on(std::vector{motion_of(1, 0, 0.5)}, kNoSink);
  timeline.on(std::vector{motion_of(2, kSecond, 0.5)}, kNoSink);
  const GaussianBelief before = timeline.estimator().belief();
  std::vector<Outcome> outcomes;
  timeline.on(std::vector{motion_of(5, kSecond / 2, 0.3), motion_of(2, kSecond, 0.9, true),
                          motion_of(4, 2 * kSecond, 0.9, true)},
              [&](std::size_t, const Outcome& outcome) { outcomes.push_back(outcome); });
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), before));
  ASSERT_EQ(outcomes.size(), 3U);
  for (const Outcome& outcome : outcomes) {
    EXPECT_EQ(outcome.reason, Reason::kTooLate);
  }
}

TEST(Timeline, a_motion_is_not_replaced_by_a_part_of_it) {
  Timeline<PoseEkf> timeline(ekf_at_rest(), 10 * kSecond);
  timeline.on(std::vector{motion_of(1, 0, 0.5)}, kNoSink);
  const GaussianBelief before = timeline.estimator().belief();
  MadeMotion part = motion_of(1, kSecond / 2, 0.2, true);
  part.increment.stamp = kSecond;
  std::vector<Outcome> outcomes;
  timeline.on(std::vector{part},
              [&](std::size_t, const Outcome& outcome) { outcomes.push_back(outcome); });
  ASSERT_EQ(outcomes.size(), 1U);
  EXPECT_EQ(outcomes[0].reason, Reason::kTooLate);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), before));
  const MadeMotion first{2, false, false, Increment{0, kSecond / 2, {0.2, 0.0, 0.0}, {}}};
  timeline.on(std::vector{first, part}, kNoSink);
  EXPECT_DOUBLE_EQ(timeline.estimator().estimate().pose.x, 0.4);
}

TEST(Timeline, what_cannot_be_made_again_leaves_what_was) {
  Timeline<PoseEkf> timeline(ekf_at_rest(), 10 * kSecond);
  timeline.on(std::vector{motion_of(1, 0, 0.5)}, kNoSink);
  timeline.on(Velocity{kSecond, 0.1, 0.0}, kNoSink);
  const GaussianBelief before = timeline.estimator().belief();
  EXPECT_THROW(timeline.on(std::vector{motion_of(1, 0, std::nan(""), true)}, kNoSink),
               std::invalid_argument);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), before));
}

TEST(Replay, a_motion_used_for_the_start_is_made_again_as_one_of_its_own) {
  MessageLog log;
  const auto row = [](std::size_t origin, Stamp begin, Stamp end, bool again) {
    const Increment moved{begin, end, {1e-9 * double(end - begin), 0.0, 0.0}, {}};
    return MessageLog::Arrival{0, MadeMotion{origin, again, false, moved}.message()};
  };
  const std::vector<MessageLog::Arrival> rows{row(1, 0, 2 * kSecond, false),
                                              row(2, 2 * kSecond, 3 * kSecond, false),
                                              row(3, 0, kSecond, false),
                                              row(1, kSecond, 2 * kSecond, true),
                                              row(4, kSecond, kSecond + kSecond / 2, false),
                                              row(1, kSecond + kSecond / 2, 2 * kSecond, true)};
  log.add_rows(rows.size(), [&](std::size_t i) { return rows[i]; });
  ReplayOptions options;
  options.used_until = kSecond / 2;
  const PoseEkf start({}, {}, {kSecond, {1.0, 0.0, 0.0}, 0.01 * Matrix<3, 3>::Identity()});
  const RunLog run = replay(start, log, options);
  EXPECT_DOUBLE_EQ(run.last.pose.x, 3.0);
}

}  // namespace
}  // namespace locfuse::test_odometry_timeline
