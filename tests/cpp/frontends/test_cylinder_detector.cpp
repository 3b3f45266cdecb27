// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "locfuse/frontends/cylinder_detector.hpp"
#include "locfuse/frontends/single_beam_landmarks.hpp"
#include "support/discs.hpp"
#include "support/expect.hpp"

namespace locfuse {
namespace {

using testing::add_box;
using testing::cylinders_of_wells;
using testing::Disc;
using testing::expect_refused;
using testing::normal;
using testing::Rng;
using testing::scan_of;
using testing::turning_laser;
using testing::uniform;
using testing::Walls;

CylinderDetectorConfig of_radius(double radius, int least_beams = 7) {
  CylinderDetectorConfig config;
  config.radius_m = radius;
  config.least_beams = least_beams;
  return config;
}

Vector<2> at(double range, double bearing) {
  return range * Vector<2>(std::cos(bearing), std::sin(bearing));
}

Vector<2> centre_of(const Cylinder& cylinder) { return at(cylinder.range, cylinder.bearing); }

/// Scan of one disc from the origin.
LaserScan scan_of_one(const Disc& disc, Rng& rng, double sigma = 0.01, const Walls& walls = {}) {
  return scan_of({disc}, walls, {}, rng, sigma, turning_laser());
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Beams that end on a disc.
int beams_on(const Disc& disc, const std::vector<Disc>& all, const Pose2& eye) {
  int count = 0;
  for (int i = 0; i < 360; ++i) {
    const double angle = eye.heading - kPi + i * kPi / 180.0;
    const double range = testing::cast(std::vector<Disc>{disc}, eye.position(), angle);
    count += std::isfinite(range) && range <= testing::cast(all, eye.position(), angle) ? 1 : 0;
  }
  return count;
}

/// Positions of a robot among the cylinders of wells.
Pose2 among_cylinders(Rng& rng) {
  for (;;) {
    const Pose2 eye{uniform(rng, -3.8, 3.8), uniform(rng, -3.8, 3.8), uniform(rng, -kPi, kPi)};
    const Vector<2> nearest(std::copysign(2.0, eye.x), std::copysign(2.0, eye.y));
    if ((eye.position() - nearest).norm() > 1.3) {
      return eye;
    }
  }
}

TEST(CylinderDetector, finds_a_cylinder_exactly_without_noise) {
  Rng rng(1);
  const LaserScan scan = scan_of_one({{2.0, 0.0}, 0.5}, rng, 0.0);
  for (const double radius : {0.0, 0.5}) {
    const std::vector<Cylinder> found = CylinderDetector(of_radius(radius)).detect(scan);
    ASSERT_EQ(found.size(), 1U);
    // asin(0.5 / 2) is 14.48 degrees: beams of -14 to 14 degrees hit it.
    EXPECT_EQ(found[0].first, 166);
    EXPECT_EQ(found[0].last, 194);
    EXPECT_EQ(found[0].beams, 29);
    EXPECT_NEAR(found[0].range, 2.0, 1e-3);
    EXPECT_NEAR(found[0].bearing, 0.0, 1e-9);
    EXPECT_NEAR(found[0].radius, 0.5, 1e-3);
    EXPECT_LT(found[0].misfit, 0.1);
    EXPECT_EQ(found[0].covariance(2, 2) == 0.0, radius > 0.0);
  }
}

TEST(CylinderDetector, detects_a_cylinder_across_the_end_of_the_scan) {
  Rng rng(2);
  const std::vector<Cylinder> found =
      CylinderDetector().detect(scan_of_one({{-2.0, 0.0}, 0.5}, rng));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].first, 346);
  EXPECT_EQ(found[0].last, 14);
  EXPECT_NEAR(std::abs(found[0].bearing), kPi, 0.01);
}

TEST(CylinderDetector, a_laser_that_turns_clockwise_gives_the_same) {
  Rng rng(3);
  LaserScan scan = scan_of_one({{1.5, 1.0}, 0.4}, rng);
  const std::vector<Cylinder> expected = CylinderDetector().detect(scan);
  LaserGeometry clockwise = *scan.geometry;
  clockwise.angle_min = clockwise.angle_min + 359 * clockwise.angle_increment;
  clockwise.angle_increment *= -1.0;
  scan.geometry = std::make_shared<const LaserGeometry>(clockwise);
  std::reverse(scan.ranges.begin(), scan.ranges.end());
  const std::vector<Cylinder> found = CylinderDetector().detect(scan);
  ASSERT_EQ(found.size(), 1U);
  ASSERT_EQ(expected.size(), 1U);
  EXPECT_NEAR(found[0].range, expected[0].range, 1e-9);
  EXPECT_NEAR(found[0].bearing, expected[0].bearing, 1e-9);
  EXPECT_EQ(found[0].first, 359 - expected[0].first);
  EXPECT_EQ(found[0].last, 359 - expected[0].last);
}

TEST(CylinderDetector, beams_beyond_a_full_turn_count_once) {
  Rng rng(4);
  LaserScan scan = scan_of_one({{-2.0, 0.0}, 0.5}, rng);
  const std::vector<Cylinder> expected = CylinderDetector().detect(scan);
  scan.ranges.push_back(scan.ranges.front());
  const std::vector<Cylinder> found = CylinderDetector().detect(scan);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].range, expected[0].range);
}

