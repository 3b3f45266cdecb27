// SPDX-License-Identifier: Apache-2.0
// Particles that are drawn from odometry and lines: the belief is that of the same measurement.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "locfuse/frontends/line_features.hpp"
#include "locfuse/models/measurement/line.hpp"
#include "locfuse/particles/mcl.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse::test_mcl_line_proposal {
namespace {

using internal::make_mcl_recipe;
using internal::MclRecipe;
using internal::ParticleFilter;
using internal::RandomKeys;
using testing::Rng;
using Proposal = Mcl::Proposal;

constexpr Stamp kSecond = 1'000'000'000;

/// Free cells of 5 cm in front of a wall in x = 8.
std::shared_ptr<const OccupancyGrid> one_wall() {
  std::vector<Cell> cells(200 * 200, Cell::kFree);
  for (std::size_t row = 0; row < 200; ++row) {
    cells[row * 200 + 160] = Cell::kOccupied;
  }
  return std::make_shared<const OccupancyGrid>(200, 200, 0.05, Pose2{}, cells);
}

MclConfig settings(Proposal proposal, double sigma_map) {
  MclConfig config;
  config.min_particles = config.max_particles = 40'000;
  config.proposal = proposal;
  config.effective_share = 0.0;  // all of the measurement
  config.sigma_map_m = sigma_map;
  config.sigma_map_rad = 0.0;
  config.independent_beams = 4.0;
  config.odometry = {0.1, 0.05, 0.02, 0.02, 0.0, 0.0};
  return config;
}

struct Gaussian {
  Vector<3> mean;  // from the true pose
  Matrix<3, 3> covariance;
};

/// Of the particles as weighted, times likelihood(pose).
template <class Likelihood>
Gaussian gaussian_of(const ParticleFilter& filter, const MclRecipe& recipe, const Pose2& about,
                     const Likelihood& likelihood) {
  Gaussian g{Vector<3>::Zero(), Matrix<3, 3>::Zero()};
  double total = 0.0;
  const ParticleBelief& belief = filter.belief();
  for (std::size_t k = 0; k < static_cast<std::size_t>(belief.size); ++k) {
    const Vector<3> d = local(recipe.to_world(belief.pose(k)), about);
    const double weight =
        static_cast<double>(belief.weight[k]) * likelihood(recipe.to_world(belief.pose(k)));
    total += weight;
    g.mean += weight * d;
    g.covariance += weight * d * d.transpose();
  }
  g.mean /= total;
  g.covariance /= total;
  g.covariance -= g.mean * g.mean.transpose();
  return g;
}

const Pose2 kStart{5.0, 5.0, 0.0};
const Pose2 kMotion{0.4, 0.0, 0.0};
const Pose2 kTruth{5.5, 5.02, 0.0};

/// What the robot sees from kTruth.
LaserScan scan() {
  Rng rng(1);
  return testing::scan_from({{{8.0, 0.0}, {8.0, 10.0}}}, kTruth, rng, 0.0);
}

Matrix<3, 3> prior() { return Vector<3>(0.0025, 0.0025, 0.0001).asDiagonal(); }

constexpr double kWall = 0.06;  // error of the map where a beam meets the wall [m]

/// The line that is seen, as that of the wall.
Linearization<2, 3> wall_from(const Pose2& pose) {
  const LineFeature seen = scan_line_features(scan()).front();
  const Line2 wall{8.0, 0.0, {8.0, 5.0}, 5.0};
  const double beams = 4.0 / 360.0 * (seen.last - seen.first + 1);
  return LineModel::linearize(
      pose, wall, seen.line,
      LineModel({kWall}).noise(pose, wall, seen.line, seen.covariance, beams));
}

/// Particles drawn from odometry and the line, weighed by the line where that has not been done.
Gaussian particles_after(Proposal proposal, bool is_exact) {
  const auto recipe =
      make_mcl_recipe(settings(proposal, is_exact ? 0.0 : 1e-9), testing::on_map(one_wall()));
  ParticleFilter filter(recipe);
  RandomKeys keys(7);
  filter.start_at({{{0, kStart, prior()}, 1.0}}, keys);
  filter.add_motion(recipe->motion, kMotion, kSecond);
  const double sigma_hit = is_exact ? std::hypot(recipe->config.field.sigma_hit_m, kWall) : kWall;
  std::optional<LaserScan> rest;
  if (proposal == Proposal::kOdometry) {
    filter.propagate(keys);
  } else {
    rest = filter.propagate_by_lines(scan(), sigma_hit, keys);
  }
  EXPECT_EQ(rest.has_value(), proposal == Proposal::kLineEkf && is_exact);
  return gaussian_of(filter, *recipe, kTruth, [&](const Pose2& pose) {
    return is_exact ? 1.0 : std::exp(log_likelihood(wall_from(pose)));
  });
}

/// The Kalman filter's, in closed form, after motion and after the one wall.
Gaussian predicted() {
  const OdometryMotion motion(settings(Proposal::kLineEkf, 0.0).odometry);
  const auto step = motion.propagate(kStart, kMotion, 1.0);
  return {local(step.moved, kTruth),
          step.jacobian * prior() * step.jacobian.transpose() + step.noise};
}
Gaussian updated() {
  const Gaussian before = predicted();
  const auto lin = wall_from(retract(kTruth, before.mean));
  const Matrix<3, 3>& P = before.covariance;
  const Matrix<2, 2> S = lin.jacobian * P * lin.jacobian.transpose() + lin.noise;
  const Matrix<3, 2> K = P * lin.jacobian.transpose() * S.inverse();
  return {before.mean + K * lin.residual, P - K * S * K.transpose()};
}

/// How far two Gaussians differ, in sigmas of the second and as shares of its variances.
double difference(const Gaussian& a, const Gaussian& b) {
  const Vector<3> sigma = b.covariance.diagonal().cwiseSqrt();
  const Matrix<3, 3> scale = sigma.cwiseInverse().asDiagonal();
  return std::max((a.mean - b.mean).cwiseQuotient(sigma).cwiseAbs().maxCoeff(),
                  (scale * (a.covariance - b.covariance) * scale).cwiseAbs().maxCoeff());
}

TEST(LineProposal, on_an_exact_map_particles_are_the_posterior_of_the_kalman_filter) {
  ASSERT_LT(updated().covariance(0, 0), 0.6 * predicted().covariance(0, 0));
  EXPECT_LT(difference(particles_after(Proposal::kLineEkf, true), updated()), 0.06);
  EXPECT_GT(difference(particles_after(Proposal::kLineEkfPaper, true), updated()), 0.2);
}

/// There the weight takes out what particles were drawn from, and the likelihood that follows
/// counts once.
TEST(LineProposal, on_other_maps_the_likelihood_that_follows_makes_them_that_posterior) {
  EXPECT_LT(difference(particles_after(Proposal::kLineEkf, false), updated()), 0.06);
  EXPECT_LT(difference(particles_after(Proposal::kOdometry, false), updated()), 0.06);
  EXPECT_GT(difference(particles_after(Proposal::kLineEkfPaper, false), updated()), 0.2);
}

/// A drive along the middle of a room of 8 x 6 m.
struct Drive {
  testing::Walls walls;
  std::shared_ptr<const OccupancyGrid> map;
  std::vector<Pose2> truth;
  std::vector<Increment> increments;
  std::vector<LaserScan> scans;
};

Drive drive(const testing::Walls& walls, std::uint64_t seed) {
  Rng rng(seed);
  Drive run{walls, testing::map_of(walls, 200, 200, 0.05, {}), {{3.0, 4.0, 0.0}}, {}, {}};
  for (int i = 0; i < 15; ++i) {
    const Pose2 step = arc(0.15, 0.0, 0.1);
    run.truth.push_back(run.truth.back() * step);
    const Pose2 reported{step.x + testing::normal(rng, 0.01), step.y,
                         step.heading + testing::normal(rng, 0.01)};
    run.increments.push_back({i * kSecond, (i + 1) * kSecond, reported});
    run.scans.push_back(testing::scan_from(walls, run.truth.back(), rng, 0.01));
    run.scans.back().stamp = (i + 1) * kSecond;
  }
  return run;
}

testing::Walls box() {
  testing::Walls walls;
  testing::add_box(walls, {5.0, 5.0, 0.0}, 8.0, 6.0);
  return walls;
}

Mcl after(const Drive& run, Proposal proposal, int threads = 1) {
  MclConfig config;
  config.min_particles = config.max_particles = 300;
  config.proposal = proposal;
  config.threads = threads;
  Mcl mcl(config, testing::on_map(run.map), 0);
  const Vector<3> sigma(0.1, 0.1, 0.05);
  mcl.start_at({{{0, run.truth[0], sigma.cwiseAbs2().asDiagonal()}, 1.0}});
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    mcl.on(run.increments[i]);
    mcl.on(run.scans[i]);
  }
  return mcl;
}

