// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "locfuse/recovery/air_sum.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/flight.hpp"

namespace locfuse::test_air_sum {
namespace {

using testing::kSecond;

constexpr int kFlights = 100;
constexpr Stamp kCutOff = 10 * kSecond;
constexpr Stamp kReceivedAgain = 30 * kSecond;
constexpr Stamp kEnd = 40 * kSecond;
constexpr Stamp kTick = kSecond / 20;
const std::vector<int> kPlace{0, 1, 3};

/// Four anchors side by side, all within a few metres; flights go 100 m away.
std::vector<Anchor> side_by_side() {
  return {
      {0, {3.0, 2.7, 5.0}}, {1, {3.0, -2.7, 5.0}}, {2, {3.0, -2.7, 0.5}}, {3, {-2.7, 2.7, 0.5}}};
}

AirEkf::Config config_of_flight() {
  AirEkf::Config config = testing::well_informed(AirMotion::kConstantVelocity);
  config.correlation_s = 0.0;  // its errors are independent
  config.range.gate = config.altitude.gate = 0.999;
  return config;
}

AirEkf at_start(const std::vector<Anchor>& anchors, const AirEstimate& start) {
  return {
      config_of_flight(), {std::make_shared<AnchorMap>(anchors), {{0, {0.0, 0.0, -0.1}}}}, start};
}

RecoveringEkf recovering(const std::vector<Anchor>& anchors, const AirEstimate& start) {
  RecoveringEkf::Config config;
  config.tracker = config_of_flight();
  config.start.estimator.correlation_s = 0.0;
  RecoveringEkf ekf(config, {std::make_shared<AnchorMap>(anchors), {{0, {0.0, 0.0, -0.1}}}});
  ekf.start_with(at_start(anchors, start));
  return ekf;
}

/// Of a filter after 20 s without ranges, over many flights.
struct AfterSilence {
  int back = 0;             ///< within a metre, ten seconds later
  int sure_and_wrong = 0;   ///< once more than 3 m off, and in a coordinate beyond three sigma
  double nees_early = 0.0;  ///< mean, of (x, y, height), one second later
  double nees_late = 0.0;   ///< ten seconds later
};

AirEstimate estimate_of(const AirEkf& ekf, Stamp stamp) { return ekf.estimate(stamp); }
AirEstimate estimate_of(const RecoveringEkf& ekf, Stamp /*stamp*/) {
  return *ekf.current_in_space();
}

/// Every `wrong_every`-th range is wrong by up to 20 m. With an altimeter there is an altitude
/// before each two ranges, of which every twentieth is wrong, too.
template <class Ekf>
AfterSilence silence(const std::vector<Anchor>& anchors, int wrong_every,
                     Ekf (*filter)(const std::vector<Anchor>&, const AirEstimate&),
                     bool has_altimeter = false) {
  AfterSilence result;
  for (std::uint64_t seed = 1; seed <= kFlights; ++seed) {
    testing::Rng rng(seed);
    testing::Flight flight;
    const Vector<4> sigma(0.2, 0.2, 0.05, 0.2);
    flight.start = {0, {6.0, -3.0, 0.4}, 3.0, sigma.cwiseAbs2().asDiagonal()};
    flight.x = 6.0 + testing::normal(rng, sigma(0));
    flight.y = -3.0 + testing::normal(rng, sigma(1));
    flight.heading = 0.4 + testing::normal(rng, sigma(2));
    flight.height = 3.0 + testing::normal(rng, sigma(3));
    Vector<3> velocity = Vector<3>::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      velocity(axis) = testing::normal(rng, axis == 2 ? 0.2 : 0.4);
    }
    Ekf ekf = filter(anchors, flight.start);
    bool is_sure_and_wrong = false;
    int ranges = 0;
    for (Stamp now = kTick; now <= kEnd; now += kTick) {
      testing::by_itself(rng, flight, now - kTick, now, velocity);
      const auto index = static_cast<std::size_t>(now / kTick) % anchors.size();
      if (has_altimeter && (now <= kCutOff || now > kReceivedAgain)) {
        const double wrong = now / kTick % 20 == 0 ? testing::uniform(rng, -20.0, 20.0) : 0.0;
        const double height = flight.height + wrong + testing::normal(rng, 0.2);
        (void)ekf.on(Altitude{now - kTick / 2, height, 0.2});
      }
      for (const std::size_t which : {index, (index + 1) % anchors.size()}) {
        const Anchor& a = anchors[which];
        double range = std::hypot(flight.x - a.position.x(), flight.y - a.position.y(),
                                  flight.height - 0.1 - a.position.z());
        range += testing::normal(rng, 0.1);
        const double wrong = testing::uniform(rng, -20.0, 20.0);
        const bool is_wrong = wrong_every > 0 && ++ranges % wrong_every == 0;
        if (now <= kCutOff || now > kReceivedAgain) {
          (void)ekf.on(Range{now, 0, a.id, std::max(range + (is_wrong ? wrong : 0.0), 0.1), {}});
        }
      }
      if (now <= kReceivedAgain) {
        continue;
      }
      const AirEstimate here = estimate_of(ekf, now);
      const Vector<3> off(flight.x - here.pose.x, flight.y - here.pose.y,
                          flight.height - here.height);
      const Matrix<3, 3> P = here.covariance(kPlace, kPlace);
      is_sure_and_wrong |=
          off.norm() > 3.0 && (off.array().abs() > 3.0 * P.diagonal().array().sqrt()).any();
      const double nees = off.dot(P.llt().solve(off));
      result.nees_early += now == kReceivedAgain + kSecond ? nees / kFlights : 0.0;
      result.nees_late += now == kEnd ? nees / kFlights : 0.0;
      result.back += now == kEnd && off.norm() < 1.0 ? 1 : 0;
    }
    result.sure_and_wrong += is_sure_and_wrong ? 1 : 0;
  }
  return result;
}

TEST(AirSum, a_flight_is_found_again_after_twenty_seconds_without_ranges) {
  const AfterSilence found = silence(testing::corners(), 0, recovering);
  EXPECT_GE(found.back, kFlights - 2);  // some are 100 m away
  EXPECT_LE(found.sure_and_wrong, 1);
  EXPECT_TRUE(testing::in_band(found.nees_early, 3, kFlights, 0.99)) << found.nees_early;
  EXPECT_TRUE(testing::in_band(found.nees_late, 3, kFlights, 0.99)) << found.nees_late;
}

TEST(AirSum, ranges_fused_one_by_one_after_a_silence_are_sure_and_wrong) {
  const AfterSilence lost = silence(testing::corners(), 0, at_start);
  EXPECT_LT(lost.back, kFlights);
  EXPECT_GT(lost.sure_and_wrong, kFlights / 2);
}

TEST(AirSum, a_flight_is_found_again_from_anchors_side_by_side) {
  const AfterSilence found = silence(side_by_side(), 0, recovering);
  EXPECT_LE(found.sure_and_wrong, 8);  // by chance: errors are metres there, as they should be
  EXPECT_TRUE(testing::in_band(found.nees_early, 3, kFlights, 0.99)) << found.nees_early;
  EXPECT_TRUE(testing::in_band(found.nees_late, 3, kFlights, 0.99)) << found.nees_late;
}

TEST(AirSum, a_flight_is_found_again_by_ranges_of_which_some_are_wrong) {
  const AfterSilence found = silence(testing::corners(), 20, recovering);
  EXPECT_GE(found.back, kFlights - 2);  // some are 100 m away
  EXPECT_LE(found.sure_and_wrong, 1);
}

TEST(AirSum, an_altimeter_between_the_ranges_helps_and_its_wrong_values_do_not_decide) {
  const AfterSilence found = silence(testing::corners(), 0, recovering, true);
  EXPECT_GE(found.back, kFlights - 2);
  // Three coordinates at one or two moments before it is found: chance alone gives 1 to 2.
  EXPECT_LE(found.sure_and_wrong, 5);
}

/// A flight by odometry that has lost all sensors for 20 s, and then has odometry and ranges that
/// come between the ends of its motions.
TEST(AirSum, a_flight_by_odometry_is_found_again_though_ranges_come_between_its_motions) {
  int back = 0;
  int stale = 0;
  for (std::uint64_t seed = 1; seed <= kFlights; ++seed) {
    testing::Rng rng(seed);
    testing::Flight flight;
    const Vector<4> sigma(0.2, 0.2, 0.05, 0.2);
    flight.start = {0, {2.0, -1.0, 0.4}, 3.0, sigma.cwiseAbs2().asDiagonal()};
    flight.x = 2.0;
    flight.y = -1.0;
    flight.heading = 0.4;
    flight.height = 3.0;
    AirEkf::Config air = testing::well_informed(AirMotion::kOdometry);
    air.correlation_s = 0.0;
    air.range.gate = 0.999;
    const auto anchors = std::make_shared<AnchorMap>(testing::corners());
    const std::vector<Tag> tags{{0, {0.0, 0.0, -0.1}}};
    RecoveringEkf::Config config;
    config.tracker = air;
    config.start.estimator.correlation_s = 0.0;
    RecoveringEkf ekf(config, {anchors, tags});
    ekf.start_with(AirEkf(air, {anchors, tags}, flight.start));
    Vector<3> velocity = Vector<3>::Zero();
    for (Stamp now = kTick; now <= kEnd; now += kTick) {
      const bool is_silent = now > kCutOff && now <= kReceivedAgain;
      const Vector<3> before(flight.x, flight.y, flight.height);
      testing::by_odometry(rng, flight, now - kTick, now, velocity);
      if (is_silent) {
        continue;
      }
      const auto& driven = std::get<testing::Driven>(flight.messages.back());
      (void)ekf.on(driven.motion);
      const Vector<3> middle = 0.5 * (before + Vector<3>(flight.x, flight.y, flight.height));
      const Anchor a = testing::corners()[static_cast<std::size_t>(now / kTick) % 4];
      const double range = (middle - Vector<3>(0.0, 0.0, 0.1) - a.position).norm();
      const double noise = testing::normal(rng, 0.1);
      const Outcome outcome = ekf.on(Range{now - kTick / 2, 0, a.id, range + noise, {}});
      stale += outcome.verdict == Verdict::kStale ? 1 : 0;
    }
    const AirEstimate here = *ekf.estimate_in_space();
    const Vector<3> off(flight.x - here.pose.x, flight.y - here.pose.y,
                        flight.height - here.height);
    EXPECT_EQ(here.stamp, kEnd) << "seed " << seed;
    back += off.norm() < 1.0 ? 1 : 0;
  }
  EXPECT_EQ(stale, 0);
  EXPECT_GE(back, kFlights - 5);
}

/// Odometry goes on after a single range that is too near: it is not kept for ever.
TEST(AirSum, one_range_does_not_stop_the_body_that_drives_on_without_others) {
  const Vector<4> sigma(4.0, 4.0, 0.5, 2.0);
  AirEkf::Config air = testing::well_informed(AirMotion::kOdometry);
  air.range.gate = 0.999;
  const auto anchors = std::make_shared<AnchorMap>(testing::corners());
  const std::vector<Tag> tags{{0, {0.0, 0.0, -0.1}}};
  RecoveringEkf::Config config;
  config.tracker = air;
  RecoveringEkf ekf(config, {anchors, tags});
  ekf.start_with(
      AirEkf(air, {anchors, tags}, {0, {-8.0, -8.0, 0.4}, 3.0, sigma.cwiseAbs2().asDiagonal()}));
  ASSERT_EQ(ekf.on(Range{0, 0, 0, 3.5, {}}).verdict, Verdict::kIgnored);
  const double began = ekf.current_in_space()->pose.x;
  for (Stamp now = 0; now < 10 * kSecond; now += kTick) {
    ASSERT_EQ(ekf.on(Increment{now, now + kTick, {0.05, 0.0, 0.0}}).verdict, Verdict::kFused);
  }
  EXPECT_GE(ekf.belief().stamp, 9 * kSecond);
  EXPECT_GT(ekf.estimate_in_space()->pose.x - began, 5.0);
}

/// Four anchors at 0.57 m, in the air above which and below which ranges are the same.
std::vector<Anchor> in_a_plane() {
  return {{0, {1.5, 1.5, 0.57}},
          {1, {-1.5, 1.5, 0.57}},
          {2, {-1.5, -1.5, 0.57}},
          {3, {1.5, -1.5, 0.57}}};
}

AirEkf::Config config_in_room(double max_height) {
  AirEkf::Config config;
  config.motion = AirMotion::kConstantVelocity;
  config.range.sigma_m = 0.1;
  config.correlation_s = 0.0;
  if (max_height > 0.0) {
    config.min_height_m = 0.0;
    config.max_height_m = max_height;
  }
  return config;
}

AirEkf on_the_floor(const AirEkf::Config& config) {
  const Vector<4> sigma(0.3, 0.3, 0.1, 0.3);
  return {config,
          {std::make_shared<AnchorMap>(in_a_plane()), {{0, {0.0, 0.0, 0.0}}}},
          {0, {0.2, -0.1, 0.0}, 0.1, sigma.cwiseAbs2().asDiagonal()}};
}

/// How many of 30 flights from the floor to 2 m end within 0.5 m of that height.
template <class Ekf>
int at_two_metres(const Ekf& start) {
  int right = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    testing::Rng rng(seed);
    Ekf ekf = start;
    for (Stamp now = kTick; now <= 30 * kSecond; now += kTick) {
      const double second = static_cast<double>(now) / kNanosecondsPerSecond;
      const Vector<3> place(0.2 + 0.5 * std::sin(0.5 * second), -0.1,
                            std::clamp(0.1 + 0.2 * (second - 5.0), 0.1, 2.0));
      const Anchor a = in_a_plane()[static_cast<std::size_t>(now / kTick) % 4];
      (void)ekf.on(
          Range{now, 0, a.id, (place - a.position).norm() + testing::normal(rng, 0.1), {}});
    }
    right += std::abs(estimate_of(ekf, 30 * kSecond).height - 2.0) < 0.5 ? 1 : 0;
  }
  return right;
}

