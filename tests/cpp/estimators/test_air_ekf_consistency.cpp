// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>

#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/flight.hpp"

namespace locfuse::test_air_ekf_consistency {
namespace {

using testing::in_band;

constexpr int kRuns = 120;

struct Consistency {
  double nees3 = 0.0;  ///< mean over the runs, of (x, y, height) at the end
  double nees4 = 0.0;  ///< the same, and of the heading
  double nis = 0.0;    ///< mean over all ranges
  int ranges = 0;
};

/// `change` may spoil the filter's config and map.
template <class Change>
Consistency measure(AirMotion motion, testing::Step step, const Change& change) {
  Consistency result;
  AirEkf::Config config = testing::well_informed(motion);
  config.correlation_s = 0.0;  // its errors are independent
  std::vector<Anchor> anchors = testing::corners();
  change(config, anchors);
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const testing::Flight flight = testing::fly(seed, 10.0, step);
    AirEkf ekf = testing::air_ekf(config, flight.start, anchors);
    for (const auto& message : flight.messages) {
      const Outcome outcome =
          std::visit([&](const auto& m) { return testing::feed(ekf, m); }, message);
      if (std::holds_alternative<Range>(message)) {
        result.nis += outcome.nis;
        ++result.ranges;
      }
    }
    const AirEstimate end = ekf.estimate();
    const Vector<4> error(flight.x - end.pose.x, flight.y - end.pose.y,
                          angle_difference(wrap_angle(flight.heading), end.pose.heading),
                          flight.height - end.height);
    result.nees4 += error.dot(end.covariance.llt().solve(error)) / kRuns;
    const std::vector<int> place = {0, 1, 3};
    const Matrix<3, 3> P = end.covariance(place, place);
    const Vector<3> off = error(place);
    result.nees3 += off.dot(P.llt().solve(off)) / kRuns;
  }
  result.nis /= result.ranges;
  return result;
}

void nothing(AirEkf::Config& /*config*/, std::vector<Anchor>& /*anchors*/) {}

void forget_heights(AirEkf::Config& /*config*/, std::vector<Anchor>& anchors) {
  for (Anchor& anchor : anchors) {
    anchor.position.z() = 3.0;
  }
}

TEST(AirEkf, errors_on_flights_with_odometry_are_as_large_as_it_believes) {
  const Consistency result = measure(AirMotion::kOdometry, testing::by_odometry, nothing);
  EXPECT_EQ(result.ranges, kRuns * 160);
  EXPECT_TRUE(in_band(result.nees3, 3, kRuns, 0.99)) << result.nees3;
  EXPECT_TRUE(in_band(result.nees4, 4, kRuns, 0.99)) << result.nees4;
  EXPECT_TRUE(in_band(result.nis, 1, result.ranges, 0.99)) << result.nis;
}

TEST(AirEkf, errors_on_flights_without_are_as_large_as_it_believes) {
  const Consistency result = measure(AirMotion::kConstantVelocity, testing::by_itself, nothing);
  EXPECT_EQ(result.ranges, kRuns * 160);
  EXPECT_TRUE(in_band(result.nees3, 3, kRuns, 0.99)) << result.nees3;
  EXPECT_TRUE(in_band(result.nees4, 4, kRuns, 0.99)) << result.nees4;
  EXPECT_TRUE(in_band(result.nis, 1, result.ranges, 0.99)) << result.nis;
}

TEST(AirEkf, anchors_that_are_all_taken_for_equally_high_show) {
  for (const auto& [motion, step] :
       {std::pair(AirMotion::kOdometry, &testing::by_odometry),
        std::pair(AirMotion::kConstantVelocity, &testing::by_itself)}) {
    const Consistency result = measure(motion, step, forget_heights);
    EXPECT_FALSE(in_band(result.nees3, 3, kRuns, 0.99)) << result.nees3;
    EXPECT_FALSE(in_band(result.nis, 1, result.ranges, 0.99)) << result.nis;
  }
}

TEST(AirEkf, a_motion_that_is_trusted_ten_times_too_much_shows) {
  const auto trust = [](AirEkf::Config& config, std::vector<Anchor>& /*anchors*/) {
    config.sigma_height_per_sqrt_s = 0.01;
    config.constant_velocity = {0.05, 0.03, 0.02};
  };
  EXPECT_FALSE(in_band(measure(AirMotion::kOdometry, testing::by_odometry, trust).nees3, 3, kRuns));
  EXPECT_FALSE(
      in_band(measure(AirMotion::kConstantVelocity, testing::by_itself, trust).nees3, 3, kRuns));
}

TEST(AirEkf, sensors_that_are_taken_for_being_elsewhere_on_the_body_show) {
  const auto turn = [](AirEkf::Config& config, std::vector<Anchor>& /*anchors*/) {
    config.landmark_in_space.sensor_up_m *= -1.0;
    config.altitude.altimeter_up_m = -0.4;
  };
  EXPECT_FALSE(in_band(measure(AirMotion::kOdometry, testing::by_odometry, turn).nees3, 3, kRuns));
}

}  // namespace
}  // namespace locfuse::test_air_ekf_consistency
