// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "locfuse/frontends/line_features.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse {
namespace {

using testing::cast;
using testing::Rng;
using testing::Walls;

constexpr double kDegree = kPi / 180.0;

/// A laser in the body's origin, a beam per degree over a field of view centred ahead.
LaserScan seen(const Walls& walls, const Pose2& body, int beams, double step = kDegree) {
  const auto geometry = std::make_shared<const LaserGeometry>(
      LaserGeometry{{}, -0.5 * (beams - 1) * step, step, 0.1, 20.0});
  LaserScan scan{0, geometry, {}};
  for (int i = 0; i < beams; ++i) {
    const double range =
        cast(walls, body.position(), body.heading + geometry->angle_min + i * step);
    scan.ranges.push_back(range < 20.0 ? range : std::numeric_limits<double>::quiet_NaN());
  }
  return scan;
}

/// Walls in x = 2 and y = 1.5 that meet in a corner.
const Walls kCorner = {{{2.0, -2.0}, {2.0, 1.5}}, {{-1.0, 1.5}, {2.0, 1.5}}};

TEST(LineFeatures, a_corner_is_two_lines_with_normals_into_the_walls) {
  LineFeaturesConfig config;
  config.tolerance_m = 1e-4;  // no return of one wall on the line of the other
  const std::vector<LineFeature> lines = scan_line_features(seen(kCorner, {}, 181), config);
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_GT(lines[0].line.half_length, lines[1].line.half_length);
  // Ahead: beams of -45 to 36 degrees; to the left: 37 to 90 degrees.
  EXPECT_NEAR(lines[0].line.r, 2.0, 1e-12);
  EXPECT_NEAR(lines[0].line.alpha, 0.0, 1e-12);
  EXPECT_EQ(lines[0].first, 45);
  EXPECT_EQ(lines[0].last, 126);
  EXPECT_NEAR(lines[0].line.half_length, 1.0 * (1.0 + std::tan(36.0 * kDegree)), 1e-9);
  EXPECT_NEAR(lines[1].line.r, 1.5, 1e-12);
  EXPECT_NEAR(lines[1].line.alpha, 0.5 * kPi, 1e-12);
  EXPECT_EQ(lines[1].first, 127);
  EXPECT_EQ(lines[1].last, 180);
}

TEST(LineFeatures, the_covariance_is_that_of_least_squares) {
  LineFeaturesConfig config;
  config.tolerance_m = 1e-4;
  config.min_sigma_m = 0.02;  // of points without noise
  const std::vector<LineFeature> lines = scan_line_features(seen(kCorner, {}, 181), config);
  ASSERT_EQ(lines.size(), 2U);
  double mean = 0.0;
  double square = 0.0;
  for (int degree = -45; degree <= 36; ++degree) {
    mean += 2.0 * std::tan(degree * kDegree) / 82.0;
  }
  for (int degree = -45; degree <= 36; ++degree) {
    square += std::pow(2.0 * std::tan(degree * kDegree) - mean, 2);
  }
  // By hand: y = a + b (x - mean) has variances sigma^2 / n and sigma^2 / sum of squares.
  Matrix<2, 2> expected;
  expected << 0.0004 / 82.0 + mean * mean * 0.0004 / square, mean * 0.0004 / square,
      mean * 0.0004 / square, 0.0004 / square;
  testing::expect_near(lines[0].covariance, expected, 1e-12);
}

TEST(LineFeatures, the_covariance_holds_over_many_scans) {
  const Walls wall = {{{3.0, -1.2}, {2.6, 1.4}}};
  const LaserScan exact = seen(wall, {}, 121, 0.25 * kDegree);
  const std::vector<LineFeature> truth = scan_line_features(exact);
  ASSERT_EQ(truth.size(), 1U);
  Rng rng(5);
  constexpr int kScans = 400;
  double nees = 0.0;
  double doubled = 0.0;
  for (int k = 0; k < kScans; ++k) {
    LaserScan scan = exact;
    for (double& range : scan.ranges) {
      range += testing::normal(rng, 0.015);
    }
    const std::vector<LineFeature> lines = scan_line_features(scan);
    ASSERT_EQ(lines.size(), 1U);
    const Vector<2> e(lines[0].line.r - truth[0].line.r,
                      angle_difference(lines[0].line.alpha, truth[0].line.alpha));
    nees += squared_mahalanobis(e, lines[0].covariance) / kScans;
    doubled += squared_mahalanobis(e, Matrix<2, 2>(4.0 * lines[0].covariance)) / kScans;
  }
  EXPECT_TRUE(testing::in_band(nees, 2, kScans, 0.99)) << nees;
  EXPECT_FALSE(testing::in_band(doubled, 2, kScans, 0.99));
}

TEST(LineFeatures, a_laser_that_turns_clockwise_sees_the_same) {
  const LaserScan scan = seen(kCorner, {0.2, -0.3, 0.4}, 181);
  LaserScan turned = scan;
  LaserGeometry geometry = *scan.geometry;
  geometry.angle_min = -geometry.angle_min;
  geometry.angle_increment = -geometry.angle_increment;
  turned.geometry = std::make_shared<const LaserGeometry>(geometry);
  std::reverse(turned.ranges.begin(), turned.ranges.end());
  const std::vector<LineFeature> lines = scan_line_features(scan);
  const std::vector<LineFeature> same = scan_line_features(turned);
  ASSERT_EQ(lines.size(), 2U);
  ASSERT_EQ(same.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(same[i].line.r, lines[i].line.r, 1e-9);
    EXPECT_NEAR(same[i].line.alpha, lines[i].line.alpha, 1e-9);
    EXPECT_EQ(same[i].first, 180 - lines[i].last);
    EXPECT_EQ(same[i].last, 180 - lines[i].first);
  }
}

TEST(LineFeatures, gaps_end_lines_and_short_ones_are_none) {
  const Walls walls = {
      {{2.0, -2.0}, {2.0, -0.3}}, {{2.0, 0.3}, {2.0, 2.0}}, {{1.0, 0.0}, {1.0, 0.1}}};
  const std::vector<LineFeature> lines = scan_line_features(seen(walls, {}, 181));
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_LT(lines[0].line.middle.y() * lines[1].line.middle.y(), 0.0);
  LaserScan nothing = seen({}, {}, 181);
  EXPECT_TRUE(scan_line_features(nothing).empty());
}

/// A room of 6 x 4 m with a pillar of 1 x 1 m, in cells of 10 cm, moved and turned.
OccupancyGrid room(const Pose2& origin) {
  std::vector<Cell> cells(62 * 42, Cell::kOccupied);
  for (int row = 1; row < 41; ++row) {
    for (int column = 1; column < 61; ++column) {
      const bool pillar = column >= 21 && column < 31 && row >= 11 && row < 21;
      cells[static_cast<std::size_t>(row * 62 + column)] = pillar ? Cell::kOccupied : Cell::kFree;
    }
  }
  return {62, 42, 0.1, origin, std::move(cells)};
}

TEST(LineFeatures, outlines_of_a_map_are_lines_with_normals_into_the_walls) {
  const std::vector<LineFeature> lines = map_line_features(room({}));
  ASSERT_EQ(lines.size(), 8U);
  const struct {
    double r;
    double alpha;
    double length;
  } expected[] = {{-0.1, -0.5 * kPi, 6.0}, {4.1, 0.5 * kPi, 6.0}, {6.1, 0.0, 4.0},
                  {-0.1, -kPi, 4.0},       {1.1, 0.5 * kPi, 1.0}, {-2.1, -0.5 * kPi, 1.0},
                  {2.1, 0.0, 1.0},         {-3.1, -kPi, 1.0}};
  for (const auto& wall : expected) {
    int found = 0;
    for (const LineFeature& feature : lines) {
      found +=
          static_cast<int>(std::abs(feature.line.r - wall.r) < 1e-9 &&
                           std::abs(angle_difference(feature.line.alpha, wall.alpha)) < 1e-9 &&
                           // Of two lines that meet, one has the corner.
                           std::abs(2.0 * feature.line.half_length - wall.length) < 0.1 + 1e-9);
    }
    EXPECT_EQ(found, 1) << wall.r << " " << wall.alpha;
  }
}

TEST(LineFeatures, lines_of_a_map_are_in_world) {
  const Pose2 origin{3.0, -2.0, 0.7};
  const std::vector<LineFeature> here = map_line_features(room({}));
  const std::vector<LineFeature> there = map_line_features(room(origin));
  ASSERT_EQ(there.size(), here.size());
  for (const LineFeature& feature : here) {
    const Line2& line = feature.line;
    int found = 0;
    for (const LineFeature& other : there) {
      const Vector<2> off = other.line.middle - origin.act(line.middle);
      found +=
          static_cast<int>(off.norm() < 1e-9 &&
                           std::abs(angle_difference(other.line.alpha, line.alpha + 0.7)) < 1e-9);
    }
    EXPECT_EQ(found, 1);
  }
}

TEST(LineFeatures, unknown_cells_are_no_walls) {
  const OccupancyGrid walled = room({});
  std::vector<Cell> cells = walled.cells();
  for (int row = 0; row < 42; ++row) {
    cells[static_cast<std::size_t>(row * 62 + 61)] = Cell::kUnknown;  // where x is 6.1
  }
  const std::vector<LineFeature> lines = map_line_features({62, 42, 0.1, {}, std::move(cells)});
  EXPECT_EQ(lines.size(), 7U);
  for (const LineFeature& feature : lines) {
    EXPECT_LT(feature.line.r, 6.0);
  }
}

TEST(LineFeatures, a_slanted_wall_is_lines_along_it_whatever_its_cells) {
  const Vector<2> a(1.0, 1.0);
  for (const double slope : {0.0, 0.03, 0.2, 0.77, 1.4}) {
    const Vector<2> b = a + 6.0 * Vector<2>(std::cos(slope), std::sin(slope));
    const auto grid = testing::map_of({{a, b}}, 200, 200, 0.05, {});
    double length = 0.0;
    for (const LineFeature& feature : map_line_features(*grid)) {
      const Line2& line = feature.line;
      length += 2.0 * line.half_length;
      EXPECT_LT(std::abs(std::sin(line.alpha - slope - 0.5 * kPi)), 0.04) << slope;
      EXPECT_LT(std::abs(line.normal().dot(a - line.middle)), 0.04 * 6.0 + 0.05) << slope;
    }
    EXPECT_GT(length, 10.5) << slope;  // of its two sides
    EXPECT_LT(length, 12.2) << slope;
  }
}

TEST(LineFeatures, settings_out_of_bounds_are_refused) {
  const LaserScan scan = seen(kCorner, {}, 5);
  LineFeaturesConfig config;
  config.tolerance_m = 0.0;
  testing::expect_refused([&] { (void)scan_line_features(scan, config); }, "tolerance_m is 0");
  config = {};
  config.min_points = 2;
  testing::expect_refused([&] { (void)map_line_features(room({}), config); }, "min_points is 2");
}

}  // namespace
}  // namespace locfuse
