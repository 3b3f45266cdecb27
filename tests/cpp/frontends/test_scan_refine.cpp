// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/frontends/scan_matcher.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;
using testing::is_covariance;
using testing::normal;
using testing::Rng;
using testing::uniform;
using testing::Walls;

Pose2 somewhere(const testing::Room& room, Rng& rng) {
  return room.middle *
         Pose2{uniform(rng, -1.5, 1.5), uniform(rng, -1.0, 0.6), uniform(rng, -kPi, kPi)};
}

/// Mean of the squared error, in units of the covariance, over many rooms; and the largest error.
struct Consistency {
  double nees = 0.0;
  double worst = 0.0;
  int converged = 0;
};

Consistency over_rooms(double sigma, bool exact, int rooms) {
  Consistency found;
  for (int seed = 0; seed < rooms; ++seed) {
    Rng rng(static_cast<std::uint64_t>(seed));
    const testing::Room room = testing::random_room(rng);
    ScanMatcherConfig config;
    config.sigma_range_m = sigma;
    config.exact_neighbours = exact;
    const ScanMatcher matcher(room.map, config);
    for (int k = 0; k < 5; ++k) {
      const Pose2 truth = somewhere(room, rng);
      const LaserScan scan = testing::scan_from(room.walls, truth, rng, sigma);
      const Vector<3> off{normal(rng, 0.07), normal(rng, 0.07), normal(rng, 0.03)};
      const ScanMatch match = matcher.refine(scan, retract(truth, off));
      if (!match.converged || !match.covariance) {
        continue;
      }
      EXPECT_TRUE(is_covariance(*match.covariance));
      const Vector<3> e = local(match.pose, truth);
      found.nees += e.dot(match.covariance->llt().solve(e));
      found.worst = std::max(found.worst, e.head<2>().norm());
      ++found.converged;
    }
  }
  found.nees /= found.converged;
  return found;
}

TEST(ScanRefine, errors_match_the_covariance_within_a_factor_of_two) {
  for (const bool exact : {false, true}) {
    for (const double sigma : {0.01, 0.03}) {
      const Consistency found = over_rooms(sigma, exact, 24);
      EXPECT_GE(found.converged, 119);
      EXPECT_LT(found.worst, 0.02);
      EXPECT_LT(found.nees,
                3.0 + 0.53);  // 99.5 % of the mean of 180 draws with 3 degrees of freedom
      EXPECT_GT(found.nees, 3.0 / 4.0);
    }
  }
}

TEST(ScanRefine, converges_from_a_guess_20_cm_and_5_degrees_off) {
  int right = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Rng rng(seed);
    const testing::Room room = testing::random_room(rng);
    const ScanMatcher matcher(room.map);
    const Pose2 truth = somewhere(room, rng);
    const LaserScan scan = testing::scan_from(room.walls, truth, rng, 0.01);
    const Vector<3> off{uniform(rng, -0.2, 0.2), uniform(rng, -0.2, 0.2),
                        uniform(rng, -5.0, 5.0) * kPi / 180.0};
    const ScanMatch match = matcher.refine(scan, retract(truth, off));
    const Vector<3> e = local(match.pose, truth);
    right += static_cast<int>(match.converged && e.head<2>().norm() < 0.02 &&
                              std::abs(e.z()) < 0.01 && match.explained > 0.9);
  }
  EXPECT_GE(right, 39);
}

/// Two walls of 30 m, 2 m apart.
Walls corridor(double direction) {
  const Vector<2> along(std::cos(direction), std::sin(direction));
  const Vector<2> across(-along.y(), along.x());
  return {{-15.0 * along + across, 15.0 * along + across},
          {-15.0 * along - across, 15.0 * along - across}};
}

TEST(ScanRefine, a_corridor_does_not_observe_the_position_along_it) {
  for (int i = 0; i < 20; ++i) {
    Rng rng(static_cast<std::uint64_t>(i));
    const double direction = i * kPi / 20.0 + (i % 4 == 0 ? 0.0 : uniform(rng, 0.0, 0.1));
    const Walls walls = corridor(direction);
    const ScanMatcher matcher(testing::map_of(walls, 640, 640, 0.05, {-16.0, -16.0, 0.0}));
    const Pose2 truth{uniform(rng, -0.3, 0.3), uniform(rng, -0.3, 0.3), uniform(rng, -kPi, kPi)};
    const LaserScan scan = testing::scan_from(walls, truth, rng, 0.01, testing::laser(360, 8.0));
    const Vector<3> along(std::cos(direction), std::sin(direction), 0.0);
    const Vector<3> across(-along.y(), along.x(), 0.0);
    const ScanMatch alone = matcher.refine(scan, truth);
    ASSERT_TRUE(alone.converged);
    EXPECT_FALSE(alone.covariance);
    ASSERT_TRUE(alone.weak_direction);
    EXPECT_GT(std::abs(alone.weak_direction->dot(along)), 0.99);
    EXPECT_LT(along.dot(alone.information * along), 0.01 * across.dot(alone.information * across));

    Matrix<3, 3> prior = Matrix<3, 3>::Zero();
    prior.diagonal() << 0.25, 0.25, 0.01;
    const ScanMatch with_prior = matcher.refine(scan, truth, prior);
    ASSERT_TRUE(with_prior.covariance);
    EXPECT_NEAR(along.dot(*with_prior.covariance * along), 0.25, 0.01);
    EXPECT_LT(across.dot(*with_prior.covariance * across), 1e-3);
  }
}

