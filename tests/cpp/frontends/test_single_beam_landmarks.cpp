// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <vector>

#include "locfuse/frontends/single_beam_landmarks.hpp"
#include "support/discs.hpp"
#include "support/expect.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;
using testing::Rng;
using testing::scan_of;
using testing::turning_laser;

TEST(ClosestBeam, adds_the_radius_to_the_shortest_range) {
  LaserScan scan{0, turning_laser(), std::vector<double>(360, std::nan(""))};
  scan.ranges[200] = 1.6;
  scan.ranges[201] = 1.5;
  scan.ranges[202] = 1.7;
  const BeamLandmark found = closest_beam(scan, 199, 203, 0.25);
  EXPECT_EQ(found.beam, 201);
  EXPECT_DOUBLE_EQ(found.range, 1.75);
  EXPECT_NEAR(found.bearing, 21.0 * kPi / 180.0, 1e-12);
  EXPECT_EQ(closest_beam(scan, 203, 199, 0.25).beam, -1);  // all others, across the end
  EXPECT_EQ(closest_beam(scan, 203, 200, 0.25).beam, 200);
}

TEST(ClosestBeam, rejects_invalid_input) {
  const LaserScan scan{0, turning_laser(), {1.0, 2.0}};
  expect_refused([&] { (void)closest_beam(scan, 0, 2, 0.1); }, "last is beam 2", "the 2 of");
  expect_refused([&] { (void)closest_beam(scan, -1, 1, 0.1); }, "first is beam -1");
  expect_refused([&] { (void)closest_beam(scan, 0, 1, -0.1); }, "-0.1 m", ">= 0");
}

TEST(RecognizeLandmarks, returns_beams_of_visible_landmarks_and_minus_one_for_others) {
  Rng rng(1);
  const std::vector<testing::Disc> discs{{{3.0, 0.0}, 0.5}, {{6.0, 0.0}, 0.4}, {{0.0, 2.0}, 0.3}};
  const LandmarkMap landmarks({{0, discs[0].centre, discs[0].radius},
                               {1, discs[1].centre, discs[1].radius},
                               {2, discs[2].centre, discs[2].radius}});
  const Pose2 robot{1.0, 0.0, kPi / 2.0};
  const LaserScan scan = scan_of(discs, {}, robot, rng, 0.0, turning_laser());
  const std::vector<BeamLandmark> seen = recognize_landmarks(scan, robot, landmarks);
  ASSERT_EQ(seen.size(), 3U);
  EXPECT_EQ(seen[0].beam, 90);
  EXPECT_NEAR(seen[0].range, 1.5, 1e-9);
  EXPECT_NEAR(seen[0].bearing, -kPi / 2.0, 1e-9);
  EXPECT_EQ(seen[1].beam, -1);  // hidden behind the first
  EXPECT_EQ(seen[1].range, -1.0);
  EXPECT_NEAR(seen[2].range, std::sqrt(5.0) - 0.3, 1e-3);
}

TEST(RecognizeLandmarks, a_landmark_around_the_laser_has_no_beam) {
  const LaserScan scan{0, turning_laser(), std::vector<double>(360, 0.2)};
  const std::vector<BeamLandmark> seen =
      recognize_landmarks(scan, {}, LandmarkMap({{0, {0.0, 0.0}, 0.3}, {1, {0.1, 0.0}, 0.1}}));
  EXPECT_EQ(seen[0].beam, -1);
  EXPECT_EQ(seen[1].beam, -1);
}

TEST(RecognizeLandmarks, rejects_invalid_input) {
  const LaserScan scan{0, turning_laser(), {1.0}};
  expect_refused([&] { (void)recognize_landmarks(scan, {std::nan(""), 0.0, 0.0}, {}); }, "pose");
}

}  // namespace
}  // namespace locfuse
