// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

/// Poses of a localizer that goes by the odometry that the filter goes by.
namespace locfuse::test_pose_ekf_localizer {
namespace {

constexpr int kDrives = 100;
constexpr double kDriven_s = 60.0;
constexpr Stamp kEvery = 500'000'000;

struct Compared {
  double fused = 0.0;      ///< mean square of the position [m^2]
  double localizer = 0.0;  ///< the same of the localizer alone
  double others = 0.0;     ///< the same of the filter without it
  double nees = 0.0;       ///< of 3, of the fused pose
};

PoseEkf::Config settings(bool stays) {
  PoseEkf::Config config;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.range.sigma_m = 0.1;
  config.correlation_s = stays ? PoseEkf::Config{}.correlation_s : 0.0;
  config.pose.shares_odometry = true;
  return config;
}

/// A localizer has odometry and two anchors, and gives its pose twice a second to a filter that has
/// the same odometry and, if `has_ranges`, the two others.
Compared compare(bool stays, bool has_ranges) {
  Compared mean;
  for (std::uint64_t seed = 1; seed <= kDrives; ++seed) {
    const testing::Simulation run = testing::simulate(seed, kDriven_s);
    const PoseEkf fresh(settings(stays), {testing::hall(), testing::one_tag()}, run.start);
    PoseEkf localizer(settings(false), {testing::hall(), testing::one_tag()}, run.start);
    PoseEkf alone = fresh;
    PoseEkf fused = fresh;
    Stamp next = kEvery;
    for (const Message& message : run.messages) {
      const Range* z = std::get_if<Range>(&message);
      const bool is_of_localizer = z != nullptr && z->anchor < 2;
      if (z == nullptr || is_of_localizer) {
        localizer.on(message);
      }
      if (z == nullptr || (!is_of_localizer && has_ranges)) {
        alone.on(message);
        fused.on(message);
      }
      if (z != nullptr && z->anchor == 1 && z->stamp >= next) {  // all that it has of an instant
        const PoseEstimate now = localizer.current();
        fused.on(PoseObservation{now.stamp, now.pose, now.covariance});
        next += kEvery;
      }
    }
    const Pose2 truth{run.x, run.y, wrap_angle(run.heading)};
    const auto square = [&](const PoseEkf& ekf) {
      return local(truth, ekf.estimate().pose).head<2>().squaredNorm() / kDrives;
    };
    mean.fused += square(fused);
    mean.localizer += square(localizer);
    mean.others += square(alone);
    const PoseEstimate end = fused.estimate();
    const Vector<3> error = local(truth, end.pose);
    mean.nees += error.dot(end.covariance.llt().solve(error)) / kDrives;
  }
  return mean;
}

TEST(PoseEkfLocalizer, is_as_good_and_as_honest_as_the_localizer) {
  const Compared with = compare(true, false);
  EXPECT_LT(std::sqrt(with.fused / with.localizer), 1.02);
  EXPECT_GT(with.nees, 2.0);
  EXPECT_LT(with.nees, 4.0);
  const Compared without = compare(false, false);  // counted as independent
  EXPECT_GT(std::sqrt(without.fused / without.localizer), 1.1);
}

TEST(PoseEkfLocalizer, is_no_worse_than_the_better_part_where_there_are_other_sensors) {
  const Compared with = compare(true, true);
  EXPECT_LT(std::sqrt(with.fused / std::min(with.localizer, with.others)), 1.02);
  EXPECT_GT(with.nees, 2.0);
  EXPECT_LT(with.nees, 4.0);
}

TEST(PoseEkfLocalizer, gates_what_is_elsewhere_and_changes_nothing_then) {
  const testing::Simulation run = testing::simulate(1, 5.0);
  PoseEkf ekf(settings(true), {testing::hall(), testing::one_tag()}, run.start);
  for (const Message& message : run.messages) {
    ekf.on(message);
  }
  const PoseEkf before = ekf;
  PoseEstimate there = ekf.current();
  there.stamp += kEvery;
  there.pose.x += 5.0;
  const Matrix<3, 3> covariance = 0.01 * Matrix<3, 3>::Identity();
  const Outcome outcome = ekf.on(PoseObservation{there.stamp, there.pose, covariance});
  EXPECT_EQ(outcome.verdict, Verdict::kGated);
  EXPECT_GT(outcome.nis, outcome.limit);
  EXPECT_EQ(ekf.current().pose.x, before.current().pose.x);
  EXPECT_TRUE(testing::same_bits(ekf.current().covariance, before.current().covariance));
}

TEST(PoseEkfLocalizer, the_first_pose_is_fused_as_an_independent_one) {
  const testing::Simulation run = testing::simulate(2, 5.0);
  PoseEkf first(settings(true), {testing::hall(), testing::one_tag()}, run.start);
  PoseEkf independent(settings(false), {testing::hall(), testing::one_tag()}, run.start);
  for (const double heading : {0.01, 1e6}) {  // as drivers say that an axis is not measured
    const Matrix<3, 3> covariance = Vector<3>(0.01, 0.01, heading).asDiagonal();
    const PoseObservation z{run.start.stamp + kEvery, run.start.pose, covariance};
    PoseEkf a = first;
    PoseEkf b = independent;
    EXPECT_EQ(a.on(z).nis, b.on(z).nis);
    EXPECT_TRUE(testing::same_bits(a.current().covariance, b.current().covariance));
  }
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_localizer
