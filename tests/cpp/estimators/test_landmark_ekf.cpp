// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "locfuse/estimators/landmark_ekf.hpp"
#include "locfuse/filters/kalman.hpp"
#include "locfuse/replay/replay.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::test_landmark_ekf {
namespace {

using testing::expect_near;
using testing::expect_refused;
using testing::in_band;
using testing::kSecond;
using testing::normal;
using testing::Rng;
using testing::same_bits;

const Matrix<2, 2> kI2 = Matrix<2, 2>::Identity();
const Matrix<3, 3> kI3 = Matrix<3, 3>::Identity();
const Pose2 kMount{0.3, -0.1, 0.2};
const Pose2 kStart{1.0, 2.0, 0.5};

/// What a sensor at kMount sees of a place, without noise.
RangeBearing sight(const Pose2& body, const Vector<2>& place, Stamp stamp = 0) {
  const Vector<2> d = inverse(body * kMount).act(place);
  RangeBearing z;
  z.stamp = stamp;
  z.range = d.norm();
  z.bearing = std::atan2(d.y(), d.x());
  return z;
}

RangeBearing named(RangeBearing z, Id id) {
  z.landmark = id;
  return z;
}

LandmarkEkf::Config knowing(std::vector<KnownLandmark> known, LandmarkEkf::Config config = {}) {
  config.known = std::move(known);
  return config;
}

LandmarkEkf ekf_at(const Pose2& pose, const LandmarkEkf::Config& config = {},
                   const std::vector<KnownLandmark>& known = {}) {
  return {knowing(known, config), testing::sensor_at(kMount), {0, pose, 1e-4 * kI3}};
}

/// One that takes the errors of a landmark's sightings for independent.
LandmarkEkf averaging_ekf() {
  LandmarkEkf::Config config;
  config.correlation_s = 0.0;
  return ekf_at(kStart, config);
}

bool same(const LandmarkEkf& a, const LandmarkEkf& b) {
  const std::vector<LandmarkEstimate> first = a.landmarks();
  const std::vector<LandmarkEstimate> second = b.landmarks();
  bool equal = same_bits(a.belief(), b.belief()) && first.size() == second.size() &&
               a.estimate().stamp == b.estimate().stamp;
  for (std::size_t i = 0; equal && i < first.size(); ++i) {
    equal = first[i].id == second[i].id && first[i].sightings == second[i].sightings &&
            first[i].confirmed == second[i].confirmed;
  }
  return equal;
}

// ---------------------------------------------------------------- simulation

constexpr int kTrees = 12;
constexpr double kSigmaRange = 0.02;
constexpr double kSigmaBearing = 0.005;
constexpr double kSight = 5.0;  // [m]

/// Of simulated sensors, whose errors are independent.
LandmarkEkf::Config well_informed() {
  LandmarkEkf::Config config;
  config.odometry = {0.01, 0.005, 0.005, 0.005, 0.0, 0.0};
  config.landmark = {kSigmaRange, kSigmaBearing};
  config.landmark.gate = 1.0;
  config.gate_new = 1.0;
  config.correlation_s = 0.0;
  return config;
}

struct Loop {
  std::vector<std::vector<RangeBearing>> sightings;
  std::vector<Increment> motions;
  std::vector<Vector<2>> places;  // after each motion
  Vector<3> truth;
  PoseEstimate start;
};

Vector<2> tree(int k) {
  const double angle = 2.0 * kPi * k / kTrees;
  const double radius = k % 2 == 0 ? 6.0 : 2.5;
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

/// `turns` turns on a circle of 4 m among twelve trees. Written out in scalars.
Loop drive(std::uint64_t seed, double turns) {
  constexpr double kStep = 0.2;
  Rng rng(seed);
  Loop loop;
  loop.start = {0, {4.0, 0.0, kPi / 2.0}, 1e-4 * kI3};
  double x = 4.0 + normal(rng, 0.01);
  double y = normal(rng, 0.01);
  double heading = kPi / 2.0 + normal(rng, 0.01);
  const int steps = static_cast<int>(turns * 2.0 * kPi * 4.0 / kStep);
  for (int i = 0; i < steps; ++i) {
    const double turn = kStep / 4.0;
    x += kStep * std::cos(heading);
    y += kStep * std::sin(heading);
    heading += turn;
    const double root = std::sqrt(kStep);
    const double sigma_heading = std::sqrt(0.005 * 0.005 * kStep + 0.005 * 0.005 * turn);
    loop.motions.push_back({i * kSecond / 10,
                            (i + 1) * kSecond / 10,
                            {kStep + normal(rng, 0.01 * root), normal(rng, 0.005 * root),
                             turn + normal(rng, sigma_heading)}});
    loop.places.emplace_back(x, y);
    std::vector<RangeBearing> seen;
    for (int k = 0; i % 3 == 2 && k < kTrees; ++k) {
      const double dx = tree(k).x() - x - 0.3 * std::cos(heading) - 0.1 * std::sin(heading);
      const double dy = tree(k).y() - y - 0.3 * std::sin(heading) + 0.1 * std::cos(heading);
      if (std::hypot(dx, dy) > kSight) {
        continue;
      }
      RangeBearing z;
      z.stamp = (i + 1) * kSecond / 10;
      z.landmark = k;
      z.range = std::hypot(dx, dy) + normal(rng, kSigmaRange);
      z.bearing = wrap_angle(std::atan2(dy, dx) - heading - 0.2 + normal(rng, kSigmaBearing));
      seen.push_back(z);
    }
    loop.sightings.push_back(seen);
  }
  loop.truth = {x, y, wrap_angle(heading)};
  return loop;
}

double squared(const Eigen::VectorXd& error, const Eigen::MatrixXd& P) {
  return error.dot(P.llt().solve(error));
}

double pose_nees(const GaussianBelief& belief, const Vector<3>& truth) {
  Vector<3> error = belief.x.head<3>() - truth;
  error(2) = wrap_angle(error(2));
  return squared(error, belief.P.topLeftCorner(3, 3));
}

constexpr int kRuns = 300;

TEST(LandmarkEkf, errors_of_pose_and_landmarks_are_as_large_as_it_believes) {
  double pose = 0.0;
  double map = 0.0;
  double nis = 0.0;
  int rows = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const Loop loop = drive(seed, 1.3);
    LandmarkEkf ekf(well_informed(), testing::sensor_at(kMount), loop.start);
    for (std::size_t i = 0; i < loop.motions.size(); ++i) {
      ekf.on(loop.motions[i]);
      for (const Outcome& outcome : ekf.on_joint(loop.sightings[i])) {
        ASSERT_EQ(outcome.verdict, Verdict::kFused);
        nis += outcome.dof > 0 ? outcome.nis : 0.0;
        rows += outcome.dof;
      }
    }
    ekf.advance_to(ekf.estimate().stamp);
    const std::vector<LandmarkEstimate> landmarks = ekf.landmarks();
    ASSERT_EQ(landmarks.size(), static_cast<std::size_t>(kTrees));
    Eigen::VectorXd error(2 * kTrees);
    for (int k = 0; k < kTrees; ++k) {
      const LandmarkEstimate& landmark = landmarks[static_cast<std::size_t>(k)];
      error.segment<2>(2 * k) = landmark.position - tree(landmark.id);
    }
    pose += pose_nees(ekf.belief(), loop.truth) / kRuns;
    map += squared(error, ekf.belief().P.bottomRightCorner(2 * kTrees, 2 * kTrees)) / kRuns;
  }
  EXPECT_TRUE(in_band(pose, 3, kRuns)) << pose;
  EXPECT_TRUE(in_band(map, 2 * kTrees, kRuns)) << map;
  EXPECT_TRUE(in_band(nis / rows, 1, rows)) << nis / rows;
}

/// The same recipe by hand, with landmarks put in as if they were independent of the pose.
double nees_without_cross_covariance(std::uint64_t seed, bool with_it) {
  const Loop loop = drive(seed, 1.3);
  const LandmarkEkf::Config config = well_informed();
  const OdometryMotion motion(config.odometry);
  const RangeBearingModel model(config.landmark, kMount);
  GaussianBelief belief = GaussianBelief::of_pose(0, loop.start.pose, loop.start.covariance);
  const Slot body = belief.slot("body");
  std::vector<std::optional<Slot>> slots(kTrees);
  for (std::size_t i = 0; i < loop.motions.size(); ++i) {
    predict(belief, motion.propagate(belief.pose(body), loop.motions[i].motion, 0.1), body);
    for (const RangeBearing& z : loop.sightings[i]) {
      std::optional<Slot>& slot = slots[static_cast<std::size_t>(*z.landmark)];
      if (slot) {
        const auto lin =
            model.linearize_with_landmark(belief.pose(body), belief.mean(*slot), z).value();
        update(belief, lin, std::vector<Slot>{body, *slot}, Gate());
        continue;
      }
      const RangeBearingModel::Placed placed = model.place(belief.pose(body), z).value();
      const Matrix<2, 2> noise =
          placed.by_observation * model.noise(z) * placed.by_observation.transpose();
      const std::string name = std::to_string(*z.landmark);
      const Matrix<2, 2> own =
          placed.by_pose * belief.marginal(body) * placed.by_pose.transpose() + noise;
      slot = with_it ? augment(belief, name, SlotKind::kPoint2, placed.position, placed.by_pose,
                               noise, body)
                     : belief.add(name, SlotKind::kPoint2, placed.position,
                                  0.5 * (own + own.transpose()));
    }
  }
  return pose_nees(belief, loop.truth);
}

TEST(LandmarkEkf, leaving_the_cross_covariance_out_shows) {
  double right = 0.0;
  double wrong = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    right += nees_without_cross_covariance(seed, true) / kRuns;
    wrong += nees_without_cross_covariance(seed, false) / kRuns;
  }
  EXPECT_TRUE(in_band(right, 3, kRuns)) << right;
  EXPECT_FALSE(in_band(wrong, 3, kRuns)) << wrong;
}

