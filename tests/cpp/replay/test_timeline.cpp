// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "locfuse/error.hpp"
#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/replay/timeline.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_timeline {
namespace {

using testing::kSecond;
using testing::same_bits;

const auto kNoSink = [](std::size_t, const Outcome&) {};

PoseEkf ekf_for(const testing::Simulation& run) {
  return {{}, {testing::hall(), testing::one_tag()}, run.start};
}

/// A run with every kind of message, some at equal stamps, some that the filter rejects.
testing::Simulation mixed_run(std::uint64_t seed) {
  testing::Simulation run = testing::simulate(seed, 15.0);
  testing::Rng rng(seed);
  for (Stamp stamp = 0; stamp < 15 * kSecond; stamp += kSecond / 4) {
    run.messages.push_back(PositionFix{stamp, {2.0, 0.0}, 4.0 * Matrix<2, 2>::Identity()});
    run.messages.push_back(PoseObservation{stamp + 3, {}, 9.0 * Matrix<3, 3>::Identity()});
    run.messages.push_back(Range{stamp, 0, 99, 1.0, {}});                               // unknown
    run.messages.push_back(Range{stamp, 0, 1, testing::uniform(rng, 50.0, 90.0), {}});  // far off
  }
  run.messages.push_back(Velocity{15 * kSecond, 1.0, 0.2});
  run.messages.push_back(Velocity{15 * kSecond, 0.5, 0.2});
  return run;
}

/// The messages in order of arrival with latencies of up to `delay`.
std::vector<Message> shuffled(const std::vector<Message>& messages, std::uint64_t seed,
                              Stamp delay) {
  testing::Rng rng(seed);
  std::vector<std::pair<Stamp, Message>> arrivals;
  for (const Message& message : messages) {
    const double late = testing::uniform(rng, 0.0, 1.0) < 0.5 ? 0.0 : testing::uniform(rng, 0, 1);
    arrivals.emplace_back(effective_stamp(message) + static_cast<Stamp>(late * double(delay)),
                          message);
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Message> order;
  for (const auto& [arrival, message] : arrivals) {
    order.push_back(message);
  }
  return order;
}

std::vector<std::size_t> order_of_effect(const std::vector<Message>& messages) {
  std::vector<std::size_t> order(messages.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    order[i] = i;
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return precedes(messages[a], messages[b]);
  });
  return order;
}

TEST(Timeline, late_messages_leave_the_bits_and_outcomes_of_the_sorted_log) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const testing::Simulation run = mixed_run(seed);
    const std::vector<Message> late = shuffled(run.messages, 100 + seed, kSecond / 2);
    const std::vector<std::size_t> order = order_of_effect(late);
    ASSERT_FALSE(std::is_sorted(order.begin(), order.end()));

    PoseEkf sorted = ekf_for(run);
    std::map<std::size_t, Outcome> expected;
    for (const std::size_t index : order) {
      expected[index] = sorted.on(late[index]);
    }
    Timeline<PoseEkf> timeline(ekf_for(run), kSecond / 2);
    std::map<std::size_t, Outcome> received;
    for (const Message& message : late) {
      timeline.on(message, [&](std::size_t index, const Outcome& o) { received[index] = o; });
    }
    EXPECT_TRUE(same_bits(timeline.estimator().belief(), sorted.belief())) << "seed " << seed;
    EXPECT_EQ(timeline.estimator().estimate().pose.x, sorted.estimate().pose.x);
    ASSERT_EQ(received.size(), expected.size());
    for (const auto& [index, outcome] : expected) {
      ASSERT_EQ(received[index].verdict, outcome.verdict) << index;
      ASSERT_EQ(received[index].dof, outcome.dof) << index;
      if (outcome.dof > 0) {
        ASSERT_EQ(received[index].nis, outcome.nis) << index;
      }
    }
  }
}

TEST(Timeline, messages_of_one_stamp_give_the_same_bits_in_any_order) {
  testing::Simulation run = mixed_run(7);
  run.messages.resize(run.messages.size() - 2);  // two motions of one stamp, whose order counts
  testing::Rng rng(3);
  Timeline<PoseEkf> expected(ekf_for(run), kSecond);
  for (const std::size_t index : order_of_effect(run.messages)) {
    expected.on(run.messages[index], kNoSink);
  }
  for (int trial = 0; trial < 5; ++trial) {
    std::vector<Message> mixed = run.messages;
    std::shuffle(mixed.begin(), mixed.end(), rng);
    std::stable_sort(mixed.begin(), mixed.end(), [](const Message& a, const Message& b) {
      return effective_stamp(a) < effective_stamp(b);
    });
    Timeline<PoseEkf> timeline(ekf_for(run), kSecond);
    for (const Message& message : mixed) {
      timeline.on(message, kNoSink);
    }
    EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.estimator().belief())) << trial;
  }
}

