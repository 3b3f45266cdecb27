// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/frontends/scan_matcher.hpp"
#include "support/expect.hpp"
#include "support/rooms.hpp"

namespace locfuse {
namespace {

using testing::expect_refused;
using testing::normal;
using testing::Rng;
using testing::uniform;
using testing::Walls;
using Status = ScanSearch::Status;

Matrix<2, 2> round(double sigma) { return sigma * sigma * Matrix<2, 2>::Identity(); }

bool close(const Pose2& a, const Pose2& b) {
  const Vector<3> e = local(a, b);
  return e.head<2>().norm() < 0.05 && std::abs(e.z()) < 0.02;
}

TEST(ScanSearch, finds_the_heading_and_is_never_ready_when_wrong) {
  int ready = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Rng rng(seed);
    const testing::Room room = testing::random_room(rng);
    const ScanMatcher matcher(room.map);
    const Pose2 truth = room.middle * Pose2{uniform(rng, -1.5, 1.5), uniform(rng, -1.0, 0.6),
                                            uniform(rng, -kPi, kPi)};
    const LaserScan scan = testing::scan_from(room.walls, truth, rng, 0.01);
    const double sigma = seed % 3 == 0 ? 0.5 : 0.1;
    const Vector<2> fix = truth.position() + Vector<2>{normal(rng, sigma), normal(rng, sigma)};
    const ScanSearch found = matcher.search(scan, fix, round(sigma));
    ASSERT_FALSE(found.hypotheses.empty());
    if (found.status == Status::kReady) {
      ++ready;
      EXPECT_TRUE(close(found.hypotheses[0].match.pose, truth)) << seed;
    }
  }
  EXPECT_GE(ready, 58);
}

TEST(ScanSearch, searches_the_map_for_a_fix_of_any_sigma) {
  Rng rng(5);
  const testing::Room room = testing::random_room(rng);
  const ScanMatcher matcher(room.map);
  const LaserScan scan = testing::scan_from(room.walls, room.middle, rng, 0.01);
  for (const double sigma : {1e3, 1e8, 1e12, 1e100}) {
    for (const double off : {0.0, sigma}) {
      const Vector<2> fix = room.middle.position() + Vector<2>(off, -off);
      const ScanSearch found = matcher.search(scan, fix, round(sigma));
      ASSERT_FALSE(found.hypotheses.empty()) << sigma << ' ' << off;
      EXPECT_TRUE(close(found.hypotheses[0].match.pose, room.middle)) << sigma << ' ' << off;
    }
  }
}

TEST(ScanSearch, returns_both_headings_of_a_symmetric_room) {
  int both = 0;
  for (std::uint64_t seed = 0; seed < 15; ++seed) {
    Rng rng(seed);
    const Pose2 middle{0.0, 0.0, uniform(rng, -kPi, kPi)};
    Walls walls;
    testing::add_box(walls, middle, 6.0, 4.0);
    const ScanMatcher matcher(testing::map_of(walls, 200, 200, 0.05, {-5.0, -5.0, 0.0}));
    const Pose2 truth = retract(middle, {0.0, 0.0, uniform(rng, -kPi, kPi)});
    const LaserScan scan = testing::scan_from(walls, truth, rng, 0.01);
    const ScanSearch found = matcher.search(
        scan, truth.position() + Vector<2>{normal(rng, 0.1), normal(rng, 0.1)}, round(0.1));
    EXPECT_EQ(found.status, Status::kAmbiguous);
    EXPECT_EQ(found.reason, ScanSearch::Reason::kSeveralFit);
    ASSERT_GE(found.hypotheses.size(), 2U);
    const Pose2 mirrored = retract(truth, {0.0, 0.0, kPi});
    int seen = 0;
    for (const ScanHypothesis& hypothesis : found.hypotheses) {
      // The laser is mounted off the axis of the body, so the mirrored scan is 10 cm off.
      const Vector<3> a = local(hypothesis.match.pose, truth);
      const Vector<3> b = local(hypothesis.match.pose, mirrored);
      seen |= a.head<2>().norm() < 0.05 && std::abs(a.z()) < 0.02 ? 1 : 0;
      seen |= b.head<2>().norm() < 0.15 && std::abs(b.z()) < 0.02 ? 2 : 0;
    }
    both += static_cast<int>(seen == 3);
  }
  EXPECT_EQ(both, 15);
}

TEST(ScanSearch, a_box_that_breaks_the_symmetry_decides) {
  Rng rng(3);
  Walls walls;
  testing::add_box(walls, {0.0, 0.0, 0.2}, 6.0, 4.0);
  testing::add_box(walls, Pose2{0.0, 0.0, 0.2} * Pose2{2.0, 1.0, 0.0}, 0.8, 0.8);
  const ScanMatcher matcher(testing::map_of(walls, 200, 200, 0.05, {-5.0, -5.0, 0.0}));
  const Pose2 truth{0.0, 0.1, 2.0};
  const ScanSearch found =
      matcher.search(testing::scan_from(walls, truth, rng, 0.01), {0.05, 0.0}, round(0.1));
  EXPECT_EQ(found.status, Status::kReady);
  EXPECT_TRUE(close(found.hypotheses[0].match.pose, truth));
  EXPECT_GT(found.hypotheses[0].probability, 0.999);
}

TEST(ScanSearch, a_round_room_has_no_heading) {
  Rng rng(3);
  Walls walls;
  for (int i = 0; i < 180; ++i) {
    const double a = i * kPi / 90.0;
    const double b = (i + 1) * kPi / 90.0;
    walls.push_back(
        {{3.0 * std::cos(a), 3.0 * std::sin(a)}, {3.0 * std::cos(b), 3.0 * std::sin(b)}});
  }
  const ScanMatcher matcher(testing::map_of(walls, 200, 200, 0.05, {-5.0, -5.0, 0.0}));
  const ScanSearch found =
      matcher.search(testing::scan_from(walls, {0.0, 0.0, 1.0}, rng, 0.01), {0.0, 0.0}, round(0.1));
  EXPECT_EQ(found.status, Status::kAmbiguous);
}

TEST(ScanSearch, a_scan_of_another_place_is_not_ready) {
  int ready = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const testing::Room room = testing::random_room(rng);
    const ScanMatcher matcher(room.map);
    Walls elsewhere;
    testing::add_box(elsewhere, {0.0, 0.0, 0.0}, 3.0, 14.0);
    testing::add_box(elsewhere, {1.0, 2.0, 0.5}, 0.5, 0.5);
    const LaserScan scan = testing::scan_from(elsewhere, {0.2, -0.3, 0.1}, rng, 0.01);
    ready += static_cast<int>(matcher.search(scan, room.middle.position(), round(0.1)).status ==
                              Status::kReady);
  }
  EXPECT_EQ(ready, 0);
}