/// Errors of centres in the world of wells, by the detector and by the closest beam of its arc.
struct Errors {
  std::vector<double> ours, closest;
  int missed = 0;
  int false_ones = 0;
};

Errors errors_in_wells(const CylinderDetectorConfig& config, int scans) {
  const std::vector<Disc> discs = cylinders_of_wells();
  const CylinderDetector detector(config);
  Errors errors;
  Rng rng(5);
  for (int k = 0; k < scans; ++k) {
    const Pose2 eye = among_cylinders(rng);
    const LaserScan scan = scan_of(discs, {}, eye, rng, 0.01, turning_laser());
    const std::vector<Cylinder> found = detector.detect(scan);
    int matched = 0;
    for (const Disc& disc : discs) {
      const Vector<2> centre = inverse(eye).act(disc.centre);
      const auto it = std::find_if(found.begin(), found.end(), [&](const Cylinder& c) {
        return (centre_of(c) - centre).norm() < 0.5;
      });
      matched += it != found.end() ? 1 : 0;
      if (beams_on(disc, discs, eye) < 8) {
        continue;
      }
      if (it == found.end()) {
        ++errors.missed;
      } else if (centre.norm() < 3.5) {
        const BeamLandmark beam = closest_beam(scan, it->first, it->last, 1.0);
        errors.ours.push_back((centre_of(*it) - centre).norm());
        errors.closest.push_back((at(beam.range, beam.bearing) - centre).norm());
      }
    }
    errors.false_ones += static_cast<int>(found.size()) - matched;
  }
  return errors;
}

TEST(CylinderDetector, detects_all_in_the_world_of_wells_with_centres_to_5_mm) {
  for (const double radius : {0.0, 1.0}) {
    const Errors errors = errors_in_wells(of_radius(radius), 500);
    EXPECT_EQ(errors.missed, 0) << radius;
    EXPECT_EQ(errors.false_ones, 0) << radius;
    EXPECT_GT(errors.ours.size(), 800U);
    EXPECT_LT(median(errors.ours), radius > 0.0 ? 0.002 : 0.005);
    EXPECT_GT(median(errors.closest), 4.0 * median(errors.ours));
    EXPECT_GT(median(errors.closest), 0.05);
  }
}

TEST(CylinderDetector, a_wrong_radius_breaks_the_accuracy_of_a_known_one) {
  Rng rng(6);
  CylinderDetectorConfig wrong = of_radius(0.32);
  std::vector<double> with_right;
  std::vector<double> with_wrong;
  for (int k = 0; k < 200; ++k) {
    const Vector<2> centre = at(uniform(rng, 1.0, 2.5), uniform(rng, -kPi, kPi));
    const LaserScan scan = scan_of_one({centre, 0.3}, rng);
    for (const Cylinder& c : CylinderDetector(of_radius(0.3)).detect(scan)) {
      with_right.push_back((centre_of(c) - centre).norm());
    }
    for (const Cylinder& c : CylinderDetector(wrong).detect(scan)) {
      with_wrong.push_back((centre_of(c) - centre).norm());
    }
  }
  EXPECT_GE(with_right.size(), 195U);
  EXPECT_LT(median(with_right), 0.004);
  EXPECT_TRUE(with_wrong.size() < 20U || median(with_wrong) > 0.008);
}