TEST(Timeline, motions_of_one_stamp_are_taken_as_they_arrive) {
  const testing::Simulation run = testing::simulate(1, 2.0);
  const Stamp now = run.start.stamp + kSecond;
  for (const auto& [first, last] :
       {std::pair(0.5, 0.0), std::pair(0.0, 0.5), std::pair(0.5, -0.5)}) {
    PoseEkf expected = ekf_for(run);
    Timeline<PoseEkf> timeline(ekf_for(run), kSecond);
    for (const Message& message :
         std::vector<Message>{Velocity{now, first, 0.0}, Velocity{now, last, 0.0},
                              Increment{now + 9, now + 9, {1.0, 0.0, 0.0}},
                              Increment{now + 9, now + 9, {0.0, 0.0, 1.5}},
                              Increment{now + 9, now + 9, {1.0, 0.0, 0.0}}}) {
      expected.on(message);
      timeline.on(message, kNoSink);
    }
    EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.belief()));
  }
}

/// A clock that stands still: past kMaxOfInstant messages they are fused as they arrive.
TEST(Timeline, any_number_of_messages_may_have_one_stamp) {
  const testing::Simulation run = testing::simulate(1, 2.0);
  Timeline<PoseEkf> timeline(ekf_for(run), kSecond);
  const Stamp now = run.start.stamp + kSecond;
  std::size_t outcomes = 0;
  for (int k = 0; k < 3000; ++k) {
    timeline.on(Range{now, 0, 4 - k % 4, 8.0, {}},
                [&](std::size_t, const Outcome&) { ++outcomes; });
  }
  EXPECT_LT(outcomes, 80'000U) << "at most 256 again for each of the first 256";
  timeline.on(Range{now - 5, 0, 1, 8.0, {}}, kNoSink);
  timeline.on(Velocity{now + 5, 0.0, 0.0}, kNoSink);
  EXPECT_EQ(timeline.estimator().belief().stamp, now + 5);
}

TEST(Timeline, says_why_a_message_was_not_fused) {
  const testing::Simulation run = testing::simulate(1, 2.0);
  Timeline<PoseEkf> timeline(ekf_for(run), kSecond / 2);
  const Stamp now = run.start.stamp + kSecond;
  std::size_t sent = 0;
  const auto reason_of = [&](const Message& message) {
    Reason reason = Reason::kNone;
    timeline.on(message, [&](std::size_t index, const Outcome& outcome) {
      reason = index == sent ? outcome.reason : reason;  // others are fused again
    });
    ++sent;
    return reason;
  };
  EXPECT_EQ(reason_of(Velocity{now, 0.0, 0.0}), Reason::kNone);
  EXPECT_EQ(reason_of(Range{now, 0, 99, 1.0, {}}), Reason::kUnknownAnchor);
  EXPECT_EQ(reason_of(Range{now, 99, 1, 1.0, {}}), Reason::kUnknownTag);
  EXPECT_EQ(reason_of(Range{now, 0, 1, 90.0, {}}), Reason::kUnlikely);
  EXPECT_EQ(reason_of(Range{now, 0, 1, 1e6, {}}), Reason::kBeyondLimits);
  EXPECT_EQ(reason_of(RangeBearing{now, 5, 1.0, 0.0, {}}), Reason::kUnknownLandmark);
  EXPECT_EQ(reason_of(PositionFix{now, {}, Matrix<2, 2>::Identity(), 99}), Reason::kUnknownTag);
  EXPECT_EQ(reason_of(Altitude{now, 1.0, {}}), Reason::kNotUsed);
  EXPECT_EQ(reason_of(Velocity{now - kSecond, 0.0, 0.0}), Reason::kTooLate);
  EXPECT_EQ(reason_of(Velocity{now + 60 * kSecond, 0.0, 0.0}), Reason::kTooFarAhead);
  timeline.enable(Source::kRanges, false);
  EXPECT_EQ(reason_of(Range{now, 0, 1, 1.0, {}}), Reason::kSwitchedOff);
}

TEST(Timeline, one_very_late_message_is_fused_where_it_belongs) {
  const testing::Simulation run = testing::simulate(3, 5.0);
  for (const Stamp stamp : {Stamp{0}, kSecond / 3, 2 * kSecond, 4 * kSecond + 999}) {
    const Message late = PositionFix{stamp, {3.0, 0.0}, Matrix<2, 2>::Identity()};
    std::vector<Message> messages = run.messages;
    messages.push_back(late);
    PoseEkf sorted = ekf_for(run);
    for (const std::size_t index : order_of_effect(messages)) {
      sorted.on(messages[index]);
    }
    Timeline<PoseEkf> timeline(ekf_for(run), 10 * kSecond);
    for (const Message& message : messages) {
      timeline.on(message, kNoSink);
    }
    EXPECT_TRUE(same_bits(timeline.estimator().belief(), sorted.belief())) << stamp;
  }
}

TEST(Timeline, a_message_older_than_the_history_is_stale_and_changes_no_bit) {
  const testing::Simulation run = testing::simulate(4, 5.0);
  Timeline<PoseEkf> timeline(ekf_for(run), kSecond);
  for (const Message& message : run.messages) {
    timeline.on(message, kNoSink);
  }
  const Stamp newest = 5 * kSecond;
  const GaussianBelief before = timeline.estimator().belief();
  std::vector<std::pair<std::size_t, Verdict>> received;
  const auto sink = [&](std::size_t index, const Outcome& o) {
    received.emplace_back(index, o.verdict);
  };
  timeline.on(testing::range_to(0, {}, newest - kSecond - 1), sink);
  EXPECT_EQ(received,
            (std::vector<std::pair<std::size_t, Verdict>>{{run.messages.size(), Verdict::kStale}}));
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), before));

  received.clear();
  timeline.on(PositionFix{newest - kSecond, {3.0, 0.0}, Matrix<2, 2>::Identity()}, sink);
  ASSERT_GT(received.size(), 1U);  // just inside: it and what followed
  EXPECT_EQ(received.front().first, run.messages.size() + 1);
  EXPECT_NE(received.front().second, Verdict::kStale);
}

