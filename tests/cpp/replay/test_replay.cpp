// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <future>
#include <numeric>

#include "locfuse/replay/replay.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_replay {
namespace {

using testing::kSecond;
using testing::same_bits;

PoseEkf ekf_for(const testing::Simulation& run) {
  return {{}, {testing::hall(), testing::one_tag()}, run.start};
}

/// Ranges arrive up to 0.4 s late.
MessageLog late_log(const testing::Simulation& run) {
  testing::Rng rng(9);
  MessageLog log;
  for (const Message& message : run.messages) {
    const bool late = std::holds_alternative<Range>(message);
    log.add(message, stamp_of(message) + (late ? testing::at(testing::uniform(rng, 0.0, 0.4)) : 0));
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

TEST(Replay, ends_where_the_robot_is) {
  const testing::Simulation run = testing::simulate(1, 20.0);
  const RunLog log = replay(ekf_for(run), late_log(run), {});
  EXPECT_EQ(log.last.stamp, 20 * kSecond);
  EXPECT_NEAR(log.last.pose.x, run.x, 0.15);
  EXPECT_NEAR(log.last.pose.y, run.y, 0.15);
}

TEST(Replay, estimates_strictly_increase_and_reach_from_the_start_to_the_end) {
  const testing::Simulation run = testing::simulate(2, 20.0);
  const RunLog log = replay(ekf_for(run), late_log(run), {});
  ASSERT_GT(log.estimates.size(), 300U);
  for (std::size_t i = 1; i < log.estimates.size(); ++i) {
    ASSERT_GT(log.estimates[i].stamp, log.estimates[i - 1].stamp) << i;
  }
  EXPECT_EQ(log.estimates.front().stamp, 0);
  expect_same(log.estimates.back(), log.last);
}

TEST(Replay, outcomes_are_those_of_the_sorted_log) {
  const testing::Simulation run = testing::simulate(3, 20.0);
  const MessageLog late = late_log(run);
  const RunLog log = replay(ekf_for(run), late, {});
  ASSERT_EQ(log.outcomes.size(), late.arrivals().size());
  std::vector<std::size_t> order(log.outcomes.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    order[i] = i;
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return precedes(late.arrivals()[a].message, late.arrivals()[b].message);
  });
  PoseEkf sorted = ekf_for(run);
  for (const std::size_t index : order) {
    const Outcome expected = sorted.on(late.arrivals()[index].message);
    ASSERT_EQ(log.outcomes[index].verdict, expected.verdict) << index;
    if (expected.dof > 0) {
      ASSERT_EQ(log.outcomes[index].nis, expected.nis) << index;
    }
  }
  expect_same(log.last, sorted.estimate());
}

TEST(Replay, recording_changes_no_bit_of_the_result) {
  const testing::Simulation run = testing::simulate(4, 20.0);
  ReplayOptions options;
  options.record = false;
  const RunLog quiet = replay(ekf_for(run), late_log(run), options);
  EXPECT_TRUE(quiet.outcomes.empty());
  EXPECT_TRUE(quiet.estimates.empty());
  expect_same(quiet.last, replay(ekf_for(run), late_log(run), {}).last);
}

TEST(Replay, gives_the_same_bits_twice) {
  const testing::Simulation run = testing::simulate(5, 20.0);
  const RunLog first = replay(ekf_for(run), late_log(run), {});
  const RunLog second = replay(ekf_for(run), late_log(run), {});
  ASSERT_EQ(first.estimates.size(), second.estimates.size());
  for (std::size_t i = 0; i < first.estimates.size(); ++i) {
    expect_same(first.estimates[i], second.estimates[i]);
  }
  expect_same(first.last, second.last);
}

TEST(Replay, gives_the_same_bits_on_any_number_of_threads) {
  const testing::Simulation run = testing::simulate(7, 20.0);
  const PoseEkf start = ekf_for(run);  // all share its models and maps
  const MessageLog log = late_log(run);
  const PoseEstimate alone = replay(start, log, {}).last;
  std::vector<std::future<PoseEstimate>> together;
  for (int i = 0; i < 4; ++i) {
    together.push_back(std::async(std::launch::async, [&] { return replay(start, log, {}).last; }));
  }
  for (std::future<PoseEstimate>& one : together) {
    expect_same(one.get(), alone);
  }
}

TEST(Replay, ends_where_the_last_increment_ends) {
  MessageLog log;
  log.add(Increment{0, kSecond, {0.5, 0.0, 0.0}});
  log.add(Increment{kSecond, 2 * kSecond, {1.0, 0.0, 0.0}});
  const RunLog run = replay(testing::ekf_at({}), log, {});
  EXPECT_EQ(run.last.stamp, 2 * kSecond);
  EXPECT_NEAR(run.last.pose.x, 1.5, 1e-15);
  expect_same(run.estimates.back(), run.last);
}

TEST(Replay, records_each_stamp_once_with_all_its_measurements) {
  const PoseEkf start = testing::ekf_at({1.0, 2.0, 0.5});
  MessageLog log;
  log.add(testing::range_to(0, {1.0, 2.0, 0.5}, kSecond, 0.05));
  log.add(testing::range_to(1, {1.0, 2.0, 0.5}, kSecond, 0.05));
  log.add(testing::range_to(2, {1.0, 2.0, 0.5}, 2 * kSecond, 0.05));
  log.add(testing::range_to(0, {1.0, 2.0, 0.5}, 3 * kSecond, 90.0));  // gated
  const RunLog run = replay(start, log, {});
  ASSERT_EQ(run.estimates.size(), 3U);
  PoseEkf ekf = start;
  expect_same(run.estimates[0], ekf.current());
  ekf.on(log.arrivals()[0].message);
  ekf.on(log.arrivals()[1].message);
  expect_same(run.estimates[1], ekf.current());
  ekf.on(log.arrivals()[2].message);
  expect_same(run.estimates[2], ekf.current());
  expect_same(run.last, ekf.current());
}

TEST(Replay, without_history_late_messages_are_stale) {
  const testing::Simulation run = testing::simulate(6, 20.0);
  ReplayOptions options;
  options.history = 0;
  const RunLog log = replay(ekf_for(run), late_log(run), options);
  EXPECT_GT(std::count_if(log.outcomes.begin(), log.outcomes.end(),
                          [](const Outcome& o) { return o.verdict == Verdict::kStale; }),
            100);
}

TEST(Replay, what_arrives_together_has_its_outcome_in_whatever_order_it_stands) {
  const testing::Simulation run = testing::simulate(5, 10.0);
  MessageLog log;
  for (const Message& message : run.messages) {
    log.add(message, stamp_of(message));
  }
  log.sort();
  const RunLog expected = replay(ekf_for(run), log, {});
  std::vector<std::size_t> places(log.arrivals().size());
  std::iota(places.begin(), places.end(), std::size_t{0});
  std::stable_sort(places.begin(), places.end(), [&](std::size_t a, std::size_t b) {
    const auto& first = log.arrivals()[a];
    const auto& second = log.arrivals()[b];
    return first.arrival != second.arrival ? first.arrival < second.arrival
                                           : precedes(second.message, first.message);
  });
  MessageLog turned;
  for (const std::size_t place : places) {
    turned.add(log.arrivals()[place].message, log.arrivals()[place].arrival);
  }
  EXPECT_FALSE(std::is_sorted(places.begin(), places.end()));
  const RunLog found = replay(ekf_for(run), turned, {});
  expect_same(found.last, expected.last);
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_EQ(found.outcomes[i].verdict, expected.outcomes[places[i]].verdict);
    const double nis = found.outcomes[i].nis;
    const double other = expected.outcomes[places[i]].nis;
    EXPECT_TRUE(nis == other || (std::isnan(nis) && std::isnan(other)));
  }
}

TEST(Replay, an_empty_log_leaves_the_start) {
  const PoseEkf start = testing::ekf_at({1.0, 2.0, 0.5});
  const RunLog log = replay(start, MessageLog(), {});
  EXPECT_TRUE(log.outcomes.empty());
  ASSERT_EQ(log.estimates.size(), 1U);
  expect_same(log.last, start.current());
}

TEST(Replay, progress_shows_the_beginning_of_the_results) {
  MessageLog log;
  for (Stamp stamp = 0; stamp < 40'000; ++stamp) {
    log.add(Velocity{stamp, 0.1, 0.0});
  }
  std::vector<RunLog> shown;
  ReplayOptions options;
  options.progress = [&](std::size_t done, const RunLog& so_far) {
    EXPECT_EQ(so_far.outcomes.size(), done);
    shown.push_back(so_far);
  };
  const RunLog whole = replay(testing::ekf_at({}), log, options);
  ASSERT_EQ(shown.size(), 2U);
  EXPECT_EQ(shown[0].outcomes.size(), 16384U);
  EXPECT_EQ(shown[1].outcomes.size(), 32768U);
  for (const RunLog& so_far : shown) {
    ASSERT_LT(so_far.estimates.size(), whole.estimates.size());
    for (std::size_t k = 0; k < so_far.estimates.size(); ++k) {
      expect_same(so_far.estimates[k], whole.estimates[k]);
    }
    EXPECT_EQ(so_far.last.stamp, static_cast<Stamp>(so_far.outcomes.size()) - 1);
  }
  EXPECT_EQ(whole.outcomes.size(), 40'000U);
}

TEST(Replay, records_health_after_a_clock_jump) {
  for (const ClockJump policy : {ClockJump::kContinue, ClockJump::kReset}) {
    RecoveringEkf robot({}, {testing::hall(), testing::one_tag()});
    robot.start_at({0, {1.0, 1.0, 0.0}, 0.01 * Matrix<3, 3>::Identity()});
    MessageLog log;
    for (int k = 0; k < 900; ++k) {
      const Stamp stamp = (k < 300 ? 10000 + k : k - 300) * kSecond / 10;
      log.add(Velocity{stamp, 0.0, 0.0}, k * kSecond / 10);
      log.add(PositionFix{stamp, {1.3, 0.8}, 0.01 * Matrix<2, 2>::Identity()}, k * kSecond / 10);
    }
    log.sort();
    ReplayOptions options;
    options.timeline.clock_jump = policy;
    const RunLog run = replay(robot, log, options);
    ASSERT_EQ(run.jumps, 1U);
    EXPECT_GT(run.health.size(), 500U);
    EXPECT_LT(run.health.back().stamp, 60 * kSecond);
    EXPECT_GT(run.health.back().stamp, 59 * kSecond);
  }
}

}  // namespace
}  // namespace locfuse::test_replay
