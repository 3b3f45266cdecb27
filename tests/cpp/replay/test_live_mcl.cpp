// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include <algorithm>

#include "locfuse/replay/live_mcl.hpp"
#include "support/expect.hpp"
#include "support/lasers.hpp"

namespace locfuse::test_live_mcl {
namespace {

using testing::Rng;

constexpr Stamp kSecond = 1'000'000'000;
constexpr Stamp kTick = 50'000'000;
constexpr int kTicks = 160;
constexpr Stamp kLate = 500'000'000;
constexpr std::array<Id, 3> kAnchors{0, 1, 2};

struct Arriving {
  Stamp arrival;
  Message message;
};

struct Drive {
  testing::Room room;
  std::shared_ptr<const AnchorMap> anchors;
  Pose2 start;
  std::vector<Arriving> messages;  // in order of arrival
};

/// A drive on a circle in a room: odometry at 20 Hz, scans at 5 Hz, ranges and a pose now and then.
Drive drive() {
  Rng rng(3);
  Drive run;
  run.room = testing::random_room(rng);
  run.start = run.room.middle * Pose2{0.0, -1.0, 0.0};
  std::vector<Anchor> anchors;
  for (const Id id : kAnchors) {
    const Pose2 there = run.room.middle * Pose2{2.0 - 2.0 * id, 1.0 + id, 0.0};
    anchors.push_back({id, {there.x, there.y, 0.0}});
  }
  run.anchors = std::make_shared<const AnchorMap>(anchors);
  Pose2 pose = run.start;
  for (int i = 0; i < kTicks; ++i) {
    const Pose2 step = arc(0.025, 0.0, 0.025);
    const Stamp now = i * kTick;
    run.messages.push_back({now, Increment{now, now + kTick, step}});
    if (i % 4 == 0) {
      LaserScan scan = testing::scan_from(run.room.walls, pose, rng, 0.02);
      scan.stamp = now;
      run.messages.push_back({now, scan});
    }
    if (i % 7 == 0) {
      const Anchor& anchor = anchors[static_cast<std::size_t>(i) % anchors.size()];
      const double noise = testing::normal(rng, 0.05);
      const double range = (anchor.position.head<2>() - pose.position()).norm() + noise;
      run.messages.push_back({now, Range{now, 0, anchor.id, range, 0.05}});
    }
    pose = pose * step;
  }
  return run;
}

/// One in five messages, scans included, comes 0.5 s later than the others.
Drive with_late_ones(Drive run) {
  for (std::size_t i = 0; i < run.messages.size(); i += 5) {
    run.messages[i].arrival += kLate;
  }
  std::stable_sort(run.messages.begin(), run.messages.end(),
                   [](const Arriving& a, const Arriving& b) { return a.arrival < b.arrival; });
  return run;
}

Mcl mcl_for(const Drive& run, bool anywhere = false) {
  Mcl::Config config;
  config.threads = 1;
  config.seed = 11;
  Mcl mcl(config, {run.anchors, {{0, {0.0, 0.0, 0.0}}}, {}, run.room.map}, 0);
  if (!anywhere) {
    mcl.start_at({{{0, run.start, 0.01 * Matrix<3, 3>::Identity()}, 1.0}});
  }
  return mcl;
}

void feed(LiveMcl& live, const Drive& run) {
  for (const Arriving& one : run.messages) {
    live.on(one.message);
  }
  live.finish();
}

void expect_same(const Mcl& a, const Mcl& b) {
  ASSERT_EQ(a.belief().size, b.belief().size);
  EXPECT_EQ(a.belief().x, b.belief().x);
  EXPECT_EQ(a.belief().y, b.belief().y);
  EXPECT_EQ(a.belief().c, b.belief().c);
  EXPECT_EQ(a.belief().weight, b.belief().weight);
  EXPECT_EQ(a.estimate().stamp, b.estimate().stamp);
  EXPECT_EQ(a.estimate().pose.x, b.estimate().pose.x);
  EXPECT_TRUE(testing::same_bits(a.estimate().covariance, b.estimate().covariance));
  EXPECT_EQ(a.health().wrong, b.health().wrong);
  EXPECT_EQ(a.sigma_hit(), b.sigma_hit());
}

TEST(LiveMcl, messages_and_scans_that_are_late_end_with_the_bits_of_those_in_time) {
  const Drive in_time = drive();
  const Drive late = with_late_ones(in_time);
  for (const bool anywhere : {false, true}) {
    LiveMcl a(mcl_for(in_time, anywhere));
    LiveMcl b(mcl_for(in_time, anywhere));
    feed(a, in_time);
    feed(b, late);
    expect_same(a.mcl(), b.mcl());
  }
}

TEST(LiveMcl, scans_of_two_lasers_of_one_stamp_end_with_the_same_bits_whichever_comes_first) {
  const Drive run = drive();
  std::vector<LiveMcl> lives;
  for (const bool is_front_first : {true, false}) {
    testing::Rng rng(5);
    LiveMcl& live = lives.emplace_back(mcl_for(run));
    for (const Arriving& one : run.messages) {
      if (!std::holds_alternative<LaserScan>(one.message)) {
        live.on(one.message);
        continue;
      }
      LaserScan front = testing::half_scan(run.room.walls, run.start, rng, 0.02, testing::kFront);
      LaserScan rear = testing::half_scan(run.room.walls, run.start, rng, 0.02, testing::kRear);
      front.stamp = rear.stamp = stamp_of(one.message);
      live.on(is_front_first ? front : rear);
      live.on(is_front_first ? rear : front);
    }
    live.finish();
  }
  expect_same(lives[0].mcl(), lives[1].mcl());
}

TEST(LiveMcl, late_ones_are_fused_where_uwb_may_take_over) {
  const Drive in_time = drive();
  const Drive late = with_late_ones(in_time);
  RecoveringEkf uwb(RecoveringEkf::Config{}, {in_time.anchors, {{0, {0.0, 0.0, 0.0}}}});
  uwb.start_at({0, in_time.start, 0.01 * Matrix<3, 3>::Identity()});
  LiveMcl a(SwitchingMcl({}, mcl_for(in_time, true), uwb));
  LiveMcl b(SwitchingMcl({}, mcl_for(in_time, true), uwb));
  feed(a, in_time);
  feed(b, late);
  expect_same(a.mcl(), b.mcl());
  ASSERT_NE(a.switching(), nullptr);
  EXPECT_EQ(a.switching()->uwb().estimate().pose.x, b.switching()->uwb().estimate().pose.x);
  EXPECT_EQ(a.switching()->injections().size(), b.switching()->injections().size());
}

TEST(LiveMcl, equals_the_mcl_fed_by_hand) {
  const Drive run = drive();
  Mcl by_hand = mcl_for(run);
  for (const Arriving& one : run.messages) {  // in order of rank already, but for ranges
    if (source_of(one.message) != Source::kRanges) {
      by_hand.on(one.message);
    }
  }
  LiveMcl live(mcl_for(run));
  for (const Arriving& one : run.messages) {
    if (source_of(one.message) != Source::kRanges) {
      live.on(one.message);
    }
  }
  live.finish();
  expect_same(live.mcl(), by_hand);
}

TEST(LiveMcl, a_scan_waits_for_odometry_and_a_late_one_changes_those_after_it) {
  const Drive run = drive();
  LiveMcl live(mcl_for(run));
  std::vector<std::size_t> scanned;
  std::vector<std::pair<std::size_t, Verdict>> fused;
  LiveMcl::Observer observer;
  observer.fused = [&](std::size_t index, const Outcome& outcome) {
    fused.emplace_back(index, outcome.verdict);
  };
  observer.scanned = [&](const LaserScan& scan, const Outcome& /*outcome*/) {
    scanned.push_back(static_cast<std::size_t>(scan.stamp / kTick));
  };
  LaserScan late;
  std::size_t scans = 0;
  for (const Arriving& one : run.messages) {
    const auto* scan = std::get_if<LaserScan>(&one.message);
    if (scan != nullptr && ++scans == 5) {
      late = *scan;
      continue;
    }
    live.on(one.message, observer);
    if (scan != nullptr) {
      EXPECT_EQ(live.waiting(), 0U);  // odometry has come that far
    }
    if (one.arrival == 30 * kTick) {
      break;
    }
  }
  const std::size_t before = live.arrivals();
  fused.clear();
  live.on(late, observer);
  live.finish(observer);
  EXPECT_THAT(scanned, ::testing::ElementsAre(0, 4, 8, 12, 20, 24, 28, 16));
  const auto times = [&](std::size_t index) {
    return std::count_if(fused.begin(), fused.end(), [&](auto f) { return f.first == index; });
  };
  EXPECT_EQ(times(before), 1);      // the late one
  EXPECT_EQ(times(before - 1), 1);  // and what came after it, again
}

TEST(LiveMcl, older_than_the_history_is_stale) {
  const Drive run = drive();
  LiveMcl::Options options;
  options.history = kSecond;
  LiveMcl live(mcl_for(run), options);
  feed(live, run);
  std::vector<Verdict> verdicts;
  LiveMcl::Observer observer;
  observer.fused = [&](std::size_t /*index*/, const Outcome& o) { verdicts.push_back(o.verdict); };
  live.on(Range{kTick, 0, 0, 2.0, 0.1}, observer);
  live.finish(observer);
  EXPECT_THAT(verdicts, ::testing::ElementsAre(Verdict::kStale));
}

TEST(LiveMcl, a_message_that_is_not_valid_is_forgotten) {
  const Drive run = drive();
  LiveMcl a(mcl_for(run));
  LiveMcl b(mcl_for(run));
  for (std::size_t i = 0; i < run.messages.size(); ++i) {
    a.on(run.messages[i].message);
    b.on(run.messages[i].message);
    if (i == 40) {
      EXPECT_THROW(b.on(Range{run.messages[i].arrival, 0, 0, -1.0, 0.1}), std::invalid_argument);
      EXPECT_THROW(b.on(LaserScan{}), std::invalid_argument);
    }
  }
  a.finish();
  b.finish();
  expect_same(a.mcl(), b.mcl());
}

TEST(LiveMcl, follows_a_clock_that_goes_back) {
  const Drive run = drive();
  for (const ClockJump jump : {ClockJump::kReset, ClockJump::kContinue}) {
    LiveMcl::Options options;
    options.timeline.clock_jump = jump;
    LiveMcl live(mcl_for(run), options);
    for (const Arriving& one : run.messages) {
      live.on(
          std::visit([](auto m) -> Message { return earlier(m, -3600 * kSecond); }, one.message));
    }
    live.finish();
    feed(live, run);
    EXPECT_EQ(live.jumps(), 1U);
    EXPECT_EQ(live.estimate().stamp, kTicks * kTick);
  }
}

TEST(LiveMcl, one_stamp_far_ahead_leaves_the_rest_as_it_is) {
  const Drive run = drive();
  for (const std::size_t after : {0U, 60U}) {
    LiveMcl a(mcl_for(run));
    LiveMcl b(mcl_for(run));
    for (std::size_t i = 0; i < run.messages.size(); ++i) {
      a.on(run.messages[i].message);
      b.on(run.messages[i].message);
      if (i == after) {
        b.on(Range{3600 * kSecond, 0, 0, 2.0, 0.1});
      }
    }
    a.finish();
    b.finish();
    expect_same(a.mcl(), b.mcl());
  }
}

TEST(LiveMcl, what_waited_before_a_jump_of_the_clock_is_not_of_the_time_after_it) {
  const Drive run = drive();
  for (const bool switches : {false, true}) {
    LiveMcl::Options options;
    options.timeline.clock_jump = ClockJump::kContinue;
    RecoveringEkf uwb(RecoveringEkf::Config{}, {run.anchors, {{0, {0.0, 0.0, 0.0}}}});
    uwb.start_at({0, run.start, 0.01 * Matrix<3, 3>::Identity()});
    LiveMcl live = switches ? LiveMcl(SwitchingMcl({}, mcl_for(run), uwb), options)
                            : LiveMcl(mcl_for(run), options);
    const auto lap = [&](Stamp shift, std::size_t end) {
      for (std::size_t i = 0; i < end; ++i) {
        live.on(std::visit([&](auto m) -> Message { return earlier(m, -shift); },
                           run.messages[i].message));
      }
    };
    lap(3600 * kSecond, run.messages.size());
    LaserScan ahead = std::get<LaserScan>(run.messages[1].message);
    ahead.stamp = 3600 * kSecond + (kTicks + 2) * kTick;
    live.on(ahead);
    ASSERT_GT(live.waiting(), 0U);
    lap(0, run.messages.size());
    live.finish();
    EXPECT_EQ(live.jumps(), 1U);
    EXPECT_EQ(live.estimate().stamp, kTicks * kTick);
    if (switches) {
      EXPECT_EQ(live.switching()->uwb().estimate().stamp, kTicks * kTick);
    }
  }
}

TEST(LiveMcl, a_clock_that_stands_still_does_not_fill_the_memory) {
  const Drive run = drive();
  LiveMcl::Options options;
  options.timeline.max_messages = 512;
  LiveMcl live(mcl_for(run), options);
  for (int i = 0; i < 12'000; ++i) {
    live.on(Velocity{0, 0.0, 0.0});
  }
  live.finish();
  EXPECT_GT(live.dropped_messages(), 11'000U);
}

TEST(LiveMcl, takes_what_waits_in_another) {
  const Drive run = drive();
  LiveMcl before(mcl_for(run));
  for (std::size_t i = 0; i < 50; ++i) {
    before.on(run.messages[i].message);
  }
  LaserScan ahead = std::get<LaserScan>(run.messages[1].message);
  ahead.stamp = run.messages[49].arrival + 2 * kTick;
  before.on(ahead);
  ASSERT_GT(before.waiting(), 0U);
  LiveMcl after(mcl_for(run));
  after.go_on_from(before);
  EXPECT_EQ(after.arrivals(), before.waiting());
}

}  // namespace
}  // namespace locfuse::test_live_mcl
