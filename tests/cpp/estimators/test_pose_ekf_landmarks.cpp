// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/recovery/initializer.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_pose_ekf_landmarks {
namespace {

using testing::in_band;
using testing::normal;
using testing::Rng;

constexpr Stamp kStep = 100'000'000;
const Pose2 kMount{0.3, -0.1, 0.5};

/// Four posts about a floor, and a fifth that makes it look different from everywhere.
const std::shared_ptr<const LandmarkMap>& posts() {
  static const auto map =
      std::make_shared<const LandmarkMap>(std::vector<Landmark>{{10, {4.0, 4.0}},
                                                                {11, {-4.0, 4.0}},
                                                                {12, {-4.0, -4.0}},
                                                                {13, {4.0, -4.0}},
                                                                {14, {1.0, 5.0}}});
  return map;
}

PoseEkf ekf_at(const PoseEstimate& start, const PoseEkf::Config& config) {
  return {config, {{}, {}, {posts(), kMount}}, start};
}

PoseEkf ekf_at(const Pose2& pose, const PoseEkf::Config& config = {}) {
  const Vector<3> sigma(0.1, 0.1, 0.05);
  return ekf_at({0, pose, sigma.cwiseAbs2().asDiagonal()}, config);
}

/// What the sensor would say, written out; the model is not asked.
RangeBearing sighting(const Pose2& body, const Landmark& post, Stamp stamp, bool named = true) {
  const double c = std::cos(body.heading);
  const double s = std::sin(body.heading);
  const double dx = post.position.x() - (body.x + 0.3 * c + 0.1 * s);
  const double dy = post.position.y() - (body.y + 0.3 * s - 0.1 * c);
  RangeBearing z{stamp, {}, std::hypot(dx, dy), std::atan2(dy, dx) - body.heading - 0.5, {}};
  if (named) {
    z.landmark = post.id;
  }
  return z;
}

struct Consistency {
  double nees = 0.0;
  double nis = 0.0;
  int sightings = 0;
};

enum class Parts { kBoth, kRange, kBearing };

/// 50 runs of ten seconds on a circle, with the noise that the filter believes in, times `factor`.
Consistency measure(Parts parts, double factor = 1.0) {
  constexpr int kRuns = 50;
  PoseEkf::Config config;
  config.correlation_s = 0.0;  // its errors are independent
  config.odometry = {0.02, 0.02, 0.02, 0.02, 0.0, 0.0};
  config.landmark = {0.05, 0.02};
  config.landmark.gate = 1.0;
  Consistency result;
  const OdometryMotion motion(config.odometry);
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    Rng rng(seed);
    const Vector<3> sigma(0.1, 0.1, 0.05);
    Pose2 body{2.0, 0.0, kPi / 2.0};
    PoseEkf ekf = ekf_at({0, body, sigma.cwiseAbs2().asDiagonal()}, config);
    body = retract(body, {normal(rng, 0.1), normal(rng, 0.1), normal(rng, 0.05)});
    for (int i = 0; i < 100; ++i) {
      const Pose2 odometry = arc(0.05, 0.0, 0.025);
      const Matrix<3, 3> Q = motion.propagate({}, odometry, 0.1).noise;
      const Vector<3> off =
          Q.llt().matrixL() * Vector<3>{normal(rng, 1.0), normal(rng, 1.0), normal(rng, 1.0)};
      body = body * retract(odometry, off);
      ekf.on(Increment{i * kStep, (i + 1) * kStep, odometry});
      for (const Landmark& post : posts()->landmarks()) {
        RangeBearing z = sighting(body, post, (i + 1) * kStep);
        *z.range += factor * normal(rng, 0.05);
        *z.bearing += factor * normal(rng, 0.02);
        if (parts == Parts::kRange) {
          z.bearing.reset();
        } else if (parts == Parts::kBearing) {
          z.range.reset();
        }
        const Outcome outcome = ekf.on(z);
        result.nis += outcome.nis / outcome.dof;
        ++result.sightings;
      }
    }
    const PoseEstimate end = ekf.estimate();
    const Vector<3> error = local(body, end.pose);
    result.nees += error.dot(end.covariance.llt().solve(error)) / kRuns;
  }
  result.nis /= result.sightings;
  return result;
}

