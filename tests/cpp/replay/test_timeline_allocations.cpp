// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/replay/timeline.hpp"
#include "support/allocation_counter.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse {
namespace {

TEST(Timeline, allocates_nothing_per_message_in_order_once_the_history_has_filled) {
  const testing::Simulation run = testing::simulate(1, 600.0);
  Timeline<PoseEkf> timeline({{}, {testing::hall(), testing::one_tag()}, run.start},
                             2 * testing::kSecond);
  std::size_t fused = 0;
  const auto sink = [&](std::size_t, const Outcome& o) {
    fused += o.verdict == Verdict::kFused ? 1 : 0;
  };
  const std::size_t warm = 2000;
  ASSERT_GT(run.messages.size(), 10 * warm);
  for (std::size_t i = 0; i < warm; ++i) {
    timeline.on(run.messages[i], sink);
  }
  const std::size_t before = testing::allocations();
  for (std::size_t i = warm; i < run.messages.size(); ++i) {
    timeline.on(run.messages[i], sink);
  }
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_GT(fused, run.messages.size() * 99 / 100);
}

TEST(Timeline, memory_stays_bounded_when_messages_come_late) {
  const testing::Simulation run = testing::simulate(2, 600.0);
  Timeline<PoseEkf> timeline({{}, {testing::hall(), testing::one_tag()}, run.start},
                             2 * testing::kSecond);
  const auto sink = [](std::size_t, const Outcome&) {};
  const std::size_t warm = 4000;
  std::size_t before = 0;
  for (std::size_t i = 0; i + 3 < run.messages.size(); i += 3) {
    if (i >= warm && before == 0) {
      before = testing::allocations();
    }
    for (const std::size_t j : {i + 1, i + 2, i}) {
      timeline.on(run.messages[j], sink);
    }
  }
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace locfuse