/// Drives it along a loop; `check` looks after every instant.
template <class Check>
void follow(LandmarkEkf& ekf, const Loop& loop, const Check& check) {
  for (std::size_t i = 0; i < loop.motions.size(); ++i) {
    ekf.on(loop.motions[i]);
    ekf.on_joint(loop.sightings[i]);
    check(ekf.belief());
  }
}

/// The same loop with a heading at the start that is drawn, and known no better than that.
Loop drive_with_vague_north(std::uint64_t seed, double sigma, std::uint64_t of_heading) {
  Loop loop = drive(seed, 1.3);
  Rng rng(seed + of_heading);
  loop.start.covariance(2, 2) += sigma * sigma;
  loop.start.pose.heading += normal(rng, sigma);
  return loop;
}

TEST(LandmarkEkf, no_sighting_says_where_north_is) {
  constexpr double kSigma = 0.2;  // [rad], with which a standard EKF thinks that it learns north
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Loop loop = drive(seed, 2.3);
    loop.start.covariance(2, 2) = kSigma * kSigma;
    loop.start.pose.heading += kSigma;
    LandmarkEkf ekf(well_informed(), testing::sensor_at(kMount), loop.start);
    follow(ekf, loop, [&](const GaussianBelief& belief) {
      ASSERT_GE(belief.P(2, 2), kSigma * kSigma * (1.0 - 1e-9));
    });
    EXPECT_EQ(ekf.landmarks().size(), static_cast<std::size_t>(kTrees));
    // What wheels lose of it is found again where the loop closes.
    EXPECT_LT(ekf.belief().P(2, 2), kSigma * kSigma + 0.01 * 0.01);
  }
}