/// Mean squared error in units of the covariance; of (range, bearing), or with the radius if that
/// is free.
double nees(const CylinderDetectorConfig& config, double radius, double nearest, double farthest,
            double sigma = 0.01) {
  const CylinderDetector detector(config);
  double sum = 0.0;
  int count = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    Rng rng(seed);
    const double range = radius + uniform(rng, nearest, farthest);
    const double bearing = uniform(rng, -kPi, kPi);
    for (const Cylinder& c :
         detector.detect(scan_of_one({at(range, bearing), radius}, rng, sigma))) {
      const Vector<3> e(c.range - range, angle_difference(c.bearing, bearing), c.radius - radius);
      const int n = config.radius_m > 0.0 ? 2 : 3;
      sum += e.head(n).dot(c.covariance.topLeftCorner(n, n).llt().solve(e.head(n)));
      ++count;
    }
  }
  EXPECT_GE(count, 300);
  return sum / count;
}

TEST(CylinderDetector, errors_match_the_covariance) {
  // 99.9 % of the mean of 400 draws of two degrees of freedom: 2 +- 0.33; of three: 3 +- 0.40.
  for (const double radius : {0.2, 0.5, 1.0}) {
    EXPECT_NEAR(nees(of_radius(radius), radius, 0.5, radius < 0.3 ? 2.0 : 3.5), 2.0, 0.33)
        << radius;
    EXPECT_NEAR(nees({}, radius, 0.5, radius < 0.3 ? 2.0 : 3.5), 3.0, 0.45) << radius;
  }
}

TEST(CylinderDetector, errors_match_the_covariance_with_few_beams_on_thin_poles) {
  for (const double radius : {0.03, 0.1}) {
    CylinderDetectorConfig config = of_radius(radius, 1);
    config.least_corner_evidence = -20.0;
    EXPECT_NEAR(nees(config, radius, 0.5, radius < 0.05 ? 3.0 : 10.0), 2.0, 0.33) << radius;
  }
}

CylinderDetectorConfig by(CylinderMethod method, double radius, int least_beams = 7) {
  CylinderDetectorConfig config = of_radius(radius, least_beams);
  config.method = method;
  return config;
}

TEST(CylinderDetector, errors_of_single_beams_match_the_covariance) {
  for (const CylinderMethod method : {CylinderMethod::kClosestBeam, CylinderMethod::kCone}) {
    for (const double radius : {0.2, 0.5, 1.0}) {
      for (const double sigma : {0.001, 0.01}) {
        CylinderDetectorConfig config = by(method, radius);
        config.sigma_range_m = sigma;
        const double farthest = radius < 0.3 ? 2.0 : 3.5;
        EXPECT_NEAR(nees(config, radius, 0.5, farthest, sigma), 2.0, 0.33)
            << radius << " " << sigma << " " << static_cast<int>(method);
      }
    }
  }
}

TEST(CylinderDetector, a_covariance_of_single_beams_for_less_noise_is_too_small) {
  for (const CylinderMethod method : {CylinderMethod::kClosestBeam, CylinderMethod::kCone}) {
    CylinderDetectorConfig config = by(method, 0.5);
    config.sigma_range_m = 0.007;
    EXPECT_GT(nees(config, 0.5, 0.5, 3.5), 2.33);
  }
}

// Without noise the shortest beam is the one next to the centre: half a step away at most.
TEST(CylinderDetector, the_closest_beam_points_at_the_centre_as_well_as_beams_can) {
  Rng rng(7);
  for (const CylinderMethod method : {CylinderMethod::kClosestBeam, CylinderMethod::kCone}) {
    CylinderDetectorConfig config = by(method, 0.5);
    config.sigma_range_m = 1e-4;
    double squared = 0.0;
    constexpr int kScans = 200;
    for (int k = 0; k < kScans; ++k) {
      const double bearing = uniform(rng, -kPi, kPi);
      const auto found =
          CylinderDetector(config).detect(scan_of_one({at(2.5, bearing), 0.5}, rng, 0.0));
      ASSERT_EQ(found.size(), 1U);
      EXPECT_NEAR(found[0].range, 2.5, 1e-3);
      EXPECT_DOUBLE_EQ(found[0].radius, 0.5);
      const double off = angle_difference(found[0].bearing, bearing);
      EXPECT_LT(std::abs(off), 0.5 * kPi / 180.0 + 1e-9);
      squared += off * off;
      if (method == CylinderMethod::kCone) {
        EXPECT_NEAR(std::sqrt(found[0].covariance(1, 1)), kPi / 180.0 / std::sqrt(12.0), 2e-4);
      }
    }
    EXPECT_NEAR(std::sqrt(squared / kScans), kPi / 180.0 / std::sqrt(12.0), 0.0006);
  }
}

