// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>

#include "locfuse/estimators/air_ekf.hpp"
#include "locfuse/estimators/landmark_ekf.hpp"
#include "locfuse/estimators/tag_triangle_ekf.hpp"
#include "locfuse/replay/replay.hpp"
#include "support/expect.hpp"
#include "support/scrubber.hpp"
#include "support/simulation.hpp"

/// Clock jumps, sources that stop and full histories, for every estimator that a Timeline feeds.
namespace locfuse::test_timeline_clock {
namespace {

using testing::kSecond;
using testing::same_bits;

const auto kNoSink = [](std::size_t, const Outcome&) {};
const Pose2 kStart{2.0, -1.0, 0.4};

struct OfPoseEkf {
  static PoseEkf make() { return testing::ekf_at(kStart); }
};
struct OfAirEkf {
  static AirEkf make() {
    const Matrix<4, 4> P = 0.01 * Matrix<4, 4>::Identity();
    return {{}, {testing::hall(), testing::one_tag()}, {0, kStart, 0.0, P}};
  }
};
struct OfLandmarkEkf {
  static LandmarkEkf make() { return {{}, {}, {0, kStart, 0.01 * Matrix<3, 3>::Identity()}}; }
};
struct OfTagTriangleEkf {
  static TagTriangleEkf make() {
    const PoseEstimate start{0, kStart, 0.01 * Matrix<3, 3>::Identity()};
    return {{}, {testing::hall(), testing::triangle()}, start};
  }
};

/// A drive with every kind of message; each estimator fuses those that it models.
std::vector<Message> drive(std::uint64_t seed, double seconds = 6.0) {
  testing::Simulation run = testing::simulate(seed, seconds);
  testing::Rng rng(seed);
  const Stamp end = static_cast<Stamp>(seconds * 1e9);
  for (Stamp stamp = 0; stamp < end; stamp += kSecond / 5) {
    const Matrix<2, 2> R = 4.0 * Matrix<2, 2>::Identity();
    const Vector<2> at{testing::normal(rng, 0.5) + 2.0, testing::normal(rng, 0.5) - 1.0};
    run.messages.push_back(PositionFix{stamp, at, R, {}});
    run.messages.push_back(PositionFix{stamp, at, R, 10});
    run.messages.push_back(Range{stamp, 11, 1, testing::uniform(rng, 8.0, 14.0), {}});
    run.messages.push_back(RangeBearing{stamp, 4, 5.0 + testing::normal(rng, 0.1), 0.2, {}});
    run.messages.push_back(PoseObservation{stamp + 3, kStart, Matrix<3, 3>::Identity()});
  }
  std::stable_sort(run.messages.begin(), run.messages.end(), [](const auto& a, const auto& b) {
    return effective_stamp(a) < effective_stamp(b);
  });
  return run.messages;
}

std::vector<Message> late(const std::vector<Message>& messages, std::uint64_t seed, Stamp most) {
  testing::Rng rng(seed);
  std::vector<std::pair<Stamp, Message>> arrivals;
  for (const Message& message : messages) {
    const double share = testing::uniform(rng, 0.0, 1.0);
    arrivals.emplace_back(
        effective_stamp(message) + static_cast<Stamp>(share * static_cast<double>(most)), message);
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Message> order;
  for (const auto& [arrival, message] : arrivals) {
    order.push_back(message);
  }
  return order;
}

std::vector<Message> in_order(std::vector<Message> messages) {
  std::stable_sort(messages.begin(), messages.end(), precedes);
  return messages;
}

template <class Estimator>
void feed(Timeline<Estimator>& timeline, const std::vector<Message>& messages) {
  for (const Message& message : messages) {
    timeline.on(message, kNoSink);
  }
}

template <class Of>
class TimelineOf : public ::testing::Test {};
using Estimators = ::testing::Types<OfPoseEkf, OfAirEkf, OfLandmarkEkf, OfTagTriangleEkf>;
TYPED_TEST_SUITE(TimelineOf, Estimators, );  // the comma is ISO C++17: names are the default

TYPED_TEST(TimelineOf, late_messages_leave_the_bits_of_the_sorted_log) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const std::vector<Message> order = late(drive(seed), 50 + seed, kSecond / 2);
    const std::vector<Message> sorted = in_order(order);
    auto expected = TypeParam::make();
    std::map<Verdict, int> verdicts;
    for (const Message& message : sorted) {
      ++verdicts[expected.on(message).verdict];
    }
    ASSERT_GT(verdicts[Verdict::kFused], 20);
    Timeline timeline(TypeParam::make(), kSecond / 2);
    feed(timeline, order);
    EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.belief())) << "seed " << seed;
  }
}