TEST(LandmarkEkf, a_vague_heading_at_the_start_leaves_it_honest) {
  constexpr double kSigma = 0.1;  // [rad]
  double heading = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const Loop loop = drive_with_vague_north(seed, kSigma, 10'000);
    LandmarkEkf ekf(well_informed(), testing::sensor_at(kMount), loop.start);
    follow(ekf, loop, [](const GaussianBelief&) {});
    ekf.advance_to(ekf.estimate().stamp);
    const double off = wrap_angle(ekf.pose().heading - loop.truth(2));
    heading += off * off / ekf.belief().P(2, 2) / kRuns;
  }
  EXPECT_TRUE(in_band(heading, 1, kRuns)) << heading;
}

TEST(LandmarkEkf, positions_turn_a_map_whose_north_was_vague) {
  constexpr double kSigmaNorth = 0.2;  // [rad]
  constexpr double kSigmaFix = 0.3;    // [m]
  double pose = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const Loop loop = drive_with_vague_north(seed, kSigmaNorth, 30'000);
    Rng rng(seed + 40'000);  // of fixes
    LandmarkEkf::Config config = well_informed();
    config.position.gate = 1.0;
    LandmarkEkf ekf(config, testing::sensor_at(kMount), loop.start);
    for (std::size_t i = 0; i < loop.motions.size(); ++i) {
      ekf.on(loop.motions[i]);
      if (i % 10 == 9) {
        const Vector<2> off(normal(rng, kSigmaFix), normal(rng, kSigmaFix));
        ekf.on(
            PositionFix{loop.motions[i].stamp, loop.places[i] + off, kSigmaFix * kSigmaFix * kI2});
      }
      ekf.on_joint(loop.sightings[i]);
    }
    ekf.advance_to(ekf.estimate().stamp);
    pose += pose_nees(ekf.belief(), loop.truth) / kRuns;
  }
  EXPECT_TRUE(in_band(pose, 3, kRuns)) << pose;
}

TEST(LandmarkEkf, is_honest_where_each_landmark_is_seen_too_near_or_too_far) {
  constexpr double kSigma = 0.1;  // [m], of an error that stays
  const auto pose_error = [&](double correlation_s) {
    double nees = 0.0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      Loop loop = drive(seed, 1.3);
      Rng rng(seed + 20'000);
      std::vector<double> bias(kTrees);
      for (double& one : bias) {
        one = normal(rng, kSigma);
      }
      for (std::vector<RangeBearing>& seen : loop.sightings) {
        for (RangeBearing& z : seen) {
          z.range = std::max(0.1, *z.range + bias[static_cast<std::size_t>(*z.landmark)]);
        }
      }
      LandmarkEkf::Config config = well_informed();
      config.landmark.sigma_range_m = std::hypot(kSigma, kSigmaRange);
      config.correlation_s = correlation_s;
      LandmarkEkf ekf(config, testing::sensor_at(kMount), loop.start);
      follow(ekf, loop, [](const GaussianBelief&) {});
      const PoseEstimate now = ekf.estimate();
      Vector<3> error = Vector<3>(now.pose.x, now.pose.y, now.pose.heading) - loop.truth;
      error(2) = wrap_angle(error(2));
      nees += squared(error, now.covariance) / kRuns;
    }
    return nees;
  };
  const double with = pose_error(10.0);
  const double without = pose_error(0.0);
  EXPECT_LT(with, 3.5);
  EXPECT_GT(with, 1.0);
  EXPECT_GT(without, 1.5 * with) << with;
}

TEST(LandmarkEkf, finds_out_by_itself_which_landmark_is_which) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Loop loop = drive(seed, 1.3);
    LandmarkEkf::Config config = well_informed();
    config.landmark.gate = 0.999;
    config.gate_new = 0.9999999;
    LandmarkEkf ekf(config, testing::sensor_at(kMount), loop.start);
    for (std::size_t i = 0; i < loop.motions.size(); ++i) {
      ekf.on(loop.motions[i]);
      std::vector<RangeBearing> seen = loop.sightings[i];
      for (RangeBearing& z : seen) {
        z.landmark.reset();
      }
      ekf.on_joint(seen);
    }
    int confirmed = 0;
    for (const LandmarkEstimate& landmark : ekf.landmarks()) {
      EXPECT_LT(landmark.id, 0);
      confirmed += landmark.confirmed ? 1 : 0;
      double nearest = std::numeric_limits<double>::infinity();
      for (int k = 0; k < kTrees; ++k) {
        nearest = std::min(nearest, (landmark.position - tree(k)).norm());
      }
      EXPECT_LT(nearest, 0.2);
    }
    EXPECT_EQ(confirmed, kTrees) << "seed " << seed;
    EXPECT_LT((ekf.estimate().pose.position() - loop.truth.head<2>()).norm(), 0.15);
  }
}