TEST(PoseEkf, on_landmarks_errors_are_as_large_as_it_believes) {
  for (const Parts parts : {Parts::kBoth, Parts::kRange, Parts::kBearing}) {
    const Consistency result = measure(parts);
    EXPECT_EQ(result.sightings, 50 * 500);
    EXPECT_TRUE(in_band(result.nees, 3, 50)) << result.nees;
    EXPECT_NEAR(result.nis, 1.0, 0.03);
  }
}

TEST(PoseEkf, on_landmarks_observed_thrice_as_badly_as_reported_shows) {
  const Consistency result = measure(Parts::kBoth, 3.0);
  EXPECT_FALSE(in_band(result.nees, 3, 50)) << result.nees;
  EXPECT_GT(result.nis, 5.0);
}

/// What a belief knows of a turn of the body about a point of the world, 1 / rad^2.
double information_of_turn(const PoseEkf& ekf, const Vector<2>& about) {
  const PoseEstimate now = ekf.current();
  const Vector<2> arm = now.pose.position() - about;
  const Vector<3> turn(-arm.y(), arm.x(), 1.0);
  return turn.dot(now.covariance.llt().solve(turn));
}

// One landmark leaves a turn about it open. A textbook EKF learns of it all the same, from
// sightings linearized here and there, and ends with a wrong heading and a small sigma: NEES 37 of
// 3 in the simulator of gadau2022.
TEST(PoseEkf, of_one_landmark_it_never_learns_how_the_world_is_turned) {
  const Landmark& post = posts()->landmarks().front();
  const Pose2 truth{-1.0, 2.0, 0.4};
  for (const bool is_range_known : {true, false}) {
    const Vector<3> sigma(2.0, 2.0, 1.0);
    PoseEkf::Config config;
    config.landmark.gate = 1.0;
    PoseEkf ekf = ekf_at({0, {0.5, 0.8, 1.4}, sigma.cwiseAbs2().asDiagonal()}, config);
    const double at_first = information_of_turn(ekf, post.position);
    Rng rng(3);
    for (int i = 0; i < 200; ++i) {
      RangeBearing z = sighting(truth, post, 0);
      *z.range += normal(rng, 0.05);
      *z.bearing += normal(rng, 0.02);
      if (!is_range_known) {
        z.range.reset();
      }
      EXPECT_EQ(ekf.on(z).verdict, Verdict::kFused);
      EXPECT_NEAR(information_of_turn(ekf, post.position), at_first, 1e-5 * at_first);
    }
  }
}

TEST(PoseEkf, a_sighting_without_a_name_is_of_the_nearest_landmark) {
  const Pose2 body{0.5, -0.3, 0.2};
  PoseEkf named = ekf_at({0.4, -0.2, 0.22});
  PoseEkf unnamed = named;
  for (const Landmark& post : posts()->landmarks()) {
    EXPECT_EQ(named.on(sighting(body, post, kStep)).verdict, Verdict::kFused);
    EXPECT_EQ(unnamed.on(sighting(body, post, kStep, false)).verdict, Verdict::kFused);
  }
  EXPECT_TRUE(testing::same_bits(named.belief(), unnamed.belief()));
}

TEST(PoseEkf, sightings_together_tell_where_each_alone_is_of_the_wrong_landmark) {
  // Turned by 0.5 rad against its belief, with posts in a ring of 12: each is nearest to the next.
  std::vector<Landmark> ring;
  for (int k = 0; k < 12; ++k) {
    ring.push_back({k, 5.0 * Vector<2>(std::cos(k * kPi / 6.0), std::sin(k * kPi / 6.0))});
  }
  ring.push_back({12, {2.0, 1.0}});  // the one that decides
  const auto map = std::make_shared<const LandmarkMap>(ring);
  const Vector<3> sigma(0.05, 0.05, 0.5);
  const Pose2 body{0.0, 0.0, 0.35};
  const PoseEkf start({}, {{}, {}, {map, kMount}}, {0, {}, sigma.cwiseAbs2().asDiagonal()});
  std::vector<RangeBearing> sightings;
  for (const Landmark& post : ring) {
    sightings.push_back(sighting(body, post, 0, false));
  }
  PoseEkf joint = start;
  for (const Outcome& outcome : joint.on_joint(sightings)) {
    EXPECT_EQ(outcome.verdict, Verdict::kFused);
  }
  EXPECT_NEAR(joint.pose().heading, 0.35, 0.02);
  PoseEkf alone = start;
  alone.on_joint(sightings, Association::kNearest);
  EXPECT_GT(std::abs(alone.pose().heading - 0.35), 0.1);
}