TEST(CylinderDetector, closest_beams_are_those_of_the_arcs) {
  Rng rng(5);
  const std::vector<Disc> discs = cylinders_of_wells();
  const CylinderDetector arcs(of_radius(1.0));
  const CylinderDetector beams(by(CylinderMethod::kClosestBeam, 1.0));
  for (int k = 0; k < 100; ++k) {
    const LaserScan scan = scan_of(discs, {}, among_cylinders(rng), rng, 0.01, turning_laser());
    const std::vector<Cylinder> expected = arcs.detect(scan);
    const std::vector<Cylinder> found = beams.detect(scan);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      const BeamLandmark beam = closest_beam(scan, expected[i].first, expected[i].last, 1.0);
      EXPECT_DOUBLE_EQ(found[i].range, beam.range);
      EXPECT_NEAR(angle_difference(found[i].bearing, beam.bearing), 0.0, 1e-12);
      EXPECT_GT(found[i].covariance(1, 1), expected[i].covariance(1, 1));
    }
  }
}

// A predicted pose that is right has the cones of gadau2022 where ours are.
TEST(CylinderDetector, cones_name_the_beams_of_the_papers_rule_at_the_true_pose) {
  Rng rng(9);
  const std::vector<Disc> discs = {{{2.0, 1.0}, 0.3}, {{-1.5, 2.0}, 0.3}, {{0.0, -2.5}, 0.3}};
  std::vector<Landmark> marks;
  for (const Disc& disc : discs) {
    marks.push_back({static_cast<int>(marks.size()), disc.centre, disc.radius});
  }
  CylinderDetectorConfig config = by(CylinderMethod::kCone, 0.3, 4);
  config.sigma_range_m = 1e-4;
  for (int k = 0; k < 100; ++k) {
    const Pose2 eye{uniform(rng, -0.5, 0.5), uniform(rng, -0.5, 0.5), uniform(rng, -kPi, kPi)};
    const LaserScan scan = scan_of(discs, {}, eye, rng, 0.0, turning_laser());
    const std::vector<Cylinder> found = CylinderDetector(config).detect(scan);
    const std::vector<BeamLandmark> rule = recognize_landmarks(scan, eye, LandmarkMap(marks));
    ASSERT_EQ(found.size(), rule.size());
    for (const BeamLandmark& beam : rule) {
      EXPECT_EQ(std::count_if(found.begin(), found.end(),
                              [&](const Cylinder& c) {
                                return c.range == beam.range + 0.3 &&
                                       std::abs(angle_difference(c.bearing, beam.bearing)) < 1e-12;
                              }),
                1);
    }
  }
}

TEST(CylinderDetector, cones_leave_out_walls_and_wider_and_half_seen_cylinders) {
  Rng rng(3);
  const CylinderDetector detector(by(CylinderMethod::kCone, 0.3));
  EXPECT_EQ(detector.detect(scan_of_one({{2.0, 0.0}, 0.3}, rng)).size(), 1U);
  EXPECT_TRUE(detector.detect(scan_of_one({{2.0, 0.0}, 0.6}, rng)).empty());
  Walls room;
  add_box(room, {0.3, -0.2, 0.1}, 8.0, 6.0);
  EXPECT_TRUE(detector.detect(scan_of({}, room, {}, rng, 0.01, turning_laser())).empty());
  // Half of it lies behind another, which it is beside in view.
  const std::vector<Disc> two = {{{1.0, 0.35}, 0.3}, {{2.0, 0.0}, 0.3}};
  for (const Cylinder& c : detector.detect(scan_of(two, {}, {}, rng, 0.01, turning_laser()))) {
    EXPECT_LT(c.range, 1.2);
  }
}

