// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/pose_ekf.hpp"
#include "support/allocation_counter.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

namespace locfuse {
namespace {

using testing::allocations;

TEST(AllocationCounter, sees_what_the_test_and_what_the_library_allocate) {
  const GaussianBelief belief = testing::ekf_at({}).belief();
  std::size_t before = allocations();
  const auto number = std::make_unique<int>(1);
  EXPECT_EQ(allocations(), before + 1) << *number;
  before = allocations();
  const GaussianBelief copy = belief;  // Eigen, in a header
  EXPECT_GT(allocations(), before) << copy.dimension();
  before = allocations();
  const Eigen::MatrixXd marginal = belief.marginal(belief.slot("body"));  // in the library
  EXPECT_GT(allocations(), before) << marginal.size();
}

TEST(PoseEkf, allocates_nothing_per_message) {
  testing::Simulation run = testing::simulate(1, 40.0);
  run.messages.push_back(Velocity{40 * testing::kSecond, 1.0, 0.1});
  ASSERT_GT(run.messages.size(), 1000U);
  PoseEkf ekf(PoseEkf::Config{}, {testing::hall(), testing::one_tag()}, run.start);
  const PositionFix fix{0, {0.0, 0.0}, 100.0 * Matrix<2, 2>::Identity()};
  const PoseObservation pose{0, {}, 100.0 * Matrix<3, 3>::Identity()};
  ekf.on(pose);  // from the first one on there is a belief without poses, too
  int fused = 0;
  const std::size_t before = allocations();
  for (const Message& message : run.messages) {
    fused += ekf.on(message).verdict == Verdict::kFused ? 1 : 0;
    PositionFix fix_now = fix;
    fix_now.stamp = ekf.belief().stamp;
    fused += ekf.on(fix_now).verdict == Verdict::kFused ? 1 : 0;
    PoseObservation pose_now = pose;
    pose_now.stamp = ekf.belief().stamp;
    pose_now.pose.x = 1e-9 * fused;  // the same to the last digit would be frozen
    fused += ekf.on(pose_now).verdict == Verdict::kFused ? 1 : 0;
  }
  EXPECT_EQ(allocations(), before);
  EXPECT_GT(fused, 2900);
}

TEST(PoseEkf, allocates_nothing_for_robust_updates) {
  const testing::Simulation run = testing::simulate(2, 20.0);
  for (const NoiseKind kind : {NoiseKind::kOneSided, NoiseKind::kStudentT}) {
    PoseEkf::Config config;
    config.range.noise = kind;
    config.position.noise = config.pose.noise = NoiseKind::kStudentT;
    PoseEkf ekf(config, {testing::hall(), testing::one_tag()}, run.start);
    const std::size_t before = allocations();
    for (const Message& message : run.messages) {
      ekf.on(message);
    }
    ekf.on(PositionFix{ekf.belief().stamp, {0.0, 0.0}, 100.0 * Matrix<2, 2>::Identity()});
    ekf.on(PoseObservation{ekf.belief().stamp, {}, 100.0 * Matrix<3, 3>::Identity()});
    EXPECT_EQ(allocations(), before);
  }
}

TEST(PoseEkf, rewinding_to_a_snapshot_allocates_nothing) {
  PoseEkf ekf = testing::ekf_at({});
  const PoseEkf snapshot = ekf;
  const Range z = testing::range_to(0, {}, testing::kSecond);
  const std::size_t before = allocations();
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(ekf.on(z).verdict, Verdict::kFused);
    ekf = snapshot;
  }
  EXPECT_EQ(allocations(), before);
  EXPECT_TRUE(testing::same_bits(ekf.belief(), snapshot.belief()));
}

TEST(PoseEkf, allocates_nothing_for_messages_that_are_not_fused) {
  PoseEkf ekf = testing::ekf_at({});
  const Range unknown{testing::kSecond, 0, 99, 5.0, {}};
  const Range far = testing::range_to(0, {}, testing::kSecond, 30.0);
  const Range stale = testing::range_to(0, {}, -1);
  const std::size_t before = allocations();
  for (int i = 0; i < 1000; ++i) {
    ASSERT_EQ(ekf.on(unknown).verdict, Verdict::kNotModelled);
    ASSERT_EQ(ekf.on(far).verdict, Verdict::kGated);
    ASSERT_EQ(ekf.on(stale).verdict, Verdict::kStale);
  }
  EXPECT_EQ(allocations(), before);
}

TEST(PoseEkf, allocates_nothing_for_a_joint_measurement) {
  PoseEkf ekf = testing::ekf_at({});
  std::vector<Range> epoch;
  for (int i = 0; i < PoseEkf::kMaxJoint; ++i) {
    epoch.push_back(testing::range_to(i % 4, {}, 0, 0.01));
  }
  const std::size_t before = allocations();
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(ekf.on_joint(epoch).verdict, Verdict::kFused);
  }
  EXPECT_EQ(allocations(), before);
}

}  // namespace
}  // namespace locfuse