TEST(LandmarkEkf, closing_a_loop_shrinks_the_covariance_of_every_landmark) {
  const Loop loop = drive(1, 0.6);
  LandmarkEkf ekf(well_informed(), testing::sensor_at(kMount), loop.start);
  for (std::size_t i = 0; i < loop.motions.size(); ++i) {
    ekf.on(loop.motions[i]);
    std::vector<RangeBearing> seen = loop.sightings[i];
    const auto is_first = [](const RangeBearing& z) { return *z.landmark == 0; };
    if (i > 10) {  // not the first one again, yet
      seen.erase(std::remove_if(seen.begin(), seen.end(), is_first), seen.end());
    }
    ekf.on_joint(seen);
  }
  ekf.advance_to(ekf.estimate().stamp);
  const std::vector<LandmarkEstimate> before = ekf.landmarks();
  const Pose2 truth{loop.truth(0), loop.truth(1), loop.truth(2)};
  const auto again = ekf.on_joint({named(sight(truth, tree(0), ekf.belief().stamp), 0)});
  ASSERT_EQ(again.front().verdict, Verdict::kFused);
  const std::vector<LandmarkEstimate> after = ekf.landmarks();
  double most = 0.0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    const double ratio = after[k].covariance.trace() / before[k].covariance.trace();
    EXPECT_LT(ratio, 1.0) << "landmark " << before[k].id;
    most = std::max(most, 1.0 - ratio);
  }
  EXPECT_GT(most, 0.05);
}

// ---------------------------------------------------------------- beside PoseEkf

TEST(LandmarkEkf, is_a_pose_ekf_where_all_landmarks_are_exact) {
  std::vector<Landmark> places;
  std::vector<KnownLandmark> known;
  for (int k = 0; k < kTrees; ++k) {
    places.push_back({k, tree(k), 0.0});
    known.push_back({k, tree(k), {}});
  }
  LandmarkEkf::Config config = well_informed();
  config.landmark.gate = config.gate_new = 0.999;
  PoseEkf::Config same_config;
  same_config.odometry = config.odometry;
  same_config.landmark = config.landmark;
  const Loop loop = drive(7, 1.0);
  LandmarkEkf ekf(knowing(known, config), testing::sensor_at(kMount), loop.start);
  PoseEkf peer(
      same_config,
      {testing::hall(), testing::one_tag(), {std::make_shared<LandmarkMap>(places), kMount}},
      loop.start);
  for (std::size_t i = 0; i < loop.motions.size(); ++i) {
    ekf.on(loop.motions[i]);
    peer.on(loop.motions[i]);
    std::vector<RangeBearing> seen = loop.sightings[i];
    for (std::size_t k = 0; k < seen.size(); k += 2) {
      seen[k].landmark.reset();
    }
    std::sort(seen.begin(), seen.end(), precedes);  // a PoseEkf takes them as they are
    const std::vector<Outcome> ours = ekf.on_joint(seen);
    const std::vector<Outcome> theirs = peer.on_joint(seen);
    for (std::size_t k = 0; k < seen.size(); ++k) {
      ASSERT_EQ(ours[k].verdict, theirs[k].verdict);
    }
    expect_near(ekf.belief().x, peer.belief().x, 1e-12);
    expect_near(ekf.belief().P, peer.belief().P, 1e-14);
  }
  EXPECT_TRUE(ekf.landmarks().front().covariance.isZero(0.0));
}

TEST(LandmarkEkf, a_landmark_known_with_a_covariance_is_improved) {
  const Vector<2> place(4.0, 5.0);
  LandmarkEkf::Config config;
  config.landmark = {0.1, 0.02};
  LandmarkEkf ekf = ekf_at(kStart, config, {{7, place + Vector<2>(0.2, 0.0), 0.09 * kI2}});
  ASSERT_EQ(ekf.on(named(sight(kStart, place), 7)).verdict, Verdict::kFused);
  const LandmarkEstimate landmark = ekf.landmarks().front();
  EXPECT_LT((landmark.position - place).norm(), 0.05);
  EXPECT_LT(landmark.covariance.trace(), 0.05);
  EXPECT_EQ(landmark.sightings, 1);
}

// ---------------------------------------------------------------- new landmarks