TEST(CylinderDetector, closest_beams_of_a_clockwise_laser_and_of_half_hidden_cylinders_are_honest) {
  Rng rng(4);
  const CylinderDetector detector(by(CylinderMethod::kClosestBeam, 0.5));
  double sum = 0.0;
  int count = 0;
  for (int k = 0; k < 200; ++k) {
    // A plate hides the right half of it.
    const Vector<2> centre = at(2.5, 0.3 + 0.01 * k);
    const Vector<2> aside = at(1.2, 0.3 + 0.01 * k - 0.35);
    LaserScan scan = scan_of({{centre, 0.5}, {aside, 0.4}}, {}, {}, rng, 0.01, turning_laser());
    LaserGeometry turned = *scan.geometry;
    turned.angle_min += 359.0 * turned.angle_increment;
    turned.angle_increment = -turned.angle_increment;
    scan.geometry = std::make_shared<const LaserGeometry>(turned);
    std::reverse(scan.ranges.begin(), scan.ranges.end());
    for (const Cylinder& c : detector.detect(scan)) {
      if ((centre_of(c) - centre).norm() < 0.6) {
        const Vector<2> e(c.range - 2.5, angle_difference(c.bearing, 0.3 + 0.01 * k));
        sum += e.dot(c.covariance.topLeftCorner<2, 2>().llt().solve(e));
        ++count;
      }
    }
  }
  EXPECT_GT(count, 150);
  EXPECT_NEAR(sum / count, 2.0, 0.5);
}

TEST(CylinderDetector, a_covariance_for_half_the_noise_is_too_small) {
  CylinderDetectorConfig config = of_radius(0.5);
  config.sigma_range_m = 0.008;
  EXPECT_GT(nees(config, 0.5, 0.5, 3.5), 2.33);
}

TEST(CylinderDetector, a_pole_hit_by_one_beam_is_as_far_as_the_beam_and_its_radius) {
  LaserScan scan{0, turning_laser(), std::vector<double>(360, std::nan(""))};
  scan.ranges[180] = 4.0;
  const std::vector<Cylinder> found = CylinderDetector(of_radius(0.03, 1)).detect(scan);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].beams, 1);
  // The beam hits it anywhere: on average it goes pi/4 of the radius deep.
  EXPECT_NEAR(found[0].range, 4.0 + 0.03 * kPi / 4.0, 5e-4);
  EXPECT_NEAR(found[0].bearing, 0.0, 1e-9);
  EXPECT_NEAR(std::sqrt(found[0].covariance(1, 1)), 0.03 / 4.0 / std::sqrt(3.0), 2e-4);
  EXPECT_TRUE(CylinderDetector().detect(scan).empty());
}

/// A room of 8 x 6 m with three free-standing boxes at random.
Walls room(Rng& rng, const Pose2& middle) {
  Walls walls;
  add_box(walls, middle, 8.0, 6.0);
  for (const double x : {-2.6, 0.0, 2.6}) {
    const Pose2 box{x + uniform(rng, -0.3, 0.3), uniform(rng, 1.4, 1.8), uniform(rng, -kPi, kPi)};
    add_box(walls, middle * box, uniform(rng, 0.3, 1.2), uniform(rng, 0.3, 1.2));
  }
  return walls;
}

int false_ones(const CylinderDetectorConfig& config, int scans) {
  const CylinderDetector detector(config);
  Rng rng(7);
  int found = 0;
  for (int k = 0; k < scans; ++k) {
    const Pose2 middle = testing::random_pose(rng, 1.0);
    const Walls walls = room(rng, middle);
    const Pose2 eye =
        middle * Pose2{uniform(rng, -3.5, 3.5), uniform(rng, -2.5, 0.3), uniform(rng, -kPi, kPi)};
    found += static_cast<int>(
        detector.detect(scan_of({}, walls, eye, rng, 0.01, turning_laser())).size());
  }
  return found;
}

TEST(CylinderDetector, among_walls_and_corners_less_than_one_in_1000_scans_is_false) {
  EXPECT_LE(false_ones({}, 3000), 2);
  EXPECT_LE(false_ones(of_radius(1.0), 1000), 0);
  CylinderDetectorConfig careless;
  careless.least_corner_evidence = -1e6;
  careless.least_evidence = 0.0;
  careless.least_beams = 3;
  EXPECT_GT(false_ones(careless, 2000), 2);
}

TEST(CylinderDetector, rejects_hollow_arcs) {
  Rng rng(8);
  LaserScan scan = scan_of_one({{2.0, 0.0}, 0.5}, rng);
  for (int i = 0; i < 360; ++i) {  // the far side of the circle, as in a niche
    double& range = scan.ranges[static_cast<std::size_t>(i)];
    const double angle = (i - 180) * kPi / 180.0;
    range = 2.0 * 2.0 * std::cos(angle) - range;
  }
  EXPECT_TRUE(CylinderDetector().detect(scan).empty());
  EXPECT_TRUE(CylinderDetector(of_radius(0.5)).detect(scan).empty());
}