TYPED_TEST(TimelineOf, reset_equals_a_new_one_to_the_bit) {
  Timeline timeline(TypeParam::make(), kSecond);
  timeline.enable(Source::kOdometry, false);
  feed(timeline, late(drive(1), 2, kSecond / 2));
  timeline.reset();
  Timeline fresh(TypeParam::make(), kSecond);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), fresh.estimator().belief()));
  const std::vector<Message> again = late(drive(3), 4, kSecond / 2);
  std::size_t first = 99;
  for (const Message& message : again) {
    timeline.on(message,
                [&](std::size_t index, const Outcome&) { first = std::min(first, index); });
    fresh.on(message, kNoSink);
  }
  EXPECT_EQ(first, 0U) << "arrivals count from 0 again";
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), fresh.estimator().belief()));
}

TYPED_TEST(TimelineOf, a_looped_recording_gives_the_bits_of_the_first_round) {
  const std::vector<Message> round = drive(1);
  TimelineOptions options;
  options.clock_jump = ClockJump::kReset;
  Timeline once(TypeParam::make(), kSecond);
  feed(once, round);
  Timeline looped(TypeParam::make(), kSecond, options);
  for (int i = 0; i < 3; ++i) {
    feed(looped, round);
    EXPECT_EQ(looped.jumps(), static_cast<std::size_t>(i));
    EXPECT_TRUE(same_bits(looped.estimator().belief(), once.estimator().belief())) << i;
  }
}

TYPED_TEST(TimelineOf, one_stamp_far_ahead_makes_no_others_stale) {
  constexpr Stamp kHours = 10'000 * kSecond;
  std::vector<Message> messages = drive(1);
  Timeline expected(TypeParam::make(), kSecond);
  feed(expected, messages);
  const PositionFix ahead{kHours, {2.0, -1.0}, Matrix<2, 2>::Identity(), {}};
  const auto middle = messages.begin() + static_cast<std::ptrdiff_t>(messages.size() / 2);
  messages.insert(middle, {ahead, ahead});  // twice in a row, by one of several sources
  Timeline timeline(TypeParam::make(), kSecond);
  std::map<Verdict, int> verdicts;
  for (const Message& message : messages) {
    timeline.on(message, [&](std::size_t, const Outcome& outcome) { ++verdicts[outcome.verdict]; });
  }
  EXPECT_EQ(verdicts[Verdict::kStale], 0);
  EXPECT_GE(verdicts[Verdict::kIgnored], 2);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.estimator().belief()));
}

TYPED_TEST(TimelineOf, a_clock_that_goes_far_ahead_loses_no_message) {
  std::vector<Message> messages = drive(1);
  const std::size_t half = messages.size() / 2;
  for (std::size_t i = half; i < messages.size(); ++i) {
    messages[i] = earlier(messages[i], -100 * kSecond);
  }
  auto expected = TypeParam::make();
  for (const Message& message : in_order(messages)) {
    expected.on(message);
  }
  Timeline timeline(TypeParam::make(), kSecond);
  feed(timeline, messages);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.belief()));
}

TYPED_TEST(TimelineOf, a_clock_jump_is_refused_by_default) {
  const std::vector<Message> round = drive(1);
  Timeline timeline(TypeParam::make(), kSecond);
  feed(timeline, round);
  const auto before = timeline.estimator().belief();
  for (const Message& message : drive(2, 4.0)) {
    timeline.on(message,
                [](std::size_t, const Outcome& o) { EXPECT_EQ(o.verdict, Verdict::kStale); });
  }
  EXPECT_EQ(timeline.jumps(), 0U);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), before));
}

