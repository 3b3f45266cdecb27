// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/frontends/squared_range.hpp"
#include "support/expect.hpp"
#include "support/ranging.hpp"

namespace locfuse {
namespace {

using testing::Anchors;
using testing::expect_near;
using testing::Rng;
using testing::view;

template <int N>
double squared_cost(const RangeLayout<N>& layout, const std::vector<double>& ranges,
                    const Vector<N>& x) {
  double cost = 0.0;
  for (int i = 0; i < layout.size; ++i) {
    const double range = ranges[static_cast<std::size_t>(i)];
    const double error = layout.squared_distance(x, i) - range * range;
    cost += error * error;
  }
  return cost;
}

template <int N>
void expect_recovery(const Anchors& anchors, const Eigen::VectorXd& truth,
                     SquaredRangeWeights weights, double tolerance) {
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const RangeLayout<N> layout(anchors.table(), view(sigma));
  const std::vector<double> ranges = anchors.ranges_from(truth);
  const SquaredRangePosition<N> found = solve_squared_ranges<N>(layout, view(ranges), weights);
  ASSERT_EQ(found.count, 1);
  expect_near(Vector<N>(layout.centre + found.position[0]), truth, tolerance);
}

TEST(SquaredRange, recovers_the_position_from_exact_ranges) {
  Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    for (const auto weights : {SquaredRangeWeights::kEqual, SquaredRangeWeights::kVariance}) {
      expect_recovery<2>(testing::room(), testing::random_point(rng, 2), weights, 1e-9);
      Anchors cube = {{0, 0, 0, 10, 0, 10, 10, 10, 0, 0, 10, 10, 5, 5, 10}, 3, {}};
      expect_recovery<3>(cube, testing::random_point(rng, 3), weights, 1e-9);
      cube.height = 1.1;
      expect_recovery<2>(cube, testing::random_point(rng, 2), weights, 1e-9);
    }
  }
}

TEST(SquaredRange, recovers_the_position_in_coordinates_of_a_map_projection) {
  Anchors far = testing::room();
  for (std::size_t i = 0; i < far.rows.size(); ++i) {
    far.rows[i] += i % 2 == 0 ? 4.3e6 : 1e7;
  }
  expect_recovery<2>(far, Eigen::Vector2d(4.3e6 + 3.0, 1e7 + 4.0), SquaredRangeWeights::kEqual,
                     1e-8);
}

TEST(SquaredRange, is_the_global_minimum_of_the_squared_problem) {
  Rng rng(2);
  for (int trial = 0; trial < 50; ++trial) {
    const Anchors anchors = testing::random_anchors(rng, 4, 2);
    const std::vector<double> sigma = anchors.sigmas(0.1);
    const RangeLayout<2> layout(anchors.table(), view(sigma));
    std::vector<double> ranges = anchors.ranges_from(testing::random_point(rng, 2));
    testing::add_noise(rng, 1.0, ranges);
    const auto found = solve_squared_ranges<2>(layout, view(ranges));
    ASSERT_EQ(found.count, 1);
    const double minimum = squared_cost<2>(layout, ranges, found.position[0]);
    for (double x = -20.0; x <= 20.0; x += 0.25) {
      for (double y = -20.0; y <= 20.0; y += 0.25) {
        ASSERT_LE(minimum, squared_cost<2>(layout, ranges, {x, y}) * (1.0 + 1e-12));
      }
    }
  }
}

TEST(SquaredRange, returns_both_sides_of_anchors_on_a_line) {
  const Anchors line = {{0.0, 0.0, 3.0, 4.0, 6.0, 8.0, 9.0, 12.0}, 2, {}};
  const std::vector<double> sigma = line.sigmas(0.1);
  const RangeLayout<2> layout(line.table(), view(sigma));
  const Eigen::Vector2d truth(7.0, 1.0);
  const std::vector<double> ranges = line.ranges_from(truth);
  const auto found = solve_squared_ranges<2>(layout, view(ranges));
  ASSERT_EQ(found.count, 2);
  const Eigen::Vector2d u(0.6, 0.8);
  const Eigen::Vector2d mirrored = 2.0 * u.dot(truth) * u - truth;
  const Vector<2> first = layout.centre + found.position[0];
  const Vector<2> second = layout.centre + found.position[1];
  const bool in_order = (first - truth).norm() < (second - truth).norm();
  expect_near(in_order ? first : second, truth, 1e-9);
  expect_near(in_order ? second : first, mirrored, 1e-9);
}

TEST(SquaredRange, returns_nothing_where_a_whole_circle_fits) {
  const std::vector<double> ranges = {2.0, 2.0, 2.0};
  const Anchors point = {{1.0, 2.0, 1.0, 2.0, 1.0, 2.0}, 2, {}};
  const std::vector<double> sigma = point.sigmas(0.1);
  EXPECT_EQ(solve_squared_ranges<2>(RangeLayout<2>(point.table(), view(sigma)), view(ranges)).count,
            0);
  const Anchors line = {{0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0}, 3, {}};
  EXPECT_EQ(solve_squared_ranges<3>(RangeLayout<3>(line.table(), view(sigma)), view(ranges)).count,
            0);
}

TEST(SquaredRange, its_gain_is_the_derivative_of_the_position) {
  const Anchors anchors = testing::room();
  const std::vector<double> sigma = anchors.sigmas(0.1);
  const RangeLayout<2> layout(anchors.table(), view(sigma));
  const std::vector<double> ranges = anchors.ranges_from(Eigen::Vector2d(3.0, 4.0));
  const auto x = solve_squared_ranges<2>(layout, view(ranges)).position[0];
  RangeGain<2> gain;
  ASSERT_TRUE(squared_range_gain<2>(layout, x, view(ranges), SquaredRangeWeights::kEqual, gain));
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    std::vector<double> more = ranges;
    std::vector<double> less = ranges;
    more[i] += 1e-5;
    less[i] -= 1e-5;
    const Vector<2> slope = (solve_squared_ranges<2>(layout, view(more)).position[0] -
                             solve_squared_ranges<2>(layout, view(less)).position[0]) /
                            2e-5;
    expect_near(Vector<2>(gain.col(static_cast<Eigen::Index>(i))), slope, 1e-6);
  }
}

TEST(RangeLayout, rejects_invalid_layouts) {
  const auto refuse = [](const Anchors& anchors, double sigma, const auto&... words) {
    const std::vector<double> sigmas = anchors.sigmas(sigma);
    testing::expect_refused([&] { validate(anchors.table(), view(sigmas)); }, words...);
  };
  refuse({{0.0, std::nan("")}, 2, {}}, 0.1, "anchor 0", "nan");
  refuse({{0.0, 1.0}, 2, {}}, 0.0, "sigma of range 0", "0.0");
  refuse({{0.0, 1.0}, 2, {}}, std::nan(""), "sigma of range 0", "nan");
  refuse({{0.0, 1.0}, 2, 1.0}, 0.1, "height", "3 coordinates");
  refuse({std::vector<double>(2 * (kMaxRanges + 1), 1.0), 2, {}}, 0.1, "65 ranges", "64");
  refuse({{0.0, 1.0, 2.0, 3.0}, 4, {}}, 0.1, "4 coordinates", "2 or 3");
}

}  // namespace
}  // namespace locfuse