TEST(CylinderDetector, locates_a_half_hidden_cylinder) {
  Rng rng(9);
  std::vector<double> errors;
  for (int k = 0; k < 50; ++k) {
    Walls screen;  // hides everything to the right
    screen.emplace_back(Vector<2>(1.0, -3.0), Vector<2>(1.0, uniform(rng, -0.05, 0.05)));
    const LaserScan scan = scan_of_one({{2.5, 0.0}, 0.5}, rng, 0.01, screen);
    for (const Cylinder& c : CylinderDetector(of_radius(0.5)).detect(scan)) {
      errors.push_back((centre_of(c) - Vector<2>(2.5, 0.0)).norm());
      EXPECT_LT(errors.back(), 0.05);
    }
  }
  EXPECT_EQ(errors.size(), 50U);
  EXPECT_LT(median(errors), 0.01);
}

TEST(CylinderDetector, detects_a_cylinder_that_touches_a_wall_but_not_the_wall) {
  Rng rng(10);
  for (const double radius : {0.0, 0.3}) {
    int found = 0;
    std::vector<double> errors;
    for (int k = 0; k < 50; ++k) {
      Walls walls;
      walls.emplace_back(Vector<2>(-6.0, 2.0), Vector<2>(6.0, 2.0));
      const Vector<2> centre(uniform(rng, -2.0, 2.0), 1.7);
      for (const Cylinder& c : CylinderDetector(of_radius(radius))
                                   .detect(scan_of_one({centre, 0.3}, rng, 0.01, walls))) {
        ++found;
        errors.push_back((centre_of(c) - centre).norm());
      }
    }
    EXPECT_GE(found, 48);
    EXPECT_LE(found, 50);
    EXPECT_LT(median(errors), radius > 0.0 ? 0.004 : 0.008);
  }
}

/// Detects legs at short range, in a place without boxes.
CylinderDetectorConfig for_legs() {
  CylinderDetectorConfig config;
  config.least_corner_evidence = -20.0;
  config.sigma_range_m = 0.003;
  config.least_beams = 5;
  return config;
}

TEST(CylinderDetector, rejects_legs_if_configured) {
  Rng rng(11);
  CylinderDetectorConfig config = for_legs();
  const std::vector<Disc> legs{{{1.0, 0.12}, 0.06}, {{1.05, -0.12}, 0.06}, {{-1.0, 0.0}, 0.06}};
  const LaserScan scan = scan_of(legs, {}, {}, rng, 0.003, turning_laser());
  EXPECT_EQ(CylinderDetector(config).detect(scan).size(), 3U);
  config.leg_distance_m = 0.5;
  const std::vector<Cylinder> found = CylinderDetector(config).detect(scan);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_LT(std::cos(found[0].bearing), -0.9);
}

TEST(CylinderDetector, rejects_a_leg_beside_one_too_thin_to_detect) {
  Rng rng(14);
  CylinderDetectorConfig config = for_legs();
  // The other one is so far and thin that only three beams hit it.
  const std::vector<Disc> legs{{{1.0, 0.12}, 0.06}, {{1.2, -0.25}, 0.02}};
  const LaserScan scan = scan_of(legs, {}, {}, rng, 0.003, turning_laser());
  EXPECT_EQ(CylinderDetector(config).detect(scan).size(), 1U);
  config.leg_distance_m = 0.6;
  EXPECT_TRUE(CylinderDetector(config).detect(scan).empty());
  config.leg_distance_m = 0.2;
  EXPECT_EQ(CylinderDetector(config).detect(scan).size(), 1U);
}

TEST(CylinderDetector, rejects_beams_from_behind_the_tangent_point) {
  // The face of a box, and a beam on either side that hits the background: a circle fits them as
  // its ends, within four sigma but behind the tangent point.
  LaserScan scan{0, turning_laser(), std::vector<double>(360, std::nan(""))};
  const std::vector<double> ranges{5.22, 4.77, 4.77, 4.78, 4.77, 4.78, 5.17};
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    scan.ranges[177 + i] = ranges[i];
  }
  EXPECT_TRUE(CylinderDetector().detect(scan).empty());
}