TYPED_TEST(TimelineOf, a_source_that_stops_delays_no_other) {
  const std::vector<Message> all = drive(1);
  std::vector<Message> rest;  // odometry stops in the middle
  std::copy_if(all.begin(), all.end(), std::back_inserter(rest), [](const Message& m) {
    return source_of(m) != Source::kOdometry || effective_stamp(m) < 3 * kSecond;
  });
  Timeline timeline(TypeParam::make(), kSecond);
  for (const Message& message : rest) {
    bool has_outcome = false;
    timeline.on(message, [&](std::size_t, const Outcome&) { has_outcome = true; });
    ASSERT_TRUE(has_outcome) << "an outcome at once";
  }
  EXPECT_GT(timeline.estimator().belief().stamp, 5 * kSecond);
}

TYPED_TEST(TimelineOf, a_disabled_source_has_no_effect) {
  const std::vector<Message> all = drive(1);
  Timeline with(TypeParam::make(), kSecond);
  Timeline without(TypeParam::make(), kSecond);
  int ignored = 0;
  for (const Message& message : all) {
    const bool off =
        effective_stamp(message) >= 2 * kSecond && effective_stamp(message) < 4 * kSecond;
    with.enable(Source::kPositions, !off);
    with.on(message, [&](std::size_t, const Outcome& o) {
      ignored += o.verdict == Verdict::kIgnored && source_of(message) == Source::kPositions ? 1 : 0;
    });
    if (!off || source_of(message) != Source::kPositions) {
      without.on(message, kNoSink);
    }
  }
  EXPECT_EQ(ignored, 2 * 5 * 2);
  EXPECT_TRUE(same_bits(with.estimator().belief(), without.estimator().belief()));
}

TYPED_TEST(TimelineOf, equal_stamps_and_steps_of_a_nanosecond_are_fused_in_order) {
  auto expected = TypeParam::make();
  Timeline timeline(TypeParam::make(), kSecond);
  std::vector<Message> messages;
  const Matrix<2, 2> R = Matrix<2, 2>::Identity();
  for (const Stamp step : {Stamp{0}, Stamp{1}}) {
    for (Stamp i = 0; i < 40; ++i) {
      const Stamp stamp = kSecond + i * step;
      messages.push_back(Increment{stamp, stamp + step, {1e-3, 0.0, 1e-3}});
      messages.push_back(Velocity{stamp + step, 0.2, 0.1});
      messages.push_back(PositionFix{stamp, {2.2, -1.0}, R, {}});
      messages.push_back(PositionFix{stamp, {2.2, -1.0}, R, 10});
    }
  }
  std::stable_sort(messages.begin(), messages.end(), [](const auto& a, const auto& b) {
    return effective_stamp(a) < effective_stamp(b);
  });
  feed(timeline, messages);
  for (const Message& message : in_order(messages)) {
    expected.on(message);
  }
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.belief()));
  EXPECT_TRUE(testing::is_covariance(expected.belief().P));
  EXPECT_TRUE(expected.belief().x.allFinite());
}

// Clock jumps -------------------------------------------------------------------------------------

TimelineOptions with(ClockJump policy) {
  TimelineOptions options;
  options.clock_jump = policy;
  return options;
}

TEST(Timeline, continues_from_the_same_pose_at_the_new_time) {
  Timeline timeline(testing::ekf_at(kStart), kSecond, with(ClockJump::kContinue));
  feed(timeline, drive(1));
  PoseEstimate here = timeline.estimator().estimate();
  here.stamp = 0;
  const std::vector<Message> after = drive(2, 3.0);
  PoseEkf before = testing::ekf_at(kStart);  // what it has learnt of its sources, it keeps
  for (const Message& message : drive(1)) {
    before.on(message);
  }
  PoseEkf expected = before.restarted(here);
  for (const Message& message : after) {
    expected.on(message);
  }
  feed(timeline, after);
  EXPECT_EQ(timeline.jumps(), 1U);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), expected.belief()));
}