TEST(ScanSearch, reports_why_there_is_none) {
  Rng rng(1);
  const testing::Room room = testing::random_room(rng);
  const ScanMatcher matcher(room.map);
  LaserScan scan = testing::scan_from(room.walls, room.middle, rng, 0.01);
  const ScanSearch outside = matcher.search(scan, {100.0, 0.0}, round(0.1));
  EXPECT_EQ(outside.status, Status::kNone);
  EXPECT_EQ(outside.reason, ScanSearch::Reason::kOutsideMap);
  EXPECT_TRUE(outside.hypotheses.empty());
  std::fill(scan.ranges.begin(), scan.ranges.end(), std::nan(""));
  EXPECT_EQ(matcher.search(scan, room.middle.position(), round(0.1)).reason,
            ScanSearch::Reason::kNoReturns);
  expect_refused([&] { (void)matcher.search(scan, {std::nan(""), 0.0}, round(0.1)); }, "position");
  expect_refused([&] { (void)matcher.search(scan, {0.0, 0.0}, -round(0.1)); }, "positive definite");
  // A fuzzer's variance of 9e-323 had an infinite inverse, and the window's size was NaN.
  const Matrix<2, 2> line = Vector<2>(8.9e-323, 0.01).asDiagonal();
  expect_refused([&] { (void)matcher.search(scan, {0.0, 0.0}, line); }, "too small");
}

TEST(ScanSearch, any_covariance_has_a_window) {
  const Pose2 origin = Pose2{0.0, 0.0, 2.9213757623126906} * Pose2{-4.8, -4.0, 0.0};
  const Walls walls = testing::room_around({});
  const ScanMatcher matcher(testing::map_of(walls, 48, 40, 0.2, origin));
  Rng rng(1);
  const LaserScan scan = testing::scan_from(walls, {1.0, -1.0, 0.3}, rng, 0.01);
  Matrix<2, 2> thin;  // 50 m by 1 cm, whose inverse turned to the map has no positive determinant
  thin << 2460.1044308555333, 0.6209479835398285, 0.6209479835398285, 0.0001567317197701639;
  Matrix<2, 2> tiny;
  tiny << 1e-160, 0.5e-160, 0.5e-160, 1e-160;
  for (const Matrix<2, 2>& covariance : {thin, tiny}) {
    double total = 0.0;
    for (const ScanHypothesis& found : matcher.search(scan, {1.0, -1.0}, covariance).hypotheses) {
      total += found.probability;
    }
    EXPECT_LE(total, 1.0 + 1e-9);
  }
  EXPECT_EQ(matcher.search(scan, {1.7e308, -1.0}, 1e154 * Matrix<2, 2>::Identity()).reason,
            ScanSearch::Reason::kOutsideMap);
}

/// A beam of 1000 km on cells of 0.45 mm ends beyond integers.
TEST(ScanSearch, a_beam_that_ends_beyond_integers_ends_in_unknown_space) {
  constexpr int kSide = 100;
  std::vector<Cell> cells(kSide * kSide, Cell::kFree);
  for (std::size_t i = 0; i < kSide; ++i) {
    cells[i] = cells[i * kSide] = Cell::kOccupied;  // below and on the left
  }
  const ScanMatcher matcher(
      std::make_shared<const OccupancyGrid>(kSide, kSide, 4.5e-4, Pose2{}, std::move(cells)));
  const Walls walls{{{0.0, 0.0}, {0.045, 0.0}}, {{0.0, 0.0}, {0.0, 0.045}}};
  Rng rng(1);
  const auto laser =
      std::make_shared<const LaserGeometry>(LaserGeometry{{}, -kPi, 2.0 * kPi / 360.0, 0.0, 1e6});
  LaserScan scan = testing::scan_from(walls, {0.02, 0.02, 0.0}, rng, 0.0, laser);
  scan.ranges[180] = 999999.0;
  EXPECT_FALSE(matcher.search(scan, {0.02, 0.02}, round(1e-3)).hypotheses.empty());
}

}  // namespace
}  // namespace locfuse
