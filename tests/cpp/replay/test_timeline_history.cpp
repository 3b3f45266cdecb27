// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <numeric>
#include <vector>

#include "locfuse/replay/timeline.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_timeline_history {
namespace {

const auto kNoSink = [](std::size_t, const Outcome&) {};

/// An estimator that records its messages and counts them and its living copies.
class Diary {
 public:
  Diary() { ++living; }
  Diary(const Diary& other) : pages_(other.pages_) { ++living; }
  Diary(Diary&& other) noexcept : pages_(std::move(other.pages_)) { ++living; }
  Diary& operator=(const Diary&) = default;
  Diary& operator=(Diary&&) = default;
  ~Diary() { --living; }

  /// Refuses negative velocities, and 7 after 3.
  Outcome on(const Message& message) {
    ++count;
    const double page = std::get<Velocity>(message).forward;
    if (page < 0.0) {
      throw std::invalid_argument("negative");
    }
    if (page == 7.0 && std::find(pages_.begin(), pages_.end(), 3.0) != pages_.end()) {
      throw std::runtime_error("7 after 3");
    }
    pages_.push_back(page);
    return {Verdict::kFused};
  }
  [[nodiscard]] const std::vector<double>& pages() const { return pages_; }

  static inline int living = 0;
  static inline int count = 0;

 private:
  std::vector<double> pages_;
};

/// Like Diary, but with a sum that depends on the order: cheap for long runs.
struct Digest {
  Digest() { ++living; }
  Digest(const Digest& other) : value(other.value) { ++living; }
  Digest& operator=(const Digest&) = default;
  ~Digest() { --living; }

  Outcome on(const Message& message) {
    ++count;
    const double page = std::get<Velocity>(message).forward;
    if (page < 0.0) {
      throw std::invalid_argument("negative");
    }
    value = value * 31U + static_cast<std::uint64_t>(page) + 1U;
    return {Verdict::kFused};
  }

  std::uint64_t value = 0;
  static inline int living = 0;
  static inline int count = 0;
};

Message page(Stamp stamp, double number) { return Velocity{stamp, number, 0.0}; }

TEST(Timeline, equal_stamps_take_effect_in_order_of_arrival) {
  Timeline<Diary> timeline(Diary(), 100);
  const std::vector<Stamp> stamps = {10, 20, 20, 10, 30, 20, 10};
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    timeline.on(page(stamps[i], static_cast<double>(i + 10)), kNoSink);
  }
  EXPECT_EQ(timeline.estimator().pages(), (std::vector<double>{10, 13, 16, 11, 12, 15, 14}));
}

TEST(Timeline, a_late_message_for_which_a_later_one_is_refused_is_forgotten) {
  Timeline<Diary> timeline(Diary(), 1000);
  for (int i = 0; i < 100; ++i) {
    timeline.on(page(10 * i, i == 60 ? 7.0 : 100.0 + i), kNoSink);
  }
  const std::vector<double> before = timeline.estimator().pages();
  EXPECT_THROW(timeline.on(page(305, 3.0), kNoSink), std::runtime_error);
  EXPECT_EQ(timeline.estimator().pages(), before);
  timeline.on(page(705, 3.0), kNoSink);  // after the 7 it is accepted
  EXPECT_EQ(timeline.estimator().pages().size(), 101U);
  timeline.on(page(105, 4.0), kNoSink);
  EXPECT_EQ(timeline.estimator().pages()[11], 4.0);
  EXPECT_EQ(timeline.estimator().pages().size(), 102U);
}

TEST(Timeline, long_shuffled_runs_equal_the_sorted_log_while_history_is_dropped) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    testing::Rng rng(seed);
    std::vector<std::pair<Stamp, Stamp>> arrivals;  // arrival, stamp
    for (Stamp stamp = 0; stamp < 20'000; stamp += 5) {
      arrivals.emplace_back(stamp + static_cast<Stamp>(testing::uniform(rng, 0.0, 300.0)), stamp);
    }
    std::stable_sort(arrivals.begin(), arrivals.end());
    Timeline<Digest> timeline(Digest(), 300);
    std::vector<std::pair<Stamp, double>> sorted;
    for (std::size_t i = 0; i < arrivals.size(); ++i) {
      timeline.on(page(arrivals[i].second, static_cast<double>(i)), kNoSink);
      sorted.emplace_back(arrivals[i].second, static_cast<double>(i));
    }
    std::sort(sorted.begin(), sorted.end());
    Digest expected;
    for (const auto& [stamp, number] : sorted) {
      expected.on(page(stamp, number));
    }
    EXPECT_EQ(timeline.estimator().value, expected.value) << "seed " << seed;
  }
}

TEST(Timeline, keeps_no_more_snapshots_than_the_history_needs) {
  Timeline<Digest> timeline(Digest(), 1000);  // 100 messages
  int most = 0;
  for (int i = 0; i < 100'000; ++i) {
    timeline.on(page(10 * i, 1.0), kNoSink);
    most = std::max(most, Digest::living);
  }
  EXPECT_LE(most, 1 + 256 / 16 + 1);
}

TEST(Timeline, refused_messages_take_no_memory) {
  // Each left a snapshot behind where one was due.
  Timeline<Digest> timeline(Digest(), 1000);
  for (int i = 0; i < 16; ++i) {
    timeline.on(page(i, 1.0), kNoSink);
  }
  for (int i = 0; i < 1000; ++i) {
    EXPECT_THROW(timeline.on(page(100, -1.0), kNoSink), std::invalid_argument);
  }
  EXPECT_LE(Digest::living, 4);
}

TEST(Timeline, a_late_message_costs_little_more_than_those_after_it) {
  Timeline<Digest> timeline(Digest(), 100'000);
  for (int i = 0; i < 5000; ++i) {
    timeline.on(page(10 * i, 1.0), kNoSink);
  }
  for (const int followers : {1, 10, 100, 1000, 10}) {  // cheap again after a very late one
    Digest::count = 0;
    timeline.on(page(10 * (5000 - followers) - 5, 2.0), kNoSink);
    EXPECT_LE(Digest::count, followers + 1 + 10 + 16);  // 10: late ones of earlier rounds, at most
  }
}

}  // namespace
}  // namespace locfuse::test_timeline_history