TEST(LandmarkEkf, a_named_landmark_is_placed_where_it_is_seen) {
  LandmarkEkf ekf = ekf_at(kStart);
  const Vector<2> place(4.0, 5.0);
  EXPECT_EQ(ekf.on(named(sight(kStart, place), 42)).verdict, Verdict::kFused);
  const std::vector<LandmarkEstimate> all = ekf.landmarks();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].id, 42);
  EXPECT_TRUE(all[0].confirmed);
  expect_near(all[0].position, place, 1e-12);
  EXPECT_GT(ekf.belief().P(0, 3), 0.0);
}

TEST(LandmarkEkf, a_tentative_landmark_is_counted_and_then_corrects) {
  LandmarkEkf ekf = averaging_ekf();
  ekf.on(Velocity{0, 0.0, 0.0});
  const Vector<2> place(4.0, 5.0);
  for (int i = 0; i < 3; ++i) {
    const Matrix<3, 3> before = ekf.current().covariance;
    const Stamp now = i * kSecond / 10;
    ASSERT_EQ(ekf.on(sight(kStart, place, now)).verdict, Verdict::kFused);
    ASSERT_EQ(ekf.landmarks().size(), 1U);
    const LandmarkEstimate landmark = ekf.landmarks().front();
    EXPECT_EQ(landmark.id, -1);
    EXPECT_EQ(landmark.sightings, i + 1);
    EXPECT_EQ(landmark.confirmed, i == 2);
    if (i < 2) {
      EXPECT_TRUE(same_bits(before, ekf.current().covariance));
    }
  }
  const double first = ekf.landmarks().front().covariance.trace();
  ekf.on(sight(kStart, place, kSecond));
  EXPECT_LT(ekf.landmarks().front().covariance.trace(), first);
}

TEST(LandmarkEkf, a_tentative_landmark_that_is_not_seen_again_is_dropped) {
  LandmarkEkf ekf = ekf_at(kStart);
  const Vector<2> ghost(4.0, 5.0);
  const Vector<2> place(-4.0, 5.0);
  ekf.on(sight(kStart, ghost));
  for (int i = 1; i <= 21; ++i) {
    ekf.on(sight(kStart, place, i * kSecond / 10));
  }
  const std::vector<LandmarkEstimate> all = ekf.landmarks();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].id, -2);
  EXPECT_EQ(ekf.belief().dimension(), 5);
  expect_near(all[0].position, place, 1e-9);
}

TEST(LandmarkEkf, between_the_gates_a_sighting_is_dropped_and_beyond_them_it_is_new) {
  const Vector<2> place(4.0, 5.0);
  LandmarkEkf::Config config;
  config.landmark = {0.1, 0.02};
  LandmarkEkf ekf(knowing({{1, place, {}}}, config), testing::sensor_at(kMount),
                  {0, kStart, 1e-10 * kI3});
  RangeBearing z = sight(kStart, place);
  const double exact = *z.range;
  const auto off_by = [&](double sigmas) {
    z.range = exact + sigmas * 0.1;
    LandmarkEkf copy = ekf;
    const Outcome outcome = copy.on(z);
    EXPECT_EQ(copy.landmarks().size() == 2U, sigmas > 5.3) << sigmas;
    EXPECT_EQ(same(copy, ekf), outcome.verdict != Verdict::kFused);
    return outcome.verdict;
  };
  EXPECT_EQ(off_by(3.6), Verdict::kFused);  // limits are sqrt(13.8) = 3.72 and sqrt(27.6) = 5.26
  EXPECT_EQ(off_by(3.8), Verdict::kGated);
  EXPECT_EQ(off_by(5.2), Verdict::kGated);
  EXPECT_EQ(off_by(5.4), Verdict::kFused);
}

TEST(LandmarkEkf, two_sightings_of_one_instant_are_not_of_one_landmark) {
  LandmarkEkf ekf = ekf_at(kStart);
  const RangeBearing z = sight(kStart, {4.0, 5.0});
  const std::vector<Outcome> outcomes = ekf.on_joint({z, z});
  EXPECT_EQ(outcomes[0].verdict, Verdict::kFused);
  EXPECT_EQ(outcomes[1].verdict, Verdict::kGated);
  EXPECT_EQ(ekf.landmarks().size(), 1U);
  EXPECT_EQ(ekf.landmarks().front().sightings, 1);
}

TEST(LandmarkEkf, range_alone_and_bearing_alone_correct_but_never_create) {
  const Vector<2> place(4.0, 5.0);
  RangeBearing range = sight(kStart, place);
  range.bearing.reset();
  RangeBearing bearing = sight(kStart, place);
  bearing.range.reset();
  for (const RangeBearing& part : {range, bearing}) {
    LandmarkEkf ekf = averaging_ekf();
    const LandmarkEkf before = ekf;
    EXPECT_EQ(ekf.on(part).verdict, Verdict::kNotModelled);
    EXPECT_EQ(ekf.on(named(part, 3)).verdict, Verdict::kNotModelled);
    EXPECT_TRUE(same(ekf, before));

    ekf.on(named(sight(kStart, place), 3));
    const double spread = ekf.landmarks().front().covariance.trace();
    const Outcome outcome = ekf.on(part);
    EXPECT_EQ(outcome.verdict, Verdict::kFused);
    EXPECT_EQ(outcome.dof, 1);
    EXPECT_LT(ekf.landmarks().front().covariance.trace(), spread);

    RangeBearing far = part;
    if (far.range) {
      *far.range += 5.0;
    } else {
      *far.bearing += 1.0;
    }
    const LandmarkEkf fused = ekf;
    EXPECT_EQ(ekf.on(far).verdict, Verdict::kGated);
    EXPECT_TRUE(same(ekf, fused));
  }
}

