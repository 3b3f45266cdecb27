// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/estimators/pose_source.hpp"
#include "support/expect.hpp"
#include "support/simulation.hpp"

/// What is learnt of another localizer, and a filter that fuses its poses by that.
namespace locfuse::test_pose_source {
namespace {

constexpr double kEvery_s = 0.5;
constexpr Stamp kEvery = 500'000'000;
const Vector<3> kSigma(0.06, 0.06, 0.0175);

/// Errors that keep a share from each pose to the next.
class Errors {
 public:
  Errors(std::uint64_t seed, double kept) : rng_(seed), kept_(kept), now_(draw()) {}
  Vector<3> next() {
    now_ = kept_ * now_ + std::sqrt(1.0 - kept_ * kept_) * draw();
    return now_;
  }

 private:
  Vector<3> draw() {
    Vector<3> drawn;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      drawn(axis) = normal(rng_, kSigma(axis));
    }
    return drawn;
  }
  testing::Rng rng_;
  double kept_;
  Vector<3> now_;
  static double normal(testing::Rng& rng, double sigma) { return testing::normal(rng, sigma); }
};

Matrix<3, 3> reported(double share = 1.0) {
  return (share * kSigma).array().square().matrix().asDiagonal();
}

/// After poses beside a place that is known to 2 cm and a third of a degree.
PoseSource after(int poses, std::uint64_t seed, double kept, const Vector<3>& offset,
                 double share = 1.0, double delay_s = 0.0) {
  PoseSource source;
  Errors errors(seed, kept);
  Vector<3> place = Vector<3>::Zero();
  for (int k = 0; k < poses; ++k) {
    // Straight on for 5 s, turning for 5 s.
    const Vector<3> rate = k / 10 % 2 == 0 ? Vector<3>(0.5, 0.0, 0.0) : Vector<3>(0.0, 0.0, 0.5);
    place += kEvery_s * rate;
    place.z() = wrap_angle(place.z());
    PoseSource::Compared z{k * kEvery,
                           errors.next() + offset - delay_s * rate,
                           rate,
                           source.changed(k * kEvery, place, rate),
                           Vector<3>(4e-4, 4e-4, 3e-5).asDiagonal(),
                           reported(share)};
    source.take(z.stamp, {place.x() + z.off.x(), 0.0, 0.0}, {}, place);
    source.learn(z);
  }
  return source;
}

TEST(PoseSource, knows_nothing_before_it_has_seen_poses) {
  const PoseSource source;
  EXPECT_FALSE(source.is_white());
  EXPECT_EQ(source.position_factor(), 1.0);
  EXPECT_EQ(source.heading_factor(), 1.0);
  EXPECT_EQ(source.delay(), 0.0);
  EXPECT_NEAR(source.way_variance(Vector<3>::UnitX(), Vector<3>::Zero())(0, 0), 0.04, 1e-12);
}

TEST(PoseSource, tells_white_errors_from_those_that_stay) {
  int white = 0;
  int of_1_s = 0;
  int offset = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    white += after(200, seed, 0.0, Vector<3>::Zero()).is_white() ? 1 : 0;
    of_1_s += after(200, seed, std::exp(-kEvery_s), Vector<3>::Zero()).is_white() ? 1 : 0;
    offset += after(200, seed, 0.0, {0.2, 0.0, 0.0}).is_white() ? 1 : 0;
  }
  EXPECT_GE(white, 48);
  EXPECT_LE(of_1_s, 1);
  EXPECT_EQ(offset, 0);  // white, but about another place
}

TEST(PoseSource, finds_how_much_larger_errors_are_than_it_says) {
  double half = 0.0;
  double right = 0.0;
  constexpr int kSeeds = 50;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const PoseSource of_half = after(400, seed, 0.0, Vector<3>::Zero(), 0.5);
    half += 0.5 * (of_half.position_factor() + of_half.heading_factor()) / kSeeds;
    right += after(400, seed, 0.0, Vector<3>::Zero()).position_factor() / kSeeds;
  }
  EXPECT_NEAR(half, 4.0, 0.4);
  EXPECT_NEAR(right, 1.0, 0.15);
}

TEST(PoseSource, learns_how_late_stamps_are) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    EXPECT_NEAR(after(200, seed, 0.0, Vector<3>::Zero(), 1.0, 0.3).delay(), 0.3, 0.05) << seed;
    EXPECT_NEAR(after(200, seed, 0.9, {0.2, 0.1, 0.0}).delay(), 0.0, 0.05) << seed;
  }
}

TEST(PoseSource, a_pose_that_is_repeated_while_the_body_moves_is_frozen) {
  PoseSource source;
  const Pose2 z{1.0, 2.0, 0.5};
  EXPECT_FALSE(source.is_frozen(z, {}));
  source.take(0, z, {}, Vector<3>::Zero());
  EXPECT_FALSE(source.is_frozen(z, {0.05, 0.0, 0.0}));
  source.take(1, z, {0.08, 0.0, 0.0}, Vector<3>::Zero());  // it creeps
  EXPECT_TRUE(source.is_frozen(z, {0.12, 0.0, 0.0}));
  EXPECT_TRUE(source.is_frozen(z, {0.0, 0.0, 0.2}));
  EXPECT_FALSE(source.is_frozen({1.0, 2.0, 0.500001}, {0.12, 0.0, 0.0}));
}