TEST(CylinderDetector, beams_without_return_within_an_arc_do_not_cut_it) {
  Rng rng(12);
  LaserScan scan = scan_of_one({{2.0, 0.0}, 0.5}, rng);
  scan.ranges[175] = std::nan("");
  scan.ranges[182] = scan.ranges[183] = scan.geometry->range_max;
  const std::vector<Cylinder> found = CylinderDetector().detect(scan);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_GE(found[0].beams, 25);  // of 29, without the three
  EXPECT_NEAR(found[0].range, 2.0, 0.03);
}

TEST(CylinderDetector, detects_only_bright_cylinders_if_configured) {
  Rng rng(13);
  LaserScan scan =
      scan_of({{{2.0, 0.0}, 0.2}, {{-2.0, 0.0}, 0.2}}, {}, {}, rng, 0.01, turning_laser());
  scan.intensities.assign(360, 0.0);
  CylinderDetectorConfig config = of_radius(0.2, 2);
  EXPECT_EQ(CylinderDetector(config).detect(scan).size(), 2U);
  config.least_intensity = 1.0;
  EXPECT_TRUE(CylinderDetector(config).detect(scan).empty());
  scan.intensities[180] = scan.intensities[181] = 3.0;
  const std::vector<Cylinder> found = CylinderDetector(config).detect(scan);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].range, 2.0, 0.02);
  scan.intensities.clear();
  expect_refused([&] { (void)CylinderDetector(config).detect(scan); }, "intensities is empty",
                 "one per beam");
}

TEST(CylinderDetector, detects_nothing_in_empty_scans) {
  const CylinderDetector detector(of_radius(0.1, 1));
  LaserScan scan{0, turning_laser(), {}};
  EXPECT_TRUE(detector.detect(scan).empty());
  for (const double nothing :
       {std::nan(""), 12.0, 1e6, 0.0}) {  // no return, maximum range, beyond, zero
    scan.ranges.assign(360, nothing);
    EXPECT_TRUE(detector.detect(scan).empty()) << nothing;
    scan.ranges.assign(1, nothing);
    EXPECT_TRUE(detector.detect(scan).empty()) << nothing;
  }
  scan.ranges.assign(1, 2.0);  // nothing is known beside it
  EXPECT_TRUE(detector.detect(scan).empty());
  scan.ranges.assign(360, 0.06);  // the robot stands within a landmark
  EXPECT_TRUE(detector.detect(scan).empty());
  EXPECT_TRUE(CylinderDetector().detect(scan).empty());
}

TEST(CylinderDetector, covariances_are_finite_at_any_size) {
  Rng rng(4);
  LaserScan scan = scan_of_one({{2.0, 1.0}, 0.4}, rng, 0.0);
  LaserGeometry far = *scan.geometry;
  far.range_max = 1e6;
  scan.geometry = std::make_shared<const LaserGeometry>(far);
  const std::vector<double> ranges = scan.ranges;
  int found = 0;
  for (const double scale : {1.0, 1e3, 4e5}) {
    std::transform(ranges.begin(), ranges.end(), scan.ranges.begin(),
                   [&](double range) { return scale * range; });
    for (const double sigma : {1e-6, 0.01 * scale, 1e9}) {
      for (const double radius : {0.0, 0.4 * scale, 1e9}) {
        CylinderDetectorConfig config = of_radius(radius, 3);
        config.sigma_range_m = sigma;
        config.radius_max_m = 1e9;
        for (const Cylinder& cylinder : CylinderDetector(config).detect(scan)) {
          ++found;
          EXPECT_TRUE(cylinder.covariance.allFinite()) << scale << ' ' << sigma << ' ' << radius;
        }
      }
    }
  }
  EXPECT_GE(found, 6);
}

/// Radius that fills `beams` steps at a range, hit by two beams.
double radius_as_wide_as(double beams, double range, double step) {
  double low = 0.45 * range * step;
  double high = 5.0 * range * step;
  for (int i = 0; i < 200; ++i) {
    const double R = 0.5 * (low + high);
    const double aside = range * std::sin(0.5 * step);
    const double centre = range * std::cos(0.5 * step) + std::sqrt(R * R - aside * aside);
    (2.0 * std::asin(std::min(R / centre, 1.0)) < beams * step ? low : high) = R;
  }
  return low;
}