TEST(LineProposal, results_do_not_depend_on_the_number_of_threads) {
  const Drive run = drive(box(), 2);
  for (const Proposal proposal : {Proposal::kLineEkf, Proposal::kLineEkfPaper}) {
    const Mcl one = after(run, proposal, 1);
    const Mcl three = after(run, proposal, 3);
    EXPECT_EQ(one.belief().x, three.belief().x);
    EXPECT_EQ(one.belief().s, three.belief().s);
    EXPECT_EQ(one.belief().weight, three.belief().weight);
    EXPECT_NE(one.belief().x, after(run, Proposal::kOdometry).belief().x);
  }
}

TEST(LineProposal, without_lines_it_is_odometry) {
  testing::Walls posts;  // too short for a line
  for (int i = 0; i < 8; ++i) {
    const Vector<2> at(1.0 + i, i % 2 == 0 ? 2.0 : 8.0);
    posts.emplace_back(at, at + Vector<2>(0.3, 0.1));
  }
  const Drive run = drive(posts, 3);
  EXPECT_EQ(after(run, Proposal::kLineEkf).belief().x, after(run, Proposal::kOdometry).belief().x);
}

TEST(LineProposal, a_wall_that_is_not_on_the_map_moves_nothing) {
  Drive run = drive(box(), 4);
  testing::Walls more = box();
  more.push_back({{6.6, 3.0}, {6.9, 5.5}});  // a board that somebody left there
  Rng rng(4);
  for (std::size_t i = 0; i < run.scans.size(); ++i) {
    run.scans[i] = testing::scan_from(more, run.truth[i + 1], rng, 0.01);
    run.scans[i].stamp = run.increments[i].stamp;
  }
  const Mcl mcl = after(run, Proposal::kLineEkf);
  EXPECT_LT(local(mcl.estimate().pose, run.truth.back()).head<2>().norm(), 0.06);
  EXPECT_TRUE(mcl.ready());
}

TEST(LineProposal, odometry_without_noise_and_a_turned_laser_leave_numbers_finite) {
  const Drive run = drive(box(), 5);
  for (const double sigma : {0.0, 1e-160, 1e3}) {
    MclConfig config;
    config.min_particles = config.max_particles = 100;
    config.proposal = Proposal::kLineEkf;
    config.odometry = {sigma, sigma, sigma, sigma, 0.0, 0.0};
    Mcl mcl(config, testing::on_map(run.map), 0);
    mcl.start_at({{{0, run.truth[0], 1e-4 * Matrix<3, 3>::Identity()}, 1.0}});
    for (std::size_t i = 0; i < run.scans.size(); ++i) {
      mcl.on(run.increments[i]);
      EXPECT_NO_THROW(mcl.on(run.scans[i])) << sigma;
    }
    EXPECT_TRUE(testing::is_covariance(mcl.estimate().covariance));
  }
}

}  // namespace
}  // namespace locfuse::test_mcl_line_proposal