TEST(ScanRefine, walls_along_the_grid_are_known_to_one_cell) {
  // A wall along the grid was rounded to cells as a whole, however many beams hit it.
  const auto covariance_of = [](double angle) {
    Rng rng(9);
    Walls walls;
    testing::add_box(walls, {0.01, 0.02, angle}, 8.0, 6.0);
    const ScanMatcher matcher(testing::map_of(walls, 240, 240, 0.05, {-6.0, -6.0, 0.0}));
    const LaserScan scan = testing::scan_from(walls, {0.5, 0.3, 0.0}, rng, 0.003);
    return *matcher.refine(scan, {0.5, 0.3, 0.0}).covariance;
  };
  EXPECT_GT(std::sqrt(covariance_of(0.0)(0, 0)), 0.005);
  EXPECT_LT(std::sqrt(covariance_of(0.4)(0, 0)), 0.005);
}

TEST(ScanRefine, reports_why_it_fails_and_returns_the_guess) {
  Rng rng(1);
  const testing::Room room = testing::random_room(rng);
  const ScanMatcher matcher(room.map);
  LaserScan scan = testing::scan_from(room.walls, room.middle, rng, 0.01);
  const auto expect_fails = [&](const Pose2& guess, ScanMatch::Reason reason) {
    const ScanMatch match = matcher.refine(scan, guess);
    EXPECT_FALSE(match.converged);
    EXPECT_EQ(match.reason, reason);
    EXPECT_FALSE(match.covariance);
    EXPECT_EQ(match.pose.x, guess.x);
  };
  expect_fails({100.0, 0.0, 0.0}, ScanMatch::Reason::kOutsideMap);
  std::fill(scan.ranges.begin() + 3, scan.ranges.end(), std::nan(""));
  expect_fails(room.middle, ScanMatch::Reason::kTooFewMatches);
  std::fill(scan.ranges.begin(), scan.ranges.end(), std::nan(""));
  expect_fails(room.middle, ScanMatch::Reason::kNoReturns);
  scan.ranges.clear();
  expect_fails(room.middle, ScanMatch::Reason::kNoReturns);
}

TEST(ScanRefine, rejects_invalid_input) {
  Rng rng(1);
  const testing::Room room = testing::random_room(rng);
  const ScanMatcher matcher(room.map);
  const LaserScan scan = testing::scan_from(room.walls, room.middle, rng, 0.01);
  expect_refused([&] { (void)matcher.refine(scan, {std::nan(""), 0.0, 0.0}); }, "guess is nan");
  const Matrix<3, 3> negative = -Matrix<3, 3>::Identity();
  expect_refused([&] { (void)matcher.refine(scan, room.middle, negative); }, "positive definite");
  const Matrix<3, 3> flat = Vector<3>(1.0, 1.0, 8.9e-323).asDiagonal();
  expect_refused([&] { (void)matcher.refine(scan, room.middle, flat); }, "too small");
  expect_refused([&] { (void)matcher.refine({}, room.middle); }, "geometry is null");
  ScanMatcherConfig config;
  config.sigma_range_m = 0.0;
  expect_refused([&] { (void)ScanMatcher(room.map, config); }, "sigma_range_m is 0");
  config.sigma_range_m = 1e5;  // every beam was explained, including padding
  expect_refused([&] { (void)ScanMatcher(room.map, config); }, "sigma_range_m is 100000");
  config = {};
  config.outlier_share = 5e-324;  // all hypotheses had an infinite cost
  expect_refused([&] { (void)ScanMatcher(room.map, config); }, "outlier_share");
  config = {};
  config.max_iterations = 2147483647;  // steps that alternate between cells never ended
  expect_refused([&] { (void)ScanMatcher(room.map, config); }, "max_iterations is 2.14748e+09");
}

}  // namespace
}  // namespace locfuse
