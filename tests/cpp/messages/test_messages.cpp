// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "locfuse/messages/messages.hpp"
#include "locfuse/messages/reported_covariance.hpp"
#include "support/expect.hpp"

namespace locfuse::test_messages {
namespace {

using testing::expect_refused;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNan = std::nan("");

Range range_of(double range, std::optional<double> sigma = {}) { return {0, 1, 2, range, sigma}; }

TEST(Validate, accepts_valid_messages) {
  EXPECT_NO_THROW(validate(Velocity{0, -1.0, 2.0}));
  EXPECT_NO_THROW(validate(Increment{5, 5, {1.0, 0.0, 0.0}}));
  EXPECT_NO_THROW(validate(range_of(0.0)));
  EXPECT_NO_THROW(validate(range_of(5.0, 1e-6)));
  EXPECT_NO_THROW(validate(PositionFix{0, {1.0, 2.0}, Matrix<2, 2>::Identity()}));
  EXPECT_NO_THROW(validate(PoseObservation{0, {1.0, 2.0, 3.0}, Matrix<3, 3>::Identity()}));
}

TEST(Validate, rejects_stamps_whose_differences_would_overflow) {
  constexpr Stamp kFirst = std::numeric_limits<Stamp>::min();
  const Matrix<2, 2> R = Matrix<2, 2>::Identity();
  const Matrix<3, 3> R3 = Matrix<3, 3>::Identity();
  expect_refused([] { validate(Velocity{kStampLimit, 0.0, 0.0}); }, "stamp", "4611686018427387904");
  expect_refused([] { validate(Increment{kFirst, 0, {}}); }, "stamp", "-9223372036854775808");
  expect_refused([] { validate(Increment{0, kStampLimit, {}}); }, "stamp", "4611686018427387904");
  expect_refused([] { validate(Range{-kStampLimit, 1, 2, 1.0, {}}); }, "stamp", "-46116860");
  expect_refused([&] { validate(PositionFix{kFirst, {0.0, 0.0}, R}); }, "stamp", "-92233720");
  expect_refused([&] { validate(PoseObservation{kFirst, {}, R3}); }, "stamp", "-92233720");
  EXPECT_NO_THROW(validate(Velocity{kStampLimit - 1, 0.0, 0.0}));
  EXPECT_NO_THROW(validate(Velocity{1 - kStampLimit, 0.0, 0.0}));
}

TEST(Validate, rejects_a_velocity_that_is_not_finite) {
  expect_refused([] { validate(Velocity{0, kNan, 0.0}); }, "forward", "nan");
  expect_refused([] { validate(Velocity{0, 0.0, -kInfinity}); }, "turn_rate", "-inf");
  expect_refused([] { validate(Velocity{0, 0.0, 0.0, kNan}); }, "left", "nan");
}

TEST(LaserGeometry, a_range_at_a_limit_is_no_return) {
  const LaserGeometry geometry{{}, 0.0, 0.1, 0.0, 10.0};
  EXPECT_FALSE(geometry.is_return(0.0));
  EXPECT_TRUE(geometry.is_return(1e-9));
  EXPECT_TRUE(geometry.is_return(std::nextafter(10.0, 0.0)));
  EXPECT_FALSE(geometry.is_return(10.0));
  EXPECT_FALSE(geometry.is_return(kNan));
}

TEST(LaserScan, beams_are_turned_by_what_the_body_turned_until_their_time) {
  // A wall of the world at the angle of the beam plus what the body has turned since the stamp.
  const auto geometry =
      std::make_shared<const LaserGeometry>(LaserGeometry{{}, -1.0, 0.02, 0.1, 10.0, 0.001});
  const LaserScan scan{7, geometry, std::vector<double>(101, 2.0), {}};
  const double turn_rate = 1.5;
  const auto turned = as_of_stamp(scan, turn_rate);
  ASSERT_TRUE(turned);
  EXPECT_EQ(turned->stamp, 7);
  EXPECT_EQ(turned->ranges, scan.ranges);
  for (int i : {0, 30, 50, 100}) {
    const double beam = geometry->angle_min + i * geometry->angle_increment;
    const double since_stamp = (i - 50) * geometry->time_increment;
    EXPECT_NEAR(turned->geometry->angle_min + i * turned->geometry->angle_increment,
                beam + turn_rate * since_stamp, 1e-12);
  }
  EXPECT_FALSE(as_of_stamp(*turned, turn_rate)) << "they are of one time now";
  EXPECT_FALSE(as_of_stamp(scan, 0.0));
}

TEST(Validate, rejects_an_increment_that_is_not_finite) {
  expect_refused([] { validate(Increment{0, 1, {kInfinity, 0.0, 0.0}}); }, "motion.x", "inf");
  expect_refused([] { validate(Increment{0, 1, {0.0, kNan, 0.0}}); }, "motion.y", "nan");
  expect_refused([] { validate(Increment{0, 1, {0.0, 0.0, kNan}}); }, "motion.heading", "nan");
}

TEST(Validate, rejects_an_increment_that_ends_before_it_begins) {
  expect_refused([] { validate(Increment{20, 13, {}}); }, "20", "13");
}

TEST(Validate, rejects_an_invalid_altitude) {
  EXPECT_NO_THROW(validate(Altitude{0, -3.0, 0.1}));
  expect_refused([] { validate(Altitude{kStampLimit, 0.0, 0.1}); }, "stamp");
  expect_refused([] { validate(Altitude{0, kInfinity, 0.1}); }, "Altitude.height", "inf");
  expect_refused([] { validate(Altitude{0, 0.0, 1e-200}); }, "Altitude.sigma");  // squares to 0
}

TEST(Validate, accepts_an_elevation_only_in_space) {
  const RangeBearing up{0, 1, {}, {}, {}, -0.5 * kPi, 0.1};
  EXPECT_NO_THROW(validate_in_space(up));
  expect_refused([&] { validate(up); }, "elevation", "-1.57", "AirEkf");
  const RangeBearing planar{0, 1, 2.0, 0.3, {}};
  EXPECT_NO_THROW(validate_in_space(planar));
  EXPECT_NO_THROW(validate(planar));
  expect_refused([] { validate_in_space(RangeBearing{0, 1, {}, {}, {}, kNan, {}}); }, "elevation");
  expect_refused([] { validate_in_space(RangeBearing{0, 1, {}, {}, {}, 1.0, 0.0}); }, "sigma");
}

TEST(Validate, rejects_a_range_that_no_radio_can_measure) {
  expect_refused([] { validate(range_of(-1.5)); }, "Range.range", "-1.5");
  expect_refused([] { validate(range_of(kNan)); }, "Range.range", "nan");
  expect_refused([] { validate(range_of(kInfinity)); }, "Range.range", "inf");
}

TEST(Validate, rejects_a_range_sigma_that_is_not_positive) {
  expect_refused([] { validate(range_of(1.0, 0.0)); }, "Range.sigma", "is 0");
  expect_refused([] { validate(range_of(1.0, -0.25)); }, "Range.sigma", "-0.25");
  expect_refused([] { validate(range_of(1.0, kNan)); }, "Range.sigma", "nan");
  expect_refused([] { validate(range_of(1.0, kInfinity)); }, "Range.sigma", "inf");
  expect_refused([] { validate(range_of(1.0, 1e-200)); }, "Range.sigma", "1e-200");  // R is 0
}

TEST(Validate, rejects_a_position_that_is_not_finite) {
  const Matrix<2, 2> R = Matrix<2, 2>::Identity();
  expect_refused([&] { validate(PositionFix{0, {kNan, 0.0}, R}); }, "position.x", "nan");
  expect_refused([&] { validate(PositionFix{0, {0.0, kInfinity}, R}); }, "position.y", "inf");
}

TEST(Validate, rejects_an_invalid_position_covariance) {
  const auto with = [](double a, double b, double c, double d) {
    validate(PositionFix{0, {0.0, 0.0}, (Matrix<2, 2>() << a, b, c, d).finished()});
  };
  expect_refused([&] { with(0.0, 0.0, 0.0, 1.0); }, "PositionFix.covariance");
  expect_refused([&] { with(-4.5, 0.0, 0.0, 1.0); }, "PositionFix.covariance", "-4.5");
  expect_refused([&] { with(1.0, 2.25, 2.25, 1.0); }, "PositionFix.covariance", "2.25");
  expect_refused([&] { with(2.0, 0.75, -0.75, 2.0); }, "PositionFix.covariance", "-0.75");
  expect_refused([&] { with(1.0, 1e160, 0.0, 1.0); }, "PositionFix.covariance");  // squares: inf
  expect_refused([&] { with(1.0, 0.0, 0.0, kNan); }, "PositionFix.covariance", "nan");
}

TEST(Validate, rejects_a_pose_that_is_not_finite) {
  const Matrix<3, 3> R = Matrix<3, 3>::Identity();
  expect_refused([&] { validate(PoseObservation{0, {kNan, 0.0, 0.0}, R}); }, "pose.x", "nan");
  expect_refused([&] { validate(PoseObservation{0, {0.0, kNan, 0.0}, R}); }, "pose.y", "nan");
  expect_refused(
      [&] {
        validate(PoseObservation{0, {0.0, 0.0, kInfinity}, R});
      },
      "pose.heading", "inf");
}

TEST(Validate, rejects_an_invalid_pose_covariance) {
  Matrix<3, 3> R = Matrix<3, 3>::Identity();
  R(2, 2) = -0.125;
  expect_refused(
      [&] {
        validate(PoseObservation{0, {}, R});
      },
      "PoseObservation.covariance", "-0.125");
  R = Matrix<3, 3>::Identity();
  R(0, 2) = 0.375;
  expect_refused(
      [&] {
        validate(PoseObservation{0, {}, R});
      },
      "PoseObservation.covariance", "0.375");
}

TEST(Messages, errors_of_laser_scans_name_the_number) {
  const LaserGeometry good{{}, -1.0, 0.1, 0.1, 5.0};
  const auto geometry = [&](double LaserGeometry::*field, double value) {
    LaserGeometry wrong = good;
    wrong.*field = value;
    return [wrong] { validate(wrong); };
  };
  validate(good);
  expect_refused(geometry(&LaserGeometry::angle_min, std::nan("")), "angle_min [rad] is nan");
  expect_refused(geometry(&LaserGeometry::angle_increment, 0.0), "angle_increment [rad] is 0");
  expect_refused(geometry(&LaserGeometry::range_min, -1.0), "range_min [m] is -1");
  // With such a range the ends of beams were NaN in single precision, and a search read a cell of
  // that index.
  expect_refused(geometry(&LaserGeometry::range_max, 1e300), "range_max [m] is 1e+300", "1e6");
  expect_refused(geometry(&LaserGeometry::range_max, 0.1), "range_max [m] is 0.1", "above");
  const auto shared = std::make_shared<const LaserGeometry>(good);
  validate(LaserScan{0, shared, {}});
  validate(LaserScan{0, shared, {1.0, std::nan(""), 9.0}});
  expect_refused([&] { validate(LaserScan{0, shared, {1.0, -0.5}}); }, "ranges [m] is -0.5", "NaN");
  expect_refused([&] { validate(LaserScan{0, shared, {HUGE_VAL}}); }, "ranges [m] is inf", "NaN");
  expect_refused([] { validate(LaserScan{}); }, "geometry is null");
  validate(LaserScan{0, shared, {1.0, 2.0}, {0.0, 5.0}});
  expect_refused(
      [&] {
        validate(LaserScan{0, shared, {1.0, 2.0}, {0.0}});
      },
      "intensities are 1", "none or 2");
  expect_refused([&] { validate(LaserScan{0, shared, {1.0}, {HUGE_VAL}}); }, "intensities is inf");
}

TEST(Validate, rejects_a_sigma_whose_square_is_infinite) {
  expect_refused([] { validate(range_of(1.0, 1e160)); }, "Range.sigma", "1e+160");
  expect_refused([] { check_min_sigma("least_sigma_m", 1e200); }, "least_sigma_m", "1e+200");
  expect_refused([] { check_unknown_sigma("sigma_m", 1e200); }, "sigma_m", "1e+200");
}

TEST(Validate, rejects_a_covariance_whose_halves_differ_however_large_its_other_numbers_are) {
  PositionFix fix{0, {0.0, 0.0}, Matrix<2, 2>::Identity()};
  fix.covariance(0, 1) = 1e200;
  expect_refused([&] { validate(fix); }, "PositionFix.covariance");
  PoseObservation pose{0, {}, Vector<3>(1e300, 1.0, 1.0).asDiagonal()};
  pose.covariance(1, 2) = 900.0;
  expect_refused([&] { validate(pose); }, "PoseObservation.covariance");
  pose.covariance = Vector<3>(9e5, 1e-6, 1e-6).asDiagonal();
  pose.covariance(1, 2) = 4e-4;
  expect_refused([&] { validate(pose); }, "PoseObservation.covariance");
}

}  // namespace
}  // namespace locfuse::test_messages