TEST(PoseEkf, what_fits_no_landmark_changes_nothing) {
  const Pose2 body{0.5, -0.3, 0.2};
  PoseEkf ekf = ekf_at(body);
  const GaussianBelief before = ekf.belief();
  RangeBearing wrong = sighting(body, posts()->landmarks()[0], kStep, false);
  *wrong.range = 1.0;
  EXPECT_EQ(ekf.on(wrong).verdict, Verdict::kGated);
  EXPECT_EQ(ekf.on_joint({wrong}).front().verdict, Verdict::kGated);
  RangeBearing stranger = sighting(body, posts()->landmarks()[0], kStep);
  stranger.landmark = 99;
  EXPECT_EQ(ekf.on(stranger).verdict, Verdict::kNotModelled);
  EXPECT_EQ(ekf.on_joint({stranger}).front().verdict, Verdict::kNotModelled);
  RangeBearing early = sighting(body, posts()->landmarks()[0], -kStep, false);
  EXPECT_EQ(ekf.on(early).verdict, Verdict::kStale);
  EXPECT_EQ(ekf.on_joint({early}).front().verdict, Verdict::kStale);
  EXPECT_TRUE(ekf.on_joint(std::vector<RangeBearing>{}).empty());
  EXPECT_TRUE(testing::same_bits(ekf.belief(), before));
}

TEST(PoseEkf, without_a_map_of_landmarks_a_sighting_is_not_modelled) {
  PoseEkf ekf({}, {}, {0, {}, Matrix<3, 3>::Identity()});
  const RangeBearing z = sighting({}, posts()->landmarks()[0], 0, false);
  EXPECT_EQ(ekf.on(z).verdict, Verdict::kNotModelled);
  EXPECT_EQ(ekf.on_joint({z}).front().verdict, Verdict::kNotModelled);
}

TEST(PoseEkf, refuses_sightings_that_are_none) {
  PoseEkf ekf = ekf_at({});
  testing::expect_refused([&] { ekf.on(RangeBearing{0, 10, {}, {}, {}}); }, "neither");
  testing::expect_refused([&] { ekf.on(RangeBearing{0, 10, -1.0, {}, {}}); }, "range", "-1");
  testing::expect_refused([&] { ekf.on(RangeBearing{0, 10, 1.0, std::nan(""), {}}); }, "bearing");
  testing::expect_refused(
      [&] {
        ekf.on(RangeBearing{0, 10, 1.0, 0.0, Matrix<2, 2>::Zero()});
      },
      "covariance");
  RangeBearing in_space{0, 10, 1.0, 0.0, {}};  // whose range is none of the plane
  in_space.elevation = 0.2;
  testing::expect_refused([&] { ekf.on(in_space); }, "elevation", "0.2", "AirEkf");
  testing::expect_refused([&] { ekf.on_joint({in_space}); }, "elevation");
  const RangeBearing first{0, 10, 1.0, 0.0, {}};
  const RangeBearing later{kStep, 10, 1.0, 0.0, {}};
  testing::expect_refused([&] { ekf.on_joint({first, later}); }, "one stamp");
}

TEST(Initializer, sightings_choose_among_the_poses_that_fit) {
  const Pose2 body{0.5, -0.3, 0.2};
  Initializer initializer({}, {{}, {}, {posts(), kMount}});
  initializer.on(sighting(body, posts()->landmarks()[0], 0));  // before there is any pose
  initializer.on(PositionFix{0, body.position(), 0.04 * Matrix<2, 2>::Identity()});
  EXPECT_NE(initializer.state().status, StartStatus::kReady);
  for (const Landmark& post : posts()->landmarks()) {
    initializer.on(sighting(body, post, 0));
  }
  const Initializer::State state = initializer.state();
  ASSERT_EQ(state.status, StartStatus::kReady) << state.reason;
  EXPECT_NEAR(state.hypotheses.front().estimate.pose.heading, body.heading, 0.1);
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_landmarks
