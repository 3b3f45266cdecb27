// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>

#include "locfuse/error.hpp"
#include "locfuse/replay/live.hpp"
#include "locfuse/replay/replay.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_live {
namespace {

using testing::kSecond;
using testing::same_bits;

RecoveringEkf unstarted() { return {{}, {testing::hall(), testing::one_tag()}}; }

/// Messages arrive at their stamp or up to 0.1 s later, so increments after the ranges during them.
MessageLog with_latencies(const testing::Simulation& run) {
  testing::Rng rng(9);
  MessageLog log;
  for (const Message& message : run.messages) {
    log.add(message, stamp_of(message) + testing::at(testing::uniform(rng, 0.0, 0.1)));
  }
  log.sort();
  return log;
}

void expect_same(const PoseEstimate& a, const PoseEstimate& b) {
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_EQ(a.pose.x, b.pose.x);
  EXPECT_EQ(a.pose.y, b.pose.y);
  EXPECT_EQ(a.pose.heading, b.pose.heading);
  EXPECT_TRUE(same_bits(a.covariance, b.covariance));
}

/// The last estimate of each stamp.
std::map<Stamp, PoseEstimate> poses_of(Live& live, const MessageLog& log) {
  std::map<Stamp, PoseEstimate> poses;
  for (const MessageLog::Arrival& arrival : log.arrivals()) {
    live.on(arrival.message);
    if (live.is_tracking()) {
      poses[live.estimator().current().stamp] = live.estimator().current();
    }
  }
  return poses;
}

TEST(Live, starts_and_tracks_as_find_start_and_replay_do_with_the_log) {
  const testing::Simulation run = testing::simulate(3, 30.0);
  const MessageLog log = with_latencies(run);
  Live live(unstarted());
  const std::map<Stamp, PoseEstimate> poses = poses_of(live, log);

  Initializer initializer = unstarted().initializer();
  const StartRun start = find_start(initializer, log, {});
  RecoveringEkf started = unstarted();
  started.start_with(initializer.estimator());
  ReplayOptions options;
  options.used_until = start.used_until;
  const RunLog replayed = replay(started, log, options);

  EXPECT_GT(start.used_until, 0);
  std::size_t compared = 0;
  for (const PoseEstimate& estimate : replayed.estimates) {
    const auto at = poses.find(estimate.stamp);
    if (at != poses.end()) {
      expect_same(at->second, estimate);
      ++compared;
    }
  }
  EXPECT_GT(compared, replayed.estimates.size() / 2);
  expect_same(live.estimator().estimate(), replayed.last);
  EXPECT_NEAR(live.estimator().estimate().pose.x, run.x, 0.15);
}

/// Fixes at 10 Hz; from 10 s on they are metres away and all gated.
MessageLog fixes_that_are_gated_from_10_s_on(unsigned seed) {
  testing::Rng rng(seed);
  MessageLog log;
  for (int k = 0; k < 700; ++k) {
    const Vector<2> at = k < 100 ? Vector<2>(5.0, 5.0) : Vector<2>(14.0, 22.0);
    const Vector<2> error(testing::normal(rng, 0.1), testing::normal(rng, 0.1));
    log.add(PositionFix{k * (kSecond / 10), at + error, 0.01 * Matrix<2, 2>::Identity()});
  }
  return log;
}

TEST(Live, what_is_not_corrected_any_more_grows_vague_and_lost_and_replay_says_it_to_the_end) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const MessageLog log = fixes_that_are_gated_from_10_s_on(seed);
    RecoveringEkf started = unstarted();
    started.start_at({0, {5.0, 5.0, 0.0}, 0.01 * Matrix<3, 3>::Identity()});
    const RunLog run = replay(started, log, {});
    const Stamp end = 699 * (kSecond / 10);
    ASSERT_EQ(run.estimates.size(), 700U);
    EXPECT_EQ(run.estimates.back().stamp, end);
    expect_same(run.estimates.back(), run.last);
    EXPECT_GT(run.last.sigma_position(), 3.0);  // 0.5 m / sqrt(s), for a minute

    Live live{started};
    const std::map<Stamp, PoseEstimate> poses = poses_of(live, log);
    for (const PoseEstimate& estimate : run.estimates) {
      expect_same(poses.at(estimate.stamp), estimate);
    }

    std::map<HealthState, double> since;
    for (const HealthReport& report : run.health) {
      since.emplace(report.state, seconds_between(0, report.stamp));
    }
    EXPECT_EQ(run.health.back().stamp, end);
    EXPECT_EQ(run.health.back().state, HealthState::kLost);
    EXPECT_EQ(run.health.back().within, live.estimator().health().within);
    EXPECT_NEAR(since.at(HealthState::kDegraded), 10.1, 0.15);  // by the third
    EXPECT_NEAR(since.at(HealthState::kDeadReckoning), 12.0, 0.15);
    EXPECT_NEAR(since.at(HealthState::kLost), 64.0, 2.0);
  }
}