TEST(Timeline, waits_for_one_more_message_of_a_source_that_comes_rarely) {
  Timeline timeline(testing::ekf_at(kStart), kSecond);
  std::map<std::size_t, Verdict> verdicts;
  const auto sink = [&](std::size_t index, const Outcome& outcome) {
    verdicts[index] = outcome.verdict;
  };
  for (Stamp k = 0; k < 6; ++k) {  // each is far ahead of the one before
    timeline.on(PositionFix{k * 10 * kSecond, {2.0, -1.0}, Matrix<2, 2>::Identity(), {}}, sink);
  }
  for (std::size_t index = 0; index < 5; ++index) {
    EXPECT_EQ(verdicts[index], Verdict::kFused) << index;
  }
}

TEST(Timeline, follows_the_only_source_left_after_a_pause) {
  Timeline timeline(testing::ekf_at(kStart), kSecond);
  feed(timeline, drive(1));
  Verdict last = Verdict::kIgnored;
  for (Stamp k = 0; k < 20; ++k) {
    timeline.on(PositionFix{(600 + k) * kSecond, {2.0, -1.0}, Matrix<2, 2>::Identity(), {}},
                [&](std::size_t, const Outcome& outcome) { last = outcome.verdict; });
    EXPECT_EQ(last == Verdict::kIgnored, k < 19) << k;
  }
}

TEST(Timeline, a_buffer_flushed_by_one_source_is_not_a_jump) {
  Timeline timeline(testing::ekf_at(kStart), kSecond, with(ClockJump::kReset));
  feed(timeline, drive(1));
  const auto before = timeline.estimator().belief();
  for (int i = 0; i < 100; ++i) {
    timeline.on(testing::range_to(0, kStart, i), kNoSink);
  }
  EXPECT_EQ(timeline.jumps(), 0U);
  EXPECT_TRUE(same_bits(timeline.estimator().belief(), before));
}

// All of them were kept until another source published.
TEST(Timeline, keeps_only_the_latest_stale_messages_of_a_single_source) {
  Timeline timeline(testing::ekf_at(kStart), kSecond, with(ClockJump::kReset));
  feed(timeline, drive(1));
  std::vector<std::size_t> arrivals;
  const auto sink = [&](std::size_t index, const Outcome&) { arrivals.push_back(index); };
  for (int i = 0; i < 3000; ++i) {
    timeline.on(testing::range_to(0, kStart, i), sink);
  }
  const std::size_t last = arrivals.back();
  arrivals.clear();
  timeline.on(Velocity{3000, 0.1, 0.0}, sink);
  EXPECT_EQ(timeline.jumps(), 1U);
  ASSERT_GT(arrivals.size(), 100U) << "the messages that signalled the jump are fused";
  EXPECT_LE(arrivals.size(), 514U) << "one has two outcomes: stale, then fused";
  EXPECT_GT(*std::min_element(arrivals.begin(), arrivals.end()), last - 512);
}

TEST(Timeline, late_messages_among_good_ones_are_not_a_jump) {
  Timeline timeline(testing::ekf_at(kStart), kSecond, with(ClockJump::kReset));
  feed(timeline, drive(1));
  for (int i = 0; i < 100; ++i) {
    timeline.on(testing::range_to(0, kStart, i), kNoSink);
    timeline.on(Velocity{i, 0.1, 0.0}, kNoSink);
    timeline.on(Velocity{6 * kSecond + i, 0.1, 0.0}, kNoSink);
  }
  EXPECT_EQ(timeline.jumps(), 0U);
}

TEST(Timeline, after_a_jump_every_message_that_signalled_it_has_its_outcome) {
  Timeline timeline(testing::ekf_at(kStart), kSecond, with(ClockJump::kReset));
  std::map<std::size_t, Verdict> last;
  const auto sink = [&](std::size_t index, const Outcome& o) { last[index] = o.verdict; };
  const std::vector<Message> round = drive(1);
  for (int i = 0; i < 2; ++i) {
    for (const Message& message : round) {
      timeline.on(message, sink);
    }
  }
  for (std::size_t i = 0; i < round.size(); ++i) {
    EXPECT_EQ(last[i], last[round.size() + i]) << i;
  }
}