TEST(LandmarkEkf, is_full_at_max_landmarks) {
  LandmarkEkf::Config config;
  config.max_landmarks = 2;
  LandmarkEkf ekf = ekf_at(kStart, config);
  EXPECT_EQ(ekf.on(named(sight(kStart, {4.0, 5.0}), 1)).verdict, Verdict::kFused);
  EXPECT_EQ(ekf.on(named(sight(kStart, {-4.0, 5.0}), 2)).verdict, Verdict::kFused);
  const LandmarkEkf before = ekf;
  EXPECT_EQ(ekf.on(named(sight(kStart, {4.0, -5.0}), 3)).verdict, Verdict::kNotModelled);
  EXPECT_TRUE(same(ekf, before));
}

TEST(LandmarkEkf, an_unnamed_landmark_never_gets_a_name_that_is_taken) {
  LandmarkEkf::Config config;
  config.min_sightings = 1;
  LandmarkEkf ekf = ekf_at(kStart, config, {{-5, {40.0, 0.0}, {}}});
  ekf.on(sight(kStart, {4.0, 5.0}));
  ekf.on(named(sight(kStart, {-4.0, 5.0}), -20));
  ekf.on(sight(kStart, {4.0, -5.0}));
  std::vector<Id> ids;
  for (const LandmarkEstimate& landmark : ekf.landmarks()) {
    ids.push_back(landmark.id);
  }
  EXPECT_EQ(ids, (std::vector<Id>{-5, -1, -20, -2}));
}

// One below the smallest of all numbers was to be the name of the next.
TEST(LandmarkEkf, any_number_is_a_name) {
  constexpr Id kLeast = std::numeric_limits<Id>::min();
  LandmarkEkf::Config config;
  config.min_sightings = 1;
  LandmarkEkf ekf = ekf_at(kStart, config, {{kLeast, {40.0, 0.0}, {}}, {-1, {50.0, 0.0}, {}}});
  ekf.on(named(sight(kStart, {-4.0, 5.0}), kLeast + 1));
  ekf.on(named(sight(kStart, {-4.0, -5.0}), std::numeric_limits<Id>::max()));
  ekf.on(sight(kStart, {4.0, 5.0}));
  ASSERT_EQ(ekf.landmarks().size(), 5U);
  EXPECT_EQ(ekf.landmarks().back().id, -2);
}

// One that was dropped may have been written down somewhere.
TEST(LandmarkEkf, no_two_unnamed_landmarks_get_the_same_name) {
  LandmarkEkf::Config config;
  config.confirm_within_s = 1.0;
  LandmarkEkf ekf = ekf_at(kStart, config);
  ekf.on(sight(kStart, {4.0, 5.0}));
  ekf.on(named(sight(kStart, {-4.0, 5.0}, 5 * kSecond), 3));  // the first is dropped
  ekf.on(sight(kStart, {4.0, -5.0}, 5 * kSecond));
  ASSERT_EQ(ekf.landmarks().size(), 2U);
  EXPECT_EQ(ekf.landmarks().back().id, -2);
}

// A heading known to 10 rad puts what is seen 9 km away anywhere: rounding left a covariance that
// was none, and the exception hid that the other sighting had been fused.
TEST(LandmarkEkf, a_landmark_whose_covariance_has_no_digits_takes_none_of_the_others_along) {
  int not_modelled = 0;
  for (int k = 0; k < 20; ++k) {
    const Matrix<3, 3> P = Vector<3>(1e-12, 1e-12, 100.0).asDiagonal();
    LandmarkEkf ekf(knowing({{0, {4.0, 3.0}, {}}}), testing::sensor_at({0.2, 0.0, 0.1}),
                    {0, {}, P});
    RangeBearing near;
    near.landmark = 0;
    near.range = std::hypot(3.8, 3.0);
    RangeBearing far;
    far.landmark = 7;
    far.range = 9000.0 + k;
    far.bearing = 0.3 * k - 2.9;
    far.covariance = Matrix<2, 2>(Vector<2>(1e-12, 1e-8).asDiagonal());
    std::vector<Outcome> outcomes;
    ASSERT_NO_THROW(outcomes = ekf.on_joint({near, far})) << k;
    EXPECT_EQ(outcomes[0].verdict, Verdict::kFused);
    not_modelled += outcomes[1].verdict == Verdict::kNotModelled ? 1 : 0;
  }
  EXPECT_GT(not_modelled, 0);
}

// ---------------------------------------------------------------- messages

/// With a landmark, in the middle of an increment, so that a message would move it.
LandmarkEkf moving() {
  LandmarkEkf ekf = ekf_at(kStart);
  ekf.on(named(sight(kStart, {4.0, 5.0}), 1));
  ekf.on(Increment{0, 2 * kSecond, {1.0, 0.1, 0.7}});
  ekf.advance_to(kSecond);
  return ekf;
}

