// SPDX-License-Identifier: Apache-2.0
#include <thread>

#include "locfuse/particles/mcl.hpp"
#include "locfuse/replay/replay.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"
#include "support/simulation.hpp"

/// State shared by threads. `./dev tsan` runs these under ThreadSanitizer.
namespace locfuse {
namespace {

using testing::kSecond;
using testing::Rng;

struct Drive {
  testing::Room room;
  Pose2 start;
  std::vector<Velocity> odometry;
  std::vector<LaserScan> scans;
};

Drive drive() {
  Rng rng(4);
  Drive run{testing::random_room(rng), {}, {}, {}};
  run.start = run.room.middle;
  Pose2 pose = run.start;
  for (int i = 1; i <= 6; ++i) {
    run.odometry.push_back({i * kSecond / 2, 0.4, 0.2});
    run.scans.push_back(
        testing::scan_from(run.room.walls, pose, rng, 0.02, testing::laser(90), 90));
    run.scans.back().stamp = i * kSecond / 2;
    pose = pose * arc(0.2, 0.0, 0.1);
  }
  return run;
}

Mcl particles(const Drive& run, int threads) {
  Mcl::Config config;
  config.min_particles = config.max_particles = 2000;
  config.scouts = 16;
  config.scout_draws = 2000;
  config.threads = threads;
  Mcl mcl(config, testing::on_map(run.room.map), 0);
  mcl.start_at({{{0, run.start, Vector<3>(0.04, 0.04, 0.01).asDiagonal()}, 1.0}});
  return mcl;
}

Mcl driven(Mcl mcl, const Drive& run) {
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    mcl.on(run.odometry[i]);
    mcl.on(run.scans[i]);
  }
  return mcl;
}

void expect_same_particles(const Mcl& a, const Mcl& b) {
  EXPECT_EQ(a.belief().x, b.belief().x);
  EXPECT_EQ(a.belief().y, b.belief().y);
  EXPECT_EQ(a.belief().c, b.belief().c);
  EXPECT_EQ(a.belief().weight, b.belief().weight);
}

TEST(Threads, particles_are_the_same_bits_on_one_two_and_four) {
  const Drive run = drive();
  const Mcl alone = driven(particles(run, 1), run);
  for (const int threads : {2, 4}) {
    expect_same_particles(driven(particles(run, threads), run), alone);
  }
}

TEST(Threads, snapshots_that_share_workers_run_concurrently) {
  const Drive run = drive();
  const Mcl start = particles(run, 2);
  std::vector<Mcl> snapshots(3, start);
  std::vector<std::thread> drivers;
  drivers.reserve(snapshots.size());
  for (Mcl& snapshot : snapshots) {
    drivers.emplace_back([&] { snapshot = driven(snapshot, run); });
  }
  for (std::thread& driver : drivers) {
    driver.join();
  }
  const Mcl alone = driven(start, run);
  for (const Mcl& snapshot : snapshots) {
    expect_same_particles(snapshot, alone);
  }
}

TEST(Threads, replay_one_log_from_one_start_concurrently) {
  const testing::Simulation run = testing::simulate(3, 20.0);
  MessageLog log;
  Stamp delay = 0;
  for (const Message& message : run.messages) {
    delay = (delay + 37'000'000) % 100'000'000;  // some messages are late
    log.add(message, effective_stamp(message) + delay);
  }
  log.sort();
  const PoseEkf start({}, {testing::hall(), testing::one_tag()}, run.start);
  const RunLog alone = replay(start, log, {});
  std::vector<RunLog> runs(4);
  std::vector<std::thread> replays;
  replays.reserve(runs.size());
  for (RunLog& one : runs) {
    replays.emplace_back([&] { one = replay(start, log, {}); });
  }
  for (std::thread& one : replays) {
    one.join();
  }
  for (const RunLog& one : runs) {
    EXPECT_EQ(one.last.stamp, alone.last.stamp);
    EXPECT_TRUE(testing::same_bits(one.last.covariance, alone.last.covariance));
    EXPECT_EQ(one.estimates.size(), alone.estimates.size());
  }
}

}  // namespace
}  // namespace locfuse