TEST(Live, an_increment_that_arrives_after_the_ranges_during_it_is_used_before_them) {
  const testing::Simulation run = testing::simulate(4, 10.0);
  StartSearch in_order(unstarted().initializer(), 0);
  StartSearch as_they_come(unstarted().initializer());
  const MessageLog log = with_latencies(run);
  std::vector<Message> sorted;
  for (const MessageLog::Arrival& arrival : log.arrivals()) {
    sorted.push_back(arrival.message);
  }
  std::stable_sort(sorted.begin(), sorted.end(), [](const Message& a, const Message& b) {
    return effective_stamp(a) < effective_stamp(b);
  });
  for (const Message& message : sorted) {
    in_order.on(message);
  }
  for (const MessageLog::Arrival& arrival : log.arrivals()) {
    as_they_come.on(arrival.message);
  }
  ASSERT_TRUE(in_order.is_ready());
  ASSERT_TRUE(as_they_come.is_ready());
  EXPECT_EQ(as_they_come.used_until(), in_order.used_until());
  expect_same(as_they_come.initializer().estimator().estimate(),
              in_order.initializer().estimator().estimate());
}

TEST(StartSearch, skips_late_messages_and_keeps_unused_ones) {
  StartSearch search(unstarted().initializer(), kSecond);
  search.on(Range{0, 0, 0, 4.0, {}});
  search.on(Range{2 * kSecond, 0, 0, 4.0, {}});
  EXPECT_EQ(search.used_until(), 0);
  EXPECT_TRUE(search.is_late(Range{0, 0, 1, 4.0, {}}));
  EXPECT_FALSE(search.is_late(Range{kSecond, 0, 1, 4.0, {}}));
  search.on(Range{0, 0, 1, 4.0, {}});
  search.on(Range{kSecond + 1, 0, 1, 5.0, {}});
  ASSERT_EQ(search.waiting().size(), 2U);
  EXPECT_EQ(stamp_of(search.waiting()[0].message), 2 * kSecond);  // in order of arrival
  search.finish();
  EXPECT_TRUE(search.waiting().empty());
  EXPECT_EQ(search.used_until(), 2 * kSecond);
}

TEST(Live, tracks_from_a_given_pose) {
  Live live(unstarted());
  EXPECT_FALSE(live.is_tracking());
  EXPECT_EQ(live.on(PositionFix{0, {1.0, 1.0}, Matrix<2, 2>::Identity()}).verdict,
            Verdict::kIgnored);
  live.start_at({0, {1.0, 2.0, 0.5}, 0.01 * Matrix<3, 3>::Identity()});
  ASSERT_TRUE(live.is_tracking());
  EXPECT_EQ(live.on(PositionFix{kSecond, {1.0, 2.0}, Matrix<2, 2>::Identity()}).verdict,
            Verdict::kFused);
  live.relocalize();
  EXPECT_FALSE(live.is_tracking());
}

TEST(Live, a_source_that_is_off_is_ignored_until_it_is_on_again) {
  Live live(unstarted());
  live.start_at({0, {1.0, 2.0, 0.5}, 0.01 * Matrix<3, 3>::Identity()});
  const PositionFix fix{kSecond, {1.0, 2.0}, Matrix<2, 2>::Identity()};
  live.enable(Source::kPositions, false);
  EXPECT_EQ(live.on(fix).verdict, Verdict::kIgnored);
  live.enable(Source::kPositions, true);
  EXPECT_EQ(live.on(fix).verdict, Verdict::kFused);
}

TEST(Live, a_message_that_is_not_valid_is_refused_and_forgotten) {
  Live live(unstarted());
  testing::expect_refused([&] { live.on(Range{0, 0, 0, -1.0, {}}); }, "range");
  live.start_at({0, {1.0, 2.0, 0.5}, 0.01 * Matrix<3, 3>::Identity()});
  testing::expect_refused([&] { live.on(Range{0, 0, 0, -1.0, {}}); }, "range");
  testing::expect_refused([&] { live.on(LaserScan{}); }, "");
  EXPECT_EQ(live.on(Range{kSecond, 0, 0, 4.0, {}}).dof, 1);
}

Live found_on(const testing::Simulation& run, const Live::Options& options) {
  Live live(unstarted(), options);
  for (const Message& message : run.messages) {
    live.on(message);
  }
  return live;
}