// Two beams on a pole of exactly three steps leave one bearing: subtracting the squared mean from
// the squares of the bearings lost all digits.
TEST(CylinderDetector, two_beams_at_any_width_have_a_covariance) {
  constexpr double kRange = 11.99;
  constexpr double kStep = 0.0232;
  const double widest = radius_as_wide_as(3.0, kRange, kStep);
  LaserGeometry geometry;
  geometry.angle_min = -0.23;
  geometry.angle_increment = kStep;
  geometry.range_max = 100.0;
  const double none = std::nan("");
  const LaserScan scan{
      0, std::make_shared<const LaserGeometry>(geometry), {none, none, kRange, kRange, none, none}};
  for (double less = 1e-16; less < 1e-2; less *= 1.7) {
    CylinderDetectorConfig config = of_radius(widest * (1.0 - less), 2);
    config.sigma_range_m = 1e-3;
    config.least_evidence = 0.0;
    config.least_corner_evidence = -20.0;
    const std::vector<Cylinder> found = CylinderDetector(config).detect(scan);
    ASSERT_EQ(found.size(), 1U) << less;
    const Matrix<2, 2> P = found.front().covariance.topLeftCorner<2, 2>();
    EXPECT_EQ(P.llt().info(), Eigen::Success) << less << '\n' << P;
  }
}

// An alternating scan is cut into as many nested parts as it has beams: recursion overflowed the
// stack.
TEST(CylinderDetector, cuts_alternating_scans_without_recursion) {
  LaserGeometry geometry;
  geometry.angle_increment = 1e-6;
  geometry.range_max = 100.0;
  const auto alternating = [&](int beams) {
    LaserScan scan{0, std::make_shared<const LaserGeometry>(geometry), {}};
    for (int i = 0; i < beams; ++i) {
      scan.ranges.push_back(5.0 + (i % 2 == 0 ? -1e-5 : 1e-5) * (beams - i));
    }
    return scan;
  };
  CylinderDetectorConfig config;
  config.sigma_range_m = 1e-6;
  config.jump_gaps = 1e9;
  const CylinderDetector detector(config);
  EXPECT_NO_THROW((void)detector.detect(alternating(30'000)));
  expect_refused([&] { (void)detector.detect(alternating(200'000)); }, "200000", "at most 100000");
}

TEST(CylinderDetector, rejects_invalid_input) {
  const auto refused = [](auto change, const auto&... words) {
    CylinderDetectorConfig config;
    change(config);
    expect_refused([&] { CylinderDetector{config}; }, words...);
  };
  refused([](auto& c) { c.sigma_range_m = 0.0; }, "sigma_range_m is 0", ">= 1e-06");
  refused([](auto& c) { c.sigma_bearing_rad = -1.0; }, "sigma_bearing_rad is -1", ">= 0");
  refused([](auto& c) { c.sigma_range_m = 1e160; }, "sigma_range_m is 1e+160", "<= 1e+09");
  refused([](auto& c) { c.radius_m = std::nan(""); }, "radius_m is nan");
  refused([](auto& c) { c.radius_max_m = 0.01; }, "radius_max_m is 0.01", ">= 0.03");
  refused([](auto& c) { c.least_beams = 0; }, "least_beams is 0", ">= 1");
  refused([](auto& c) { c.misfit_probability = 1.0; }, "misfit_probability is 1",
          "between 0 and 1");
  refused([](auto& c) { c.least_intensity = HUGE_VAL; }, "least_intensity is inf");
  refused([](auto& c) { c.method = CylinderMethod::kClosestBeam; }, "radius_m is 0", "method arcs");
  refused([](auto& c) { c.method = CylinderMethod::kCone; }, "radius_m is 0", "method arcs");
  for (double CylinderDetectorConfig::*unused :
       {&CylinderDetectorConfig::least_evidence, &CylinderDetectorConfig::least_corner_evidence,
        &CylinderDetectorConfig::leg_distance_m}) {
    CylinderDetectorConfig config = by(CylinderMethod::kCone, 0.3);
    EXPECT_NO_THROW(CylinderDetector{config});
    config.*unused = 1.5;
    expect_refused([&] { CylinderDetector{config}; }, "is 1.5", "method cone does not use it");
  }
  LaserScan scan{0, turning_laser(), {1.0, -2.0}};
  expect_refused([&] { (void)CylinderDetector().detect(scan); }, "ranges [m] is -2");
}

}  // namespace
}  // namespace locfuse
