// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "locfuse/frontends/heading_start.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse {
namespace {

using testing::Rng;
using testing::uniform;
using Rows = std::vector<double>;

RangePosition<2> located(const Rows& anchors, const Rows& ranges, double sigma) {
  const auto size = static_cast<Eigen::Index>(ranges.size());
  const Eigen::VectorXd sigmas = Eigen::VectorXd::Constant(size, sigma);
  return locate_by_squares({RowsView(anchors.data(), size, 2), {}},
                           Eigen::Map<const Eigen::VectorXd>(ranges.data(), size), sigmas);
}

TEST(LocateBySquares, finds_a_position_from_three_anchors) {
  const RangePosition<2> found = located({0, 0, 8, 0, 4, 6}, {5.0, std::hypot(4.0, 3.0), 3.0}, 0.1);
  EXPECT_EQ(found.status, PositionStatus::kUnique);
  EXPECT_NEAR(found.position.x(), 4.0, 1e-9);
  EXPECT_NEAR(found.position.y(), 3.0, 1e-9);
}

TEST(LocateBySquares, refuses_what_leaves_a_position_open) {
  EXPECT_EQ(located({0, 0, 8, 0, 4, 0}, {5.0, 5.0, 3.0}, 0.1).status, PositionStatus::kAmbiguous);
  // Nearly in a line: the mirror image fits within the noise.
  EXPECT_EQ(located({0, 0, 8, 0, 4, 0.05}, {5.0, 5.0, 2.95}, 0.1).status,
            PositionStatus::kAmbiguous);
  EXPECT_EQ(located({0, 0, 0, 0, 0, 0}, {5.0, 5.0, 5.0}, 0.1).status,
            PositionStatus::kUnderdetermined);
  EXPECT_EQ(located({0, 0, 8, 0}, {4.0, 4.0}, 0.1).status, PositionStatus::kUnderdetermined);
  testing::expect_refused(
      [] {
        (void)located({0, 0, 8, 0, 4, 6}, {5.0, 5.0, 0.0}, 0.1);
      },
      "a range is 0");
}

TEST(LocateBySquares, is_less_sure_of_ranges_that_disagree) {
  const Rows anchors{0, 0, 10, 0, 10, 8, 0, 8};
  const double far = std::hypot(5.0, 4.0);
  const RangePosition<2> good = located(anchors, {far, far, far, far}, 0.1);
  const RangePosition<2> bad = located(anchors, {far, far, far + 2.0, far}, 0.1);
  EXPECT_EQ(bad.status, PositionStatus::kUnique);
  EXPECT_GT(bad.covariance.trace(), 20.0 * good.covariance.trace());
  const Vector<2> error = bad.position - Vector<2>(5.0, 4.0);
  EXPECT_LT(error.dot(bad.covariance.inverse() * error), 9.0);
  EXPECT_GT(error.dot(good.covariance.inverse() * error), 9.0);
}

TEST(HeadingStart, errs_as_much_as_it_believes_about_a_tag_beside_the_middle) {
  int found = 0;
  int wrong = 0;
  double nees = 0.0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Rng rng(seed);
    const testing::Room room = testing::random_room(rng);
    const ScanMatcher matcher(room.map);
    const Pose2 body = room.middle * Pose2{uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0),
                                           uniform(rng, -kPi, kPi)};
    const LaserScan scan = testing::scan_from(room.walls, body, rng, 0.01);
    const Vector<2> tag(0.3, -0.4);
    const double sigma = 0.15;
    const double east = testing::normal(rng, sigma);  // one by one: the same on every compiler
    const double north = testing::normal(rng, sigma);
    const Vector<2> at = body.act(tag) + Vector<2>(east, north);
    const HeadingStart start = start_by_headings(matcher, scan, {at, sigma, tag});
    if (start.headings.size() != 1) {
      continue;
    }
    ++found;
    EXPECT_EQ(start.headings[0], *start.search.heading);
    const double error = angle_difference(start.headings[0], body.heading);
    wrong += std::abs(error) > 0.4 ? 1 : 0;
    nees += error * error / (start.sigma * start.sigma);
  }
  EXPECT_GE(found, 75);
  EXPECT_EQ(wrong, 0);
  EXPECT_TRUE(testing::in_band(nees / found, 1, found, 0.999)) << nees / found;
}

TEST(HeadingStart, finds_four_headings_in_the_middle_of_a_square_and_all_in_a_round_room) {
  Rng rng(3);
  testing::Walls square;
  testing::add_box(square, {}, 8.0, 8.0);
  const auto in_square = testing::map_of(square, 200, 200, 0.05, {-5.0, -5.0, 0.0});
  const auto laser =
      std::make_shared<const LaserGeometry>(LaserGeometry{{}, -kPi, 2.0 * kPi / 360, 0.1, 12.0});
  const LaserScan corners = testing::scan_from(square, {0.0, 0.0, 0.3}, rng, 0.01, laser);
  const HeadingStart four =
      start_by_headings(ScanMatcher(in_square), corners, {{0.0, 0.0}, 0.05, {0.0, 0.0}});
  EXPECT_GE(four.headings.size(), 4U);

  testing::Walls ring;
  for (int k = 0; k < 360; ++k) {
    const double a = k * kPi / 180.0;
    const double b = (k + 1) * kPi / 180.0;
    ring.emplace_back(4.0 * Vector<2>(std::cos(a), std::sin(a)),
                      4.0 * Vector<2>(std::cos(b), std::sin(b)));
  }
  const auto round = testing::map_of(ring, 200, 200, 0.05, {-5.0, -5.0, 0.0});
  const LaserScan arc = testing::scan_from(ring, {0.0, 0.0, 0.3}, rng, 0.01, laser);
  const HeadingStart all =
      start_by_headings(ScanMatcher(round), arc, {{0.0, 0.0}, 0.05, {0.0, 0.0}});
  EXPECT_EQ(all.headings.size(), 32U);  // all that are 30 degrees or more from the best, and it
}

TEST(HeadingStart, finds_none_on_another_map_or_without_returns) {
  Rng rng(1);
  const testing::Room room = testing::random_room(rng);
  LaserScan scan = testing::scan_from(room.walls, room.middle, rng, 0.01);
  testing::Walls hall;
  testing::add_box(hall, {}, 15.0, 14.0);
  const ScanMatcher other(testing::map_of(hall, 320, 320, 0.05, {-8.0, -8.0, 0.0}));
  const Pivot pivot{room.middle.position(), 0.1, {0.0, 0.0}};
  const HeadingStart lost = start_by_headings(other, scan, pivot);
  EXPECT_TRUE(lost.headings.empty());
  EXPECT_GT(lost.distance, lost.limit);
  std::fill(scan.ranges.begin(), scan.ranges.end(), std::nan(""));
  const HeadingStart blind = start_by_headings(other, scan, pivot);
  EXPECT_TRUE(blind.headings.empty());
  EXPECT_EQ(blind.search.reason, HeadingSearch::Reason::kNoReturns);
}

}  // namespace
}  // namespace locfuse
