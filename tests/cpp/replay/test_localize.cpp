// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/localize.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse::test_localize {
namespace {

using testing::Rng;

constexpr Stamp kStep = 200'000'000;
constexpr int kSteps = 25;

/// A drive on a circle in a room: an increment and a scan every 0.2 s, sometimes a fix.
struct Drive {
  testing::Room room;
  MessageLog log;
  std::vector<LaserScan> scans;
};

Drive drive() {
  Rng rng(5);
  Drive run;
  run.room = testing::random_room(rng);
  Pose2 pose = run.room.middle * Pose2{0.0, -1.0, 0.0};
  for (int i = 0; i < kSteps; ++i) {
    const Pose2 step = arc(0.1, 0.0, 0.1);
    run.log.add(Increment{i * kStep, (i + 1) * kStep, step});
    run.scans.push_back(testing::scan_from(run.room.walls, pose, rng, 0.02));
    run.scans.back().stamp = i * kStep;
    pose = pose * step;
    if (i % 10 == 5) {
      run.log.add(PositionFix{(i + 1) * kStep, pose.position(), 0.04 * Matrix<2, 2>::Identity()});
    }
  }
  run.log.sort();
  return run;
}

Mcl mcl_for(const Drive& run, int threads = 1) {
  Mcl::Config config;
  config.threads = threads;
  config.seed = 7;
  return {config, testing::on_map(run.room.map), 0};
}

void expect_same(const LocalizeRun::Step& a, const LocalizeRun::Step& b) {
  EXPECT_EQ(a.estimate.stamp, b.estimate.stamp);
  EXPECT_EQ(a.estimate.pose.x, b.estimate.pose.x);
  EXPECT_EQ(a.estimate.pose.y, b.estimate.pose.y);
  EXPECT_EQ(a.estimate.pose.heading, b.estimate.pose.heading);
  EXPECT_TRUE(testing::same_bits(a.estimate.covariance, b.estimate.covariance));
  EXPECT_EQ(a.probability, b.probability);
  EXPECT_EQ(a.explained, b.explained);
  EXPECT_EQ(a.particles, b.particles);
  EXPECT_EQ(a.ready, b.ready);
  EXPECT_EQ(a.sigma, b.sigma);
  EXPECT_EQ(a.health.state, b.health.state);
  EXPECT_EQ(a.health.reason, b.health.reason);
  EXPECT_EQ(a.health.wrong, b.health.wrong);
  EXPECT_EQ(a.health.within, b.health.within);
  EXPECT_TRUE(testing::same_bits(a.health.protection, b.health.protection));
}

TEST(Localize, equals_feeding_by_hand_bit_for_bit) {
  const Drive run = drive();
  Mcl by_hand = mcl_for(run);
  std::vector<LocalizeRun::Step> steps;
  std::vector<Verdict> verdicts;
  std::size_t next = 0;
  const std::vector<MessageLog::Arrival>& arrivals = run.log.arrivals();
  for (const LaserScan& scan : run.scans) {
    for (; next < arrivals.size() && effective_stamp(arrivals[next].message) <= scan.stamp;
         ++next) {
      std::visit([&](const auto& m) { by_hand.on(m); }, arrivals[next].message);
    }
    verdicts.push_back(by_hand.on(scan).verdict);
    steps.push_back({by_hand.estimate(),
                     by_hand.hypotheses().front().probability,
                     by_hand.explained(),
                     by_hand.belief().size,
                     by_hand.ready(),
                     by_hand.overall_estimate().sigma_position(),
                     by_hand.health(),
                     {}});
  }

  for (const int threads : {1, 2}) {
    LiveMcl mcl(mcl_for(run, threads));
    const LocalizeRun result = localize(mcl, run.log, run.scans);
    ASSERT_EQ(result.steps.size(), steps.size());
    for (std::size_t i = 0; i < steps.size(); ++i) {
      expect_same(result.steps[i], steps[i]);
      EXPECT_EQ(result.scan_outcomes[i].verdict, verdicts[i]);
    }
    ASSERT_EQ(result.outcomes.size(), arrivals.size());
    for (const Outcome& outcome : result.outcomes) {
      EXPECT_EQ(outcome.verdict, Verdict::kFused);
    }
  }
}

TEST(Localize, fuses_late_messages_and_scans_where_they_belong) {
  const Drive run = drive();
  MessageLog late;
  for (const MessageLog::Arrival& arrival : run.log.arrivals()) {
    const bool is_fix = std::holds_alternative<PositionFix>(arrival.message);
    late.add(arrival.message, arrival.arrival + (is_fix ? 7 * kStep : 0));
  }
  late.sort();
  std::vector<LaserScan> mixed = run.scans;
  std::swap(mixed[3], mixed[9]);
  LiveMcl a(mcl_for(run));
  LiveMcl b(mcl_for(run));
  const LocalizeRun in_order = localize(a, run.log, run.scans);
  const LocalizeRun result = localize(b, late, mixed);
  ASSERT_FALSE(result.steps.empty());
  expect_same(result.steps.back(), in_order.steps.back());
  EXPECT_EQ(result.scan_outcomes[3].verdict, in_order.scan_outcomes[9].verdict);
  for (std::size_t i = 0; i < result.outcomes.size(); ++i) {
    EXPECT_EQ(result.outcomes[i].verdict, Verdict::kFused);
  }
}

TEST(Localize, scans_before_the_start_are_stale_and_leave_no_step) {
  const Drive run = drive();
  Mcl::Config config;
  LiveMcl mcl(Mcl(config, testing::on_map(run.room.map), 3 * kStep));
  const LocalizeRun result = localize(mcl, run.log, run.scans);
  EXPECT_EQ(result.steps.size(), run.scans.size() - 3);
  EXPECT_EQ(result.scan_outcomes[2].verdict, Verdict::kStale);
  EXPECT_EQ(result.scan_outcomes[3].verdict, Verdict::kFused);
}

TEST(Localize, steps_have_distinct_stamps_where_scans_are_faster_than_odometry) {
  const Drive run = drive();
  MessageLog slow;
  slow.add(Increment{0, 10 * kStep, arc(1.0, 0.0, 1.0)});
  LiveMcl mcl(mcl_for(run));
  const LocalizeRun result =
      localize(mcl, slow, {run.scans.begin(), run.scans.begin() + kSteps / 2});
  ASSERT_EQ(result.steps.size(), 2U);  // at the end of the increment, and after the scan behind it
  EXPECT_EQ(result.steps[0].estimate.stamp, 10 * kStep);
  EXPECT_EQ(result.steps[1].estimate.stamp, 11 * kStep);
}

TEST(Localize, reports_progress_and_results_after_each_scan) {
  const Drive run = drive();
  LiveMcl mcl(mcl_for(run));
  std::vector<std::size_t> reported;
  std::vector<double> seen;
  const LocalizeRun log =
      localize(mcl, run.log, run.scans, {}, [&](std::size_t done, const LocalizeRun& so_far) {
        reported.push_back(done);
        seen.push_back(mcl.estimate().pose.x);
        ASSERT_EQ(so_far.steps.size(), reported.size());
        EXPECT_EQ(so_far.steps.back().estimate.pose.x, seen.back());
        EXPECT_NE(so_far.scan_outcomes[reported.size() - 1].verdict, Verdict::kIgnored);
      });
  ASSERT_EQ(reported.size(), run.scans.size());
  EXPECT_EQ(reported.front(), 2U);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i], log.steps[i].estimate.pose.x);
  }
}

}  // namespace
}  // namespace locfuse::test_localize
