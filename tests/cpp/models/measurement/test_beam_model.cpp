// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/models/measurement/beam_model.hpp"
#include "support/expect.hpp"

namespace locfuse::test_beam_model {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// 10 x 10 m in cells of 10 cm: a wall from x = 5 m to 5.1 m.
std::shared_ptr<const OccupancyGrid> wall() {
  std::vector<Cell> cells(100 * 100, Cell::kFree);
  for (std::size_t row = 0; row < 100; ++row) {
    cells[row * 100 + 50] = Cell::kOccupied;
  }
  return std::make_shared<const OccupancyGrid>(100, 100, 0.1, Pose2{}, cells);
}

LaserScan scan_of(std::vector<double> ranges) {
  auto geometry =
      std::make_shared<const LaserGeometry>(LaserGeometry{{0.5, 0.0, 0.0}, 0.0, 0.1, 0.2, 12.0});
  return {0, geometry, std::move(ranges)};
}

/// Integral of exp(log_density) over returns, and the mass of no return.
double total(const BeamModel& model, double expected, double max_range) {
  double sum = std::exp(model.log_density(kInfinity, expected));
  const double step = 1e-4;
  for (double z = 0.5 * step; z < max_range; z += step) {
    sum += step * std::exp(model.log_density(z, expected));
  }
  return sum;
}

TEST(BeamModel, is_a_density_of_ranges) {
  const BeamModel model({0.7, 0.1, 0.1, 0.1, 0.1, 0.5, 12.0}, wall());
  for (const double expected : {1.0, 5.0, 11.0, kInfinity}) {
    EXPECT_NEAR(total(model, expected, 12.0), 1.0, 2e-4) << expected;
  }
  EXPECT_NEAR(total(BeamModel(BeamModel::gaussian_and_no_return(), wall()), 5.0, 30.0), 1.0, 1e-3);
}

TEST(BeamModel, is_the_documented_mixture) {
  const BeamModel model({0.7, 0.1, 0.15, 0.05, 0.1, 0.5, 12.0}, wall());
  const double hit = 0.7 / (0.1 * std::sqrt(2.0 * kPi));
  const double cut = 1.0 - std::exp(-0.5 * 5.0);
  EXPECT_NEAR(model.log_density(4.9, 5.0),
              std::log(hit * std::exp(-0.5) + 0.1 * 0.5 * std::exp(-0.5 * 4.9) / cut + 0.05 / 12.0),
              1e-12);
  EXPECT_NEAR(model.log_density(5.1, 5.0), std::log(hit * std::exp(-0.5) + 0.05 / 12.0), 1e-12);
  EXPECT_NEAR(model.log_density(9.0, 5.0), std::log(0.05 / 12.0), 1e-12);
  EXPECT_NEAR(model.log_density(kInfinity, 5.0), std::log(0.15), 1e-12);
  EXPECT_NEAR(model.log_density(kInfinity, kInfinity), std::log(0.85), 1e-12);
  EXPECT_NEAR(model.log_density(kInfinity, 12.0), std::log(0.85), 1e-12);  // out of its reach
  EXPECT_NEAR(BeamModel(BeamModel::gaussian_and_no_return(), wall()).log_density(9.0, 5.0),
              std::log(1e-12), 1e-9);
}

TEST(BeamModel, sums_over_the_beams_of_a_laser_on_the_body) {
  const BeamModel model({}, wall());
  const LaserScan scan = scan_of({2.5, 13.0, 0.1, kNan});
  const Beams beams = model.beams_of(scan, 10);
  ASSERT_EQ(beams.angle.size(), 3U);  // the third is below range_min
  EXPECT_EQ(beams.range[2], kInfinity);
  const Pose2 body{2.0, 5.0, 0.0};  // the laser is at x = 2.5 m, the wall 2.5 m ahead
  const double expected = model.log_density(2.5, 2.5) +
                          model.log_density(kInfinity, 2.5 / std::cos(0.1)) +
                          model.log_density(kInfinity, 2.5 / std::cos(0.3));
  EXPECT_NEAR(model.log_likelihood(body, beams), expected, 1e-9);
  EXPECT_GT(model.log_likelihood(body, beams), model.log_likelihood({1.5, 5.0, 0.0}, beams));
}

TEST(BeamModel, a_beam_of_exactly_the_largest_range_has_no_return) {
  const BeamModel model({}, wall());
  const Beams beams = model.beams_of(scan_of({std::nextafter(12.0, 0.0), 12.0}), 10);
  EXPECT_EQ(beams.range[0], std::nextafter(12.0, 0.0));
  EXPECT_EQ(beams.range[1], kInfinity);
}

TEST(BeamModel, a_beam_that_passes_a_wall_is_unlikely_wherever_it_ends) {
  auto two = std::vector<Cell>(100 * 100, Cell::kFree);
  for (std::size_t row = 0; row < 100; ++row) {
    two[row * 100 + 50] = two[row * 100 + 80] = Cell::kOccupied;
  }
  const BeamModel model({}, std::make_shared<const OccupancyGrid>(100, 100, 0.1, Pose2{}, two));
  const Beams beams = model.beams_of(scan_of({5.5}), 1);  // to the second wall
  EXPECT_LT(model.log_likelihood({2.0, 5.0, 0.0}, beams),
            model.log_likelihood({5.5, 5.0, 0.0}, model.beams_of(scan_of({2.0}), 1)) - 3.0);
}

TEST(BeamModel, rejects_invalid_mixtures) {
  EXPECT_THROW(BeamModel({0.0, 0.0, 0.0, 0.0}, wall()), std::invalid_argument);
  EXPECT_THROW(BeamModel({1.2, -0.2, 0.0, 0.0}, wall()), std::invalid_argument);
  EXPECT_THROW(BeamModel({kNan, 0.3, 0.0, 0.0}, wall()), std::invalid_argument);
  BeamModel::Config config;
  config.sigma_hit_m = 0.0;
  EXPECT_THROW(BeamModel(config, wall()), std::invalid_argument);
  EXPECT_THROW(BeamModel({}, nullptr), std::invalid_argument);
}

TEST(BeamModel, weights_are_normalized) {
  const BeamModel one({0.7, 0.1, 0.15, 0.05}, wall());
  const BeamModel half({0.35, 0.05, 0.075, 0.025}, wall());
  EXPECT_NEAR(one.log_density(4.9, 5.0), half.log_density(4.9, 5.0), 1e-12);
}

TEST(BeamModel, an_empty_scan_has_no_beams) {
  const BeamModel model({}, wall());
  EXPECT_EQ(model.log_likelihood({2.0, 5.0, 0.0}, model.beams_of(scan_of({0.1, 0.1}), 5)), 0.0);
  EXPECT_TRUE(model.beams_of(scan_of({2.0}), 0).angle.empty());
}

TEST(BeamModel, densities_are_finite_for_any_range) {
  const BeamModel model({}, wall());
  for (const double range : {-1.0, -1e300, 0.0}) {
    for (const double expected : {0.0, 1e-320, 1.0, std::numeric_limits<double>::infinity()}) {
      EXPECT_TRUE(std::isfinite(model.log_density(range, expected))) << range << ' ' << expected;
    }
  }
}

TEST(BeamModel, too_far_from_the_map_no_beam_returns) {
  const BeamModel model({}, wall());
  Beams beams{{}, {0.1, 0.2}, {1.0, std::numeric_limits<double>::infinity()}};
  EXPECT_EQ(model.log_likelihood({1e20, 0.0, 0.0}, beams),
            model.log_likelihood({-1e6, 0.0, 0.0}, beams));
}

}  // namespace
}  // namespace locfuse::test_beam_model
