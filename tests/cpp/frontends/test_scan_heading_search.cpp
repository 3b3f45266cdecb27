// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/frontends/heading_search.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse {
namespace {

using testing::Rng;
using testing::uniform;

TEST(HeadingSearch, equals_the_loops_of_the_paper_and_look_ups_to_half_a_cell) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Rng rng(seed);
    const testing::Room room = testing::random_room(rng);
    const ScanMap map(room.map);
    const Pose2 body = room.middle * Pose2{0.3, -0.4, uniform(rng, -kPi, kPi)};
    const LaserScan scan = testing::scan_from(room.walls, body, rng, 0.01);
    const HeadingSearch found = heading_search(map, scan, body.position());
    const HeadingSearch looked_up = heading_search_by_lookup(map, scan, body.position());
    ASSERT_TRUE(found.heading && looked_up.heading);
    double smallest = 1e300;
    double heading = 0.0;
    for (int step = 0; step < 36; ++step) {
      const Pose2 turned{body.x, body.y, step * kPi / 18.0};
      double sum = 0.0;
      bool on_field = true;
      for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
        if (std::isnan(scan.ranges[i])) {
          continue;
        }
        const double angle =
            scan.geometry->angle_min + static_cast<double>(i) * scan.geometry->angle_increment;
        const Vector<2> p_laser(scan.ranges[i] * std::cos(angle), scan.ranges[i] * std::sin(angle));
        const Vector<2> end = (turned * scan.geometry->pose_in_body).act(p_laser);
        sum += map.occupied().nearest(end).distance;
        on_field = on_field && room.map->contains(end);
      }
      if (sum < smallest) {
        smallest = sum;
        heading = turned.heading;
      }
      const auto k = static_cast<std::size_t>(step);
      EXPECT_NEAR(found.sums[k], sum, 1e-4);
      EXPECT_NEAR(looked_up.sums[k], sum, (on_field ? 0.036 : 0.15) * 360);
    }
    EXPECT_NEAR(angle_difference(*found.heading, heading), 0.0, 1e-12);
    EXPECT_LT(std::abs(angle_difference(*found.heading, body.heading)), 0.175);
    EXPECT_EQ(*looked_up.heading, *found.heading);
  }
}

TEST(HeadingSearch, looks_up_beams_that_end_far_beyond_the_map) {
  Rng rng(2);
  const testing::Room room = testing::random_room(rng);
  const ScanMap map(room.map);
  LaserScan scan = testing::scan_from(room.walls, room.middle, rng, 0.01);
  LaserGeometry geometry = *scan.geometry;
  geometry.range_max = 1e4;
  scan.geometry = std::make_shared<const LaserGeometry>(geometry);
  for (std::size_t i = 0; i < scan.ranges.size(); i += 3) {
    scan.ranges[i] = 900.0;
  }
  const HeadingSearch found = heading_search(map, scan, room.middle.position());
  const HeadingSearch looked_up = heading_search_by_lookup(map, scan, room.middle.position());
  for (std::size_t k = 0; k < found.sums.size(); ++k) {
    EXPECT_NEAR(looked_up.sums[k], found.sums[k], 0.036 * 360);
  }
  EXPECT_EQ(*looked_up.heading, *found.heading);
}

TEST(HeadingSearch, reports_why_there_is_none) {
  Rng rng(1);
  const testing::Room room = testing::random_room(rng);
  const ScanMap map(room.map);
  LaserScan scan = testing::scan_from(room.walls, room.middle, rng, 0.01);
  const HeadingSearch outside = heading_search(map, scan, {100.0, 0.0});
  EXPECT_EQ(outside.reason, HeadingSearch::Reason::kOutsideMap);
  EXPECT_FALSE(outside.heading);
  std::fill(scan.ranges.begin(), scan.ranges.end(), std::nan(""));
  EXPECT_EQ(heading_search(map, scan, room.middle.position()).reason,
            HeadingSearch::Reason::kNoReturns);
  std::fill(scan.ranges.begin(), scan.ranges.end(), scan.geometry->range_max);  // maximum range
  EXPECT_EQ(heading_search(map, scan, room.middle.position()).reason,
            HeadingSearch::Reason::kNoReturns);
  scan.ranges.clear();
  EXPECT_FALSE(heading_search_by_lookup(map, scan, room.middle.position()).heading);
  testing::expect_refused([&] { (void)heading_search(map, scan, {std::nan(""), 0.0}); }, "nan");
}

}  // namespace
}  // namespace locfuse