TEST(Timeline, refuses_to_continue_an_estimator_that_cannot) {
  testing::expect_refused([] { Timeline(OfAirEkf::make(), kSecond, with(ClockJump::kContinue)); },
                          "kReset");
  TimelineOptions few;
  few.max_messages = 10;
  testing::expect_refused([&] { Timeline(OfPoseEkf::make(), kSecond, few); }, "max_messages", "10");
}

// Bounds ------------------------------------------------------------------------------------------

TEST(Timeline, drops_messages_beyond_the_maximum_and_counts_them) {
  TimelineOptions options;
  options.max_messages = 512;
  Timeline few(testing::ekf_at(kStart), 1000 * kSecond, options);
  Timeline all(testing::ekf_at(kStart), 1000 * kSecond);
  const std::vector<Message> messages = drive(1, 20.0);
  ASSERT_GT(messages.size(), 1000U);
  feed(few, messages);
  feed(all, messages);
  EXPECT_TRUE(same_bits(few.estimator().belief(), all.estimator().belief()));
  EXPECT_EQ(all.dropped_messages(), 0U);
  EXPECT_GE(few.dropped_messages(), messages.size() - 512);
  EXPECT_LT(few.dropped_messages(), messages.size() - 256);

  std::vector<Verdict> verdicts;
  const auto sink = [&](std::size_t, const Outcome& o) { verdicts.push_back(o.verdict); };
  few.on(testing::range_to(0, kStart, kSecond), sink);
  ASSERT_EQ(verdicts.size(), 1U);
  EXPECT_EQ(verdicts[0], Verdict::kStale) << "inside the history, but what followed is gone";
  all.on(testing::range_to(0, kStart, kSecond), kNoSink);  // fuses again all messages
  const Message recent = testing::range_to(1, kStart, 19 * kSecond, 3.0);
  Timeline twin(testing::ekf_at(kStart), 1000 * kSecond);
  feed(twin, messages);
  few.on(recent, kNoSink);
  twin.on(recent, kNoSink);
  EXPECT_TRUE(same_bits(few.estimator().belief(), twin.estimator().belief()));
}

TEST(Message, is_earlier_by_a_known_delay) {
  const Message range = earlier(testing::range_to(0, kStart, 5 * kSecond), kSecond);
  EXPECT_EQ(stamp_of(range), 4 * kSecond);
  const Message motion = earlier(Message(Increment{kSecond, 2 * kSecond, {}}), kSecond);
  EXPECT_EQ(effective_stamp(motion), 0);
  EXPECT_EQ(stamp_of(motion), kSecond);
}

TEST(Replay, switches_sources_by_arrival_and_records_it) {
  MessageLog log;
  for (const Message& message : drive(1)) {
    log.add(message);
  }
  log.sort();
  ReplayOptions options;
  options.switches = {{2 * kSecond, Source::kRanges, false}, {4 * kSecond, Source::kRanges, true}};
  const RunLog run = replay(testing::ekf_at(kStart), log, options);
  for (std::size_t i = 0; i < run.outcomes.size(); ++i) {
    const MessageLog::Arrival& arrival = log.arrivals()[i];
    const bool off = source_of(arrival.message) == Source::kRanges &&
                     arrival.arrival >= 2 * kSecond && arrival.arrival < 4 * kSecond;
    EXPECT_EQ(run.outcomes[i].verdict == Verdict::kIgnored, off) << i;
  }
}

TEST(Timeline, a_clock_jump_before_the_start_restarts) {
  TimelineOptions options;
  options.clock_jump = ClockJump::kContinue;
  options.jump_after = 1;
  Timeline<RecoveringEkf> timeline({{}, {testing::hall(), testing::one_tag()}}, 0, options);
  timeline.on(Velocity{kSecond, 0.0, 0.0}, kNoSink);
  EXPECT_NO_THROW(timeline.on(Velocity{0, 0.0, 0.0}, kNoSink));
  EXPECT_EQ(timeline.jumps(), 1U);
}

}  // namespace
}  // namespace locfuse::test_timeline_clock