TEST(Timeline, the_sink_receives_again_the_outcomes_after_a_late_message) {
  PoseEkf::Config config;
  config.range.sigma_m = 0.1;
  Timeline<PoseEkf> timeline(testing::ekf_at({}, config), kSecond);
  std::vector<std::size_t> received;
  std::vector<double> residuals;
  const auto sink = [&](std::size_t index, const Outcome& o) {
    received.push_back(index);
    residuals.push_back(o.residual);
  };
  timeline.on(testing::range_to(0, {}, 100), sink);
  timeline.on(testing::range_to(1, {}, 300, 0.2), sink);
  timeline.on(testing::range_to(1, {}, 200, 0.2), sink);
  EXPECT_EQ(received, (std::vector<std::size_t>{0, 1, 2, 1}));
  EXPECT_NEAR(residuals[1], 0.2, 1e-12);
  EXPECT_NEAR(residuals[2], 0.2, 1e-12);
  EXPECT_LT(residuals[3], 0.15);  // the late one has explained part of it
}

TEST(Timeline, an_invalid_late_message_throws_and_is_forgotten) {
  const testing::Simulation run = testing::simulate(5, 4.0);
  Timeline<PoseEkf> disturbed(ekf_for(run), kSecond);
  Timeline<PoseEkf> quiet(ekf_for(run), kSecond);
  for (std::size_t i = 0; i < run.messages.size(); ++i) {
    disturbed.on(run.messages[i], kNoSink);
    quiet.on(run.messages[i], kNoSink);
    const Stamp now = effective_stamp(run.messages[i]);
    const Range late{now - kSecond / 3, 0, 0, -1.0, {}};
    const Range prompt{now, 0, 0, -1.0, {}};
    EXPECT_THROW(disturbed.on(late, kNoSink), std::invalid_argument);
    EXPECT_THROW(disturbed.on(prompt, kNoSink), std::invalid_argument);
    ASSERT_TRUE(same_bits(disturbed.estimator().belief(), quiet.estimator().belief())) << i;
  }
  const Message last = testing::range_to(0, {}, 4 * kSecond - kSecond / 2, 0.1);
  disturbed.on(last, kNoSink);
  quiet.on(last, kNoSink);
  EXPECT_TRUE(same_bits(disturbed.estimator().belief(), quiet.estimator().belief()));
}

TEST(Timeline, refuses_a_negative_history) {
  testing::expect_refused([] { Timeline<PoseEkf>(testing::ekf_at({}), -5); }, "-5");
}

// A history of 292 years overflowed with a newest stamp before 1970.
TEST(Timeline, refuses_a_history_beyond_the_stamp_limit) {
  testing::expect_refused(
      [] { Timeline<PoseEkf>(testing::ekf_at({}), std::numeric_limits<Stamp>::max()); }, "2^62");
  Timeline<PoseEkf> longest(testing::ekf_at({}), kStampLimit);
  longest.on(Velocity{2 - kStampLimit, 0.1, 0.0}, kNoSink);
  longest.on(Velocity{1 - kStampLimit, 0.1, 0.0}, kNoSink);
}

/// Counts the messages that it fuses and those that it refuses.
struct Careless {
  int received = 0;
  Outcome on(const Message& message) {
    ++received;
    if (std::holds_alternative<Range>(message)) {
      throw NumericalError("no ranges");
    }
    return {Verdict::kFused};
  }
};

TEST(Timeline, a_message_that_an_estimator_refuses_leaves_no_trace) {
  Timeline<Careless> timeline({}, kSecond);
  int good = 0;
  for (int k = 0; k < 100; ++k) {
    const Stamp stamp = k * kSecond / 10;
    timeline.on(Velocity{stamp, 0.0, 0.0}, kNoSink);
    ++good;
    EXPECT_THROW(timeline.on(Range{stamp, 0, 0, 1.0, {}}, kNoSink), NumericalError);
    ASSERT_EQ(timeline.estimator().received, good);
    EXPECT_THROW(timeline.on(Range{stamp - 1, 0, 0, 1.0, {}}, kNoSink), NumericalError);
    ASSERT_EQ(timeline.estimator().received, good);
  }
}

}  // namespace
}  // namespace locfuse::test_timeline