TEST(Live, a_clock_jump_starts_another_search_with_reset) {
  const testing::Simulation run = testing::simulate(5, 20.0);
  Live::Options options;
  options.timeline.clock_jump = ClockJump::kReset;
  Live live = found_on(run, options);
  ASSERT_TRUE(live.is_tracking());
  bool searched = false;
  for (const Message& message : run.messages) {  // the recording loops
    live.on(message);
    searched = searched || !live.is_tracking();
  }
  EXPECT_TRUE(searched);
  EXPECT_EQ(live.jumps(), 1U);
  ASSERT_TRUE(live.is_tracking());
  EXPECT_NEAR(live.estimator().estimate().pose.x, run.x, 0.15);
}

TEST(Live, a_clock_jump_restarts_a_search_unless_refused) {
  Live::Options options;
  options.timeline.clock_jump = ClockJump::kReset;
  for (const bool resets : {false, true}) {
    Live live = resets ? Live(unstarted(), options) : Live(unstarted());
    live.on(Range{1000 * kSecond, 0, 0, 4.0, {}});
    live.on(Range{1001 * kSecond, 0, 0, 4.0, {}});
    std::size_t stale = 0;
    for (Stamp t = 0; t < 40; ++t) {
      stale += live.on(Range{t * kSecond / 10, 0, 0, 4.0, {}}).verdict == Verdict::kStale ? 1 : 0;
    }
    EXPECT_EQ(stale, resets ? options.timeline.jump_after - 1 : 40U);
    EXPECT_EQ(live.jumps(), resets ? 1U : 0U);
  }
}

TEST(Live, reset_returns_to_the_first_state) {
  const testing::Simulation run = testing::simulate(6, 20.0);
  Live live = found_on(run, {});
  live.enable(Source::kRanges, false);
  live.reset();
  EXPECT_FALSE(live.is_tracking());
  Live fresh(unstarted());
  for (const Message& message : run.messages) {
    ASSERT_EQ(live.on(message).verdict, fresh.on(message).verdict);
  }
  expect_same(live.estimator().estimate(), fresh.estimator().estimate());
}

TEST(Live, refuses_options_out_of_range) {
  Live::Options options;
  options.history = -1;
  testing::expect_refused([&] { Live(unstarted(), options); }, "history");
  options = {};
  options.patience = -1;
  testing::expect_refused([&] { Live(unstarted(), options); }, "patience");
}

/// A waiting message may signal the jump: the timeline of the others is gone then.
TEST(Live, a_clock_jump_among_waiting_messages_starts_another_search) {
  Live::Options options;
  options.history = 0;
  options.patience = kSecond;
  options.timeline.clock_jump = ClockJump::kReset;
  options.timeline.jump_after = 1;
  Live live(unstarted(), options);
  const Pose2 pose{2.0, -1.0, 0.4};
  live.on(PoseObservation{1, pose, 4e-4 * Matrix<3, 3>::Identity()});
  for (const double seconds : {0.9, 0.5, 1.1}) {
    live.on(testing::range_to(0, pose, testing::at(seconds)));
  }
  EXPECT_FALSE(live.is_tracking());
  EXPECT_EQ(live.jumps(), 1U);
}

TEST(Live, refuses_a_patience_beyond_the_stamp_limit) {
  Live::Options options;
  options.patience = std::numeric_limits<Stamp>::max();
  testing::expect_refused([&] { Live(unstarted(), options); }, "patience");
}

TEST(Live, ranges_with_a_tiny_sigma_do_not_stop_the_start) {
  Live live(unstarted());
  Pose2 pose{2.0, -1.0, 0.4};
  for (Id anchor = 0; anchor < 4; ++anchor) {
    Range z = testing::range_to(anchor, pose, 0);
    z.sigma = 1e-10;
    live.on(z);
  }
  const Pose2 step = arc(0.05, 0.0, 0.01);
  for (int k = 1; k < 600 && !live.is_tracking(); ++k) {
    const Stamp now = k * kSecond / 10;
    live.on(Increment{now - kSecond / 10, now, step});
    pose = pose * step;
    for (Id anchor = 0; anchor < 4; ++anchor) {
      live.on(testing::range_to(anchor, pose, now));
    }
  }
  EXPECT_TRUE(live.is_tracking());
}

/// All around the robot, so that they determine the pose at once.
std::shared_ptr<const LandmarkMap> posts() {
  return std::make_shared<const LandmarkMap>(
      std::vector<Landmark>{{0, {3.0, 0.0}}, {1, {0.0, 4.0}}, {2, {-2.0, 1.0}}});
}

RecoveringEkf among_posts(const RecoveringEkf::Config& config = {}) {
  return {config, {testing::hall(), testing::one_tag(), {posts(), {}}}};
}

std::vector<RangeBearing> look(Stamp stamp, const Pose2& pose) {
  const RangeBearingModel model({}, {});
  const std::shared_ptr<const LandmarkMap> map = posts();
  std::vector<RangeBearing> sightings;
  for (const Landmark& post : map->landmarks()) {
    const Vector<2> z = model.predict(pose, post.position);
    sightings.push_back({stamp, post.id, z.x(), z.y(), {}});
  }
  return sightings;
}