void expect_no_trace(const Message& message, Verdict verdict) {
  LandmarkEkf ekf = moving();
  EXPECT_EQ(ekf.on(message).verdict, verdict);
  EXPECT_TRUE(same(ekf, moving()));
}

TEST(LandmarkEkf, what_is_not_fused_changes_no_bit) {
  const Stamp later = 3 * kSecond / 2;
  expect_no_trace(Velocity{kSecond - 1, 1.0, 0.0}, Verdict::kStale);
  expect_no_trace(Increment{0, kSecond - 1, {1.0, 0.0, 0.0}}, Verdict::kStale);
  expect_no_trace(PositionFix{kSecond - 1, {0.0, 0.0}, kI2}, Verdict::kStale);
  expect_no_trace(sight(kStart, {4.0, 5.0}, kSecond - 1), Verdict::kStale);
  expect_no_trace(PositionFix{later, {90.0, 0.0}, 0.01 * kI2}, Verdict::kGated);
  expect_no_trace(PositionFix{later, {0.0, 0.0}, kI2, 3}, Verdict::kNotModelled);  // of a tag
  RangeBearing wrong = named(sight(kStart, {4.0, 5.0}, later), 1);
  *wrong.range += 5.0;
  expect_no_trace(wrong, Verdict::kGated);
  RangeBearing part = wrong;
  part.landmark = 2;
  part.bearing.reset();
  expect_no_trace(part, Verdict::kNotModelled);
  expect_no_trace(Range{later, 0, 0, 1.0, {}}, Verdict::kIgnored);
  expect_no_trace(PoseObservation{later, {}, kI3}, Verdict::kIgnored);
}

/// An error would hide that the other one has been fused.
TEST(LandmarkEkf, a_sighting_that_leaves_no_covariance_takes_none_of_the_others_along) {
  const Vector<2> lamp(4.0, 5.0);
  LandmarkEkf ekf = ekf_at(kStart, {}, {{1, lamp, {}}});
  LandmarkEkf without = ekf;
  RangeBearing flat = named(sight(kStart, {1.0, 7.0}), 2);
  flat.range = 1e-170;  // across it there is no room
  const std::vector<Outcome> outcomes = ekf.on_joint({named(sight(kStart, lamp), 1), flat});
  EXPECT_EQ(outcomes[0].verdict, Verdict::kFused);
  EXPECT_EQ(outcomes[1].verdict, Verdict::kNotModelled);
  EXPECT_EQ(without.on(named(sight(kStart, lamp), 1)).verdict, Verdict::kFused);
  EXPECT_TRUE(same(ekf, without));
  EXPECT_EQ(ekf.on(flat).verdict, Verdict::kNotModelled);
  EXPECT_TRUE(same(ekf, without));
}

TEST(LandmarkEkf, refuses_bad_messages_and_changes_no_bit) {
  LandmarkEkf ekf = moving();
  constexpr Stamp kLast = std::numeric_limits<Stamp>::max();
  const double nan = std::nan("");
  RangeBearing z = sight(kStart, {4.0, 5.0}, 3 * kSecond / 2);
  RangeBearing other = z;
  ++other.stamp;
  expect_refused([&] { ekf.on_joint({z, other}); }, "one instant", "one stamp");
  other = z;
  other.range = -1.0;
  expect_refused([&] { ekf.on_joint({z, other}); }, "-1");
  other.range = nan;
  expect_refused([&] { ekf.on(other); }, "nan");
  expect_refused([&] { ekf.on(sight(kStart, {4.0, 5.0}, kLast)); }, "stamp");
  expect_refused([&] { ekf.on(Velocity{kLast, 1.0, 0.0}); }, "stamp");
  expect_refused([&] { ekf.on(Velocity{2 * kSecond, nan, 0.0}); }, "nan");
  expect_refused([&] { ekf.on(PositionFix{2 * kSecond, {nan, 0.0}, kI2}); }, "nan");
  expect_refused([&] { (void)ekf.estimate(0); }, "before the belief");
  expect_refused([&] { ekf.advance_to(kStampLimit); }, "stamp");
  EXPECT_TRUE(ekf.on_joint({}).empty());
  EXPECT_TRUE(same(ekf, moving()));
}

TEST(LandmarkEkf, refuses_a_config_that_makes_no_sense) {
  const auto refuse = [](const auto& change, const char* text) {
    LandmarkEkf::Config config;
    change(config);
    expect_refused([&] { (void)ekf_at(kStart, config); }, text);
  };
  using C = LandmarkEkf::Config;
  refuse([](C& c) { c.min_sightings = 0; }, "min_sightings is 0");
  refuse([](C& c) { c.max_landmarks = -1; }, "max_landmarks is -1");
  refuse([](C& c) { c.confirm_within_s = 0.0; }, "confirm_within_s");
  refuse([](C& c) { c.hold_s = -1.0; }, "hold_s");
  refuse([](C& c) { c.gate_new = 0.5; }, "gate_new is 0.5");
  refuse([](C& c) { c.landmark.gate = 0.0; }, "0");
  refuse([](C& c) { c.landmark.sigma_range_m = 0.0; }, "sigma_range_m");
  refuse([](C& c) { c.sigma_lost_xy_per_sqrt_s = 0.0; }, "sigma_lost_xy_per_sqrt_s");
  expect_refused(
      [] {
        (void)ekf_at(kStart, {}, {{1, {0.0, 0.0}, {}}, {1, {1.0, 0.0}, {}}});
      },
      "landmark 1 is given twice");
  expect_refused([] { (void)ekf_at(kStart, {}, {{1, {std::nan(""), 0.0}, {}}}); }, "not finite");
  expect_refused([] { (void)ekf_at(kStart, {}, {{1, {0.0, 0.0}, -kI2}}); }, "landmark 1");
  expect_refused([] { (void)LandmarkEkf({}, {}, {0, kStart, -kI3}); }, "body");
}