TEST(AirSum, a_floor_tells_on_which_side_of_its_anchors_a_body_is) {
  const auto flights = [](double max_height) {
    RecoveringEkf::Config config;
    config.tracker = config_in_room(max_height);
    RecoveringEkf ekf(config, {std::make_shared<AnchorMap>(in_a_plane()), {{0, {0, 0, 0}}}});
    ekf.start_with(on_the_floor(config_in_room(max_height)));
    return at_two_metres(ekf);
  };
  EXPECT_EQ(flights(2.5), 30);
  EXPECT_EQ(flights(4.0), 30);
  EXPECT_LT(at_two_metres(on_the_floor(config_in_room(0.0))), 29);
}

TEST(AirEkf, is_mirrored_where_ranges_cannot_tell) {
  const AirEkf ekf = on_the_floor(config_in_room(2.5));
  const auto image = ekf.image();
  ASSERT_TRUE(image);
  EXPECT_NEAR(image->first.height(), 2.0 * 0.57 - 0.1, 1e-12);
  EXPECT_NEAR(image->first.pose().x, ekf.pose().x, 1e-12);
  EXPECT_NEAR(image->second, 0.0618, 1e-3);                  // 0.47 m in sigmas of 0.3 m
  EXPECT_FALSE(on_the_floor(config_in_room(0.05)).image());  // it would be above the ceiling
  AirEkf::Config high = config_in_room(0.0);
  EXPECT_TRUE(on_the_floor(high).image());
  const AirEkf elsewhere = at_start(testing::corners(), ekf.current());
  EXPECT_FALSE(elsewhere.image());  // their anchors are in no plane
}

TEST(AirEkf, is_no_vaguer_than_its_room) {
  AirEkf ekf = on_the_floor(config_in_room(2.5));
  ekf.advance_to(20 * kSecond);
  EXPECT_NEAR(ekf.height(), 1.25, 0.1);
  EXPECT_LT(ekf.current().covariance(3, 3), 2.5 * 2.5 / 12.0 + 1e-6);
  AirEkf outside = on_the_floor(config_in_room(0.0));
  outside.advance_to(20 * kSecond);
  EXPECT_GT(outside.current().covariance(3, 3), 100.0);
  AirEkf::Config config = config_in_room(2.5);
  config.min_height_m = 3.0;
  testing::expect_refused([&] { (void)on_the_floor(config); }, "min_height_m");
}

}  // namespace
}  // namespace locfuse::test_air_sum
