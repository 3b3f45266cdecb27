// SPDX-License-Identifier: Apache-2.0
#include "support/endless_drive.hpp"
#include "support/expect.hpp"

/// One hour of the drive that `./dev soak` runs for a day.
namespace locfuse::test_soak {
namespace {

using testing::EndlessDrive;
using testing::kSecond;

struct Soaked {
  std::size_t early = 0;  // maximum of bytes held in the first half
  std::size_t late = 0;   // and in the second
  std::size_t messages = 0;
  std::size_t stale = 0;
  double worst = 0.0;  // position error at the end of a minute where there is aid [m]
  int restarts = 0;
};

Soaked soak(Stamp history, double seconds) {
  EndlessDrive drive(1, 600.0);
  auto timeline = testing::endless_timeline(history);
  const std::size_t before = testing::held_bytes();
  Soaked run;
  const auto sink = [&](std::size_t, const Outcome& outcome) {
    run.stale += outcome.verdict == Verdict::kStale ? 1 : 0;
  };
  for (int step = 1; drive.seconds() < seconds; ++step) {
    drive.step([&](const Message& message) {
      ++run.messages;
      timeline.on(message, sink);
    });
    if (step % 100 == 0 && drive.is_known()) {  // relocalizing needs memory of its own
      std::size_t& most = drive.seconds() <= 0.5 * seconds ? run.early : run.late;
      most = std::max(most, testing::held_bytes() - before);
    }
    if (step % 6000 == 0 && drive.is_known()) {
      const Pose2 here = timeline.estimator().estimate().pose;
      run.worst = std::max(run.worst, (here.position() - drive.truth().position()).norm());
    }
  }
  run.restarts = timeline.estimator().restarts();
  return run;
}

TEST(Soak, memory_stays_flat_for_an_hour_and_the_pose_stays_right) {
  const Soaked run = soak(kSecond, 3600.0);
  EXPECT_GT(run.messages, 480'000U);
  EXPECT_GT(run.stale, 100U);
  EXPECT_GE(run.restarts, 4);
  EXPECT_LT(run.worst, 0.3);
  EXPECT_LE(run.late, run.early + 65'536) << "but for what buffers grow by at their fullest";
}

TEST(Soak, an_unbounded_history_is_detected) {
  const Soaked run = soak(7200 * kSecond, 40.0);
  EXPECT_GT(run.late, run.early + 100'000);
}

}  // namespace
}  // namespace locfuse::test_soak