PositionFix fix_at(Stamp stamp) { return {stamp, {0.0, 0.0}, Matrix<2, 2>::Identity()}; }

/// After a search and a reset, a clock jump was handled differently from the first time.
TEST(Live, reset_returns_to_tracking_where_it_started_tracking) {
  const auto made = [] {
    RecoveringEkf robot = among_posts();
    robot.start_at({0, {0.0, 0.0, 0.0}, 0.01 * Matrix<3, 3>::Identity()});
    Live::Options options;
    options.timeline.clock_jump = ClockJump::kReset;
    options.timeline.jump_after = 3;
    return Live(robot, options);
  };
  Live live = made();
  live.relocalize();
  for (int k = 0; k < 5; ++k) {
    for (const RangeBearing& z : look(k * kSecond, {1.0, 1.0, 0.5})) {
      live.on(z);
    }
  }
  ASSERT_TRUE(live.is_tracking());
  live.reset();
  Live fresh = made();
  for (const Stamp seconds : {1000, 1, 2, 3, 4}) {
    live.on(fix_at(seconds * kSecond));
    fresh.on(fix_at(seconds * kSecond));
  }
  EXPECT_EQ(live.jumps(), 1U);
  ASSERT_TRUE(fresh.is_tracking());
  ASSERT_TRUE(live.is_tracking());
  expect_same(live.estimator().estimate(), fresh.estimator().estimate());
}

TEST(Live, scans_are_a_source_that_may_be_off) {
  const auto geometry = std::make_shared<LaserGeometry>();
  geometry->angle_increment = 0.01;
  geometry->range_max = 10.0;
  for (const bool enabled : {true, false}) {
    Live live(among_posts());
    live.enable(Source::kScans, enabled);
    for (Id anchor = 0; anchor < 3; ++anchor) {
      live.on(testing::range_to(anchor, {2.0, -1.0, 0.4}, 0));
    }
    live.on(LaserScan{kSecond / 10, geometry, std::vector<double>(100, 1.0)});
    live.on(Velocity{kSecond, 0.0, 0.0});
    EXPECT_EQ(live.search().hypotheses.empty(), !enabled);  // a scan ends the epoch of ranges
  }
}

TEST(StartSearch, a_clock_that_stands_still_does_not_fill_the_memory) {
  StartSearch search(unstarted().initializer());
  for (std::size_t k = 0; k < StartSearch::kMaxWaiting + 10; ++k) {
    search.on(Range{0, 0, static_cast<Id>(k % 4), 10.0, {}});
    ASSERT_LE(search.waiting().size(), StartSearch::kMaxWaiting);
  }
  EXPECT_EQ(search.used_until(), 0);
  search.on(Range{kSecond, 0, 0, 10.0, {}});
  EXPECT_EQ(search.waiting().size(), 1U);
}

/// The filter accepts such a heading; the search threw at the next, valid message and forgot the
/// rest of its stamp.
TEST(Live, a_heading_of_any_size_starts_it) {
  Live live(unstarted());
  live.on(PoseObservation{0, {2.0, -1.0, 1e200}, 0.01 * Matrix<3, 3>::Identity()});
  EXPECT_NO_THROW(live.on(Range{kSecond, 0, 3, 10.0, {}}));
  EXPECT_FALSE(live.search().hypotheses.empty());
}

/// Messages that signal the jump were fused before another one of them was refused.
TEST(Live, a_clock_jump_that_ends_in_a_refused_message_counts) {
  RecoveringEkf::Config config;
  config.start.estimator.adaptive.messages = 5;
  Live::Options options;
  options.timeline.clock_jump = ClockJump::kReset;
  options.timeline.jump_after = 3;
  Live live(among_posts(config), options);
  const Pose2 pose{1.0, 1.0, 0.5};
  for (int k = 100; k < 200; ++k) {
    for (const RangeBearing& z : look(k * kSecond, pose)) {
      live.on(z);
    }
  }
  ASSERT_TRUE(live.is_tracking());
  live.on(PositionFix{150 * kSecond, {1.0, 1.0}, Matrix<2, 2>::Identity()});
  Range far = testing::range_to(0, pose, 150 * kSecond + 1, 2.5);  // makes adaptive noise larger
  far.sigma = 1.0;
  live.on(far);
  Range vague = testing::range_to(1, pose, 150 * kSecond + 2);
  vague.sigma = 1.3e154;
  EXPECT_THROW(live.on(vague), NumericalError);
  EXPECT_EQ(live.jumps(), 1U);
  EXPECT_FALSE(live.is_tracking());
}

}  // namespace
}  // namespace locfuse::test_live