struct Compared {
  double fused = 0.0;   ///< mean square of the position [m^2]
  double poses = 0.0;   ///< of the poses, as they come
  double others = 0.0;  ///< of the filter without them
  double nees = 0.0;    ///< of 3, of the fused pose
};

/// Poses twice a second beside wheels and ranges to four anchors, with errors that stay for so
/// long; the mean over drives of a minute.
Compared compare(double correlation_s, double lasts_s, double share = 1.0) {
  constexpr int kDrives = 60;
  PoseEkf::Config config;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.range.sigma_m = 0.1;
  config.correlation_s = correlation_s;
  Compared mean;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= kDrives; ++seed) {
    const testing::Simulation begin = testing::simulate(seed, 0.0);
    const testing::Simulation run = testing::simulate(seed, 60.0);
    PoseEkf fused(config, {testing::hall(), testing::one_tag()}, run.start);
    PoseEkf others = fused;
    Errors errors(seed + 1000, std::exp(-kEvery_s / lasts_s));
    Vector<3> truth(begin.x, begin.y, begin.heading);
    int driven = 0;
    for (const Message& message : run.messages) {
      fused.on(message);
      others.on(message);
      if (std::holds_alternative<Increment>(message)) {
        truth += Vector<3>(0.04 * std::cos(truth.z()), 0.04 * std::sin(truth.z()),
                           0.03 + 0.03 * std::sin(0.05 * driven));
        ++driven;
        if (driven % 10 != 0) {
          continue;
        }
        const Vector<3> error = errors.next();
        const Vector<3> z = truth + error;
        fused.on(PoseObservation{
            driven * kEvery / 10, {z.x(), z.y(), wrap_angle(z.z())}, reported(share)});
        if (driven > 200) {
          const PoseEstimate now = fused.current();
          const Pose2 at{truth.x(), truth.y(), wrap_angle(truth.z())};
          const Vector<3> off = local(at, now.pose);
          mean.fused += off.head<2>().squaredNorm();
          mean.poses += error.head<2>().squaredNorm();
          mean.others += local(at, others.estimate(now.stamp).pose).head<2>().squaredNorm();
          mean.nees += off.dot(now.covariance.llt().solve(off));
          ++count;
        }
      }
    }
  }
  mean.nees /= count;
  return mean;
}

TEST(PoseSource, poses_whose_errors_stay_make_a_filter_no_worse_and_no_surer) {
  const Compared with = compare(10.0, 10.0);
  EXPECT_LT(std::sqrt(with.fused / std::min(with.poses, with.others)), 1.02);
  EXPECT_GT(with.nees, 1.8);
  EXPECT_LT(with.nees, 4.0);
  const Compared as_independent = compare(0.0, 10.0);
  EXPECT_GT(std::sqrt(as_independent.fused / std::min(with.poses, with.others)), 1.02);
  EXPECT_GT(as_independent.nees, 4.0);
}

TEST(PoseSource, a_pose_that_is_not_fused_changes_nothing_that_is_estimated) {
  const testing::Simulation run = testing::simulate(1, 5.0);
  PoseEkf ekf(PoseEkf::Config{}, {testing::hall(), testing::one_tag()}, run.start);
  const auto pose_at = [&](const Pose2& pose, Stamp later) {
    return PoseObservation{ekf.belief().stamp + later, pose, reported()};
  };
  for (const Message& message : run.messages) {
    ekf.on(message);
  }
  ASSERT_EQ(ekf.on(pose_at(ekf.pose(), 0)).verdict, Verdict::kFused);
  PoseEkf without = ekf;
  ASSERT_EQ(ekf.on(pose_at({100.0, 0.0, 0.0}, kEvery)).verdict, Verdict::kGated);
  EXPECT_EQ(ekf.belief().stamp, without.belief().stamp);
  for (PoseEkf* each : {&ekf, &without}) {
    const Stamp now = each->belief().stamp;
    each->on(Velocity{now + 1, 0.3, 0.0, 0.1});
    each->on(testing::range_to(0, {2.0, 2.0, 0.0}, now + 2 * kEvery));
    each->on(PoseObservation{now + 3 * kEvery, each->pose(), reported()});
  }
  EXPECT_EQ(ekf.pose().x, without.pose().x);
  EXPECT_TRUE(testing::same_bits(ekf.current().covariance, without.current().covariance));
}

TEST(PoseSource, a_filter_that_was_led_astray_comes_back_when_errors_would_have_gone) {
  PoseEkf::Config config;
  const PoseEstimate start{0, {}, 4.0 * Matrix<3, 3>::Identity()};
  PoseEkf ekf(config, {}, start);
  Stamp now = 0;
  int gated = 0;
  for (int k = 1; k <= 60; ++k) {
    now = k * kEvery;
    ekf.on(Increment{now - kEvery, now, {1e-3 * k, 0.0, 0.0}});
    const double jump = k > 20 ? 1.5 : 0.0;  // for good
    const Pose2 z{0.5e-3 * k * (k + 1) + jump, 0.0, 0.0};
    gated += ekf.on(PoseObservation{now, z, reported()}).verdict == Verdict::kGated ? 1 : 0;
  }
  EXPECT_GT(gated, 10);
  EXPECT_LT(gated, 25);
  EXPECT_NEAR(ekf.pose().x, 0.5e-3 * 60 * 61 + 1.5, 0.1);
}

}  // namespace
}  // namespace locfuse::test_pose_source