TEST(LandmarkEkf, positions_correct_the_pose_and_what_was_seen_from_it) {
  LandmarkEkf ekf(LandmarkEkf::Config{}, testing::sensor_at(kMount), {0, kStart, 0.25 * kI3});
  const Vector<2> place(4.0, 5.0);
  ekf.on(named(sight(kStart, place), 1));
  const PositionFix fix{0, kStart.position() + Vector<2>(0.5, 0.0), 1e-4 * kI2};
  ASSERT_EQ(ekf.on(fix).verdict, Verdict::kFused);
  EXPECT_NEAR(ekf.pose().x, kStart.x + 0.5, 0.01);
  EXPECT_NEAR(ekf.landmarks().front().position.x(), place.x() + 0.5, 0.05);
}

TEST(LandmarkEkf, the_pose_now_is_that_of_the_belief_carried_there) {
  LandmarkEkf ekf = moving();
  const PoseEstimate now = ekf.estimate();
  ekf.advance_to(2 * kSecond);
  EXPECT_EQ(now.stamp, 2 * kSecond);
  testing::expect_pose_near(now.pose, ekf.pose(), 1e-15);
  expect_near(now.covariance, ekf.current().covariance, 1e-16);
}

TEST(LandmarkEkf, a_copy_is_a_snapshot) {
  LandmarkEkf ekf = moving();
  const LandmarkEkf snapshot = ekf;
  ekf.on(named(sight(ekf.pose(), {-4.0, 5.0}, kSecond), 2));
  EXPECT_EQ(snapshot.landmarks().size(), 1U);
  EXPECT_TRUE(same(snapshot, moving()));
  ekf = snapshot;
  EXPECT_TRUE(same(ekf, moving()));
}

TEST(LandmarkEkf, late_messages_of_a_replay_are_fused_where_they_belong) {
  const Loop loop = drive(3, 1.0);
  LandmarkEkf::Config config = well_informed();
  config.landmark.gate = config.gate_new = 0.9999999;
  const LandmarkEkf start(config, testing::sensor_at(kMount), loop.start);
  Timeline<LandmarkEkf> in_order(start, kSecond);
  Timeline<LandmarkEkf> late(start, kSecond);
  const auto ignore = [](std::size_t, const Outcome&) {};
  std::vector<Message> held;
  for (std::size_t i = 0; i < loop.motions.size(); ++i) {
    in_order.on(loop.motions[i], ignore);
    late.on(loop.motions[i], ignore);
    for (const RangeBearing& z : loop.sightings[i]) {
      in_order.on(z, ignore);
      held.push_back(z);
    }
    if (i % 5 == 4) {
      for (const Message& message : held) {
        late.on(message, ignore);
      }
      held.clear();
    }
  }
  for (const Message& message : held) {
    late.on(message, ignore);
  }
  EXPECT_TRUE(same(in_order.estimator(), late.estimator()));
}

/// Where a matrix has room to grow depends on its size alone: else sums are rounded otherwise.
TEST(LandmarkEkf, goes_on_with_the_same_bits_after_it_was_put_back_into_a_larger_one) {
  const auto place = [](int i) { return Vector<2>(4.0 + 2.0 * i, (i % 3) - 1.0); };
  LandmarkEkf larger({}, testing::sensor_at(kMount), {0, kStart, 0.01 * kI3});
  for (int i = 0; i < 30; ++i) {
    larger.on(named(sight(kStart, place(i)), i));
  }
  for (int landmarks = 0; landmarks < 20; ++landmarks) {
    LandmarkEkf grown({}, testing::sensor_at(kMount), {0, kStart, 0.01 * kI3});
    for (int i = 0; i < landmarks; ++i) {
      grown.on(named(sight(kStart, place(i)), i));
    }
    LandmarkEkf put_back = larger;
    put_back = grown;
    for (int step = 1; step < 10; ++step) {
      std::vector<RangeBearing> seen;
      for (int i = 0; i <= landmarks; ++i) {
        const Pose2 at{kStart.x + 0.01 * step, kStart.y, kStart.heading};
        seen.push_back(named(sight(at, place(i), step * kSecond), i));
      }
      grown.on_joint(seen);
      put_back.on_joint(seen);
    }
    EXPECT_TRUE(same(grown, put_back)) << landmarks << " landmarks";
  }
}

}  // namespace
}  // namespace locfuse::test_landmark_ekf
