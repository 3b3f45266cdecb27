// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "smoothing/range_unfolding.hpp"
#include "support/random.hpp"

namespace locfuse::test_range_unfolding {
namespace {

/// Ranges of four anchors, at other heights than the tag, to a tag on its way.
Eigen::MatrixXd ranges_along(double width, double sigma, std::uint64_t seed) {
  const double anchors[4][3] = {
      {0.0, 0.0, 1.0}, {8.0, 1.0, 0.5}, {7.0, 6.0, 2.0}, {-1.0, 5.0, 0.0}};
  testing::Rng rng(seed);
  Eigen::MatrixXd ranges(4, 200);
  for (int k = 0; k < 200; ++k) {
    const double x = 3.0 + 3.0 * std::sin(0.07 * k);
    const double y = 3.0 + width * std::cos(0.11 * k);
    for (int j = 0; j < 4; ++j) {
      const double* a = anchors[j];
      ranges(j, k) = std::hypot(x - a[0], y - a[1], a[2]) + testing::normal(rng, sigma);
    }
  }
  return ranges;
}

TEST(RangeUnfolding, without_noise_the_layout_is_exact) {
  const auto found = internal::unfold(ranges_along(2.0, 0.0, 1));
  ASSERT_TRUE(found);
  EXPECT_NEAR((found->anchors.row(1) - found->anchors.row(0)).norm(), std::hypot(8.0, 1.0), 1e-6);
  EXPECT_NEAR((found->anchors.row(3) - found->anchors.row(2)).norm(), std::hypot(8.0, 1.0), 1e-6);
  EXPECT_NEAR((found->anchors.row(2) - found->anchors.row(0)).norm(), std::hypot(7.0, 6.0), 1e-6);
  EXPECT_NEAR((found->tags.row(0) - found->anchors.row(0)).norm(), std::hypot(3.0, 5.0), 1e-6);
  EXPECT_NEAR(found->climb_squared(0), 1.0, 1e-6);
  EXPECT_NEAR(found->climb_squared(2), 4.0, 1e-6);
}

TEST(RangeUnfolding, gross_errors_are_left_out) {
  Eigen::MatrixXd ranges = ranges_along(2.0, 0.05, 2);
  for (int k = 0; k < 200; k += 10) {
    ranges(k / 10 % 4, k) += 3.0;
  }
  const auto found = internal::unfold(ranges);
  ASSERT_TRUE(found);
  EXPECT_NEAR((found->anchors.row(2) - found->anchors.row(0)).norm(), std::hypot(7.0, 6.0), 0.3);
  EXPECT_LT(found->tags.rows(), 185);
}

TEST(RangeUnfolding, a_line_or_too_few_anchors_are_not_unfolded) {
  EXPECT_FALSE(internal::unfold(ranges_along(0.0, 0.0, 1)));
  EXPECT_FALSE(internal::unfold(ranges_along(2.0, 0.0, 1).topRows(2)));
  EXPECT_FALSE(internal::unfold(ranges_along(2.0, 0.0, 1).leftCols(5)));
}

}  // namespace
}  // namespace locfuse::test_range_unfolding
