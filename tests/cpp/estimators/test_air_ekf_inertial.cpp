// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "locfuse/geometry/rotation.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/replay.hpp"
#include "support/bits.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/inertial_flight.hpp"

namespace locfuse::test_air_ekf_inertial {
namespace {

using testing::expect_near;
using testing::expect_refused;
using testing::in_band;
using testing::InertialFlight;
using testing::kSecond;
using testing::same_bits;

constexpr int kRuns = 400;
const std::vector<int> kPlace{0, 1, 3};

/// Error of an estimate: of (x, y, height), and the rotation that is left.
struct Off {
  Vector<3> place;
  Vector<3> rotation;
};

Off off(const InertialFlight& flight, const AirEstimate& estimate) {
  const double t = static_cast<double>(estimate.stamp) * 1e-9;
  const Vector<3> p = flight.swing.position(t);
  return {p - Vector<3>(estimate.pose.x, estimate.pose.y, estimate.height),
          rotation_vector(flight.swing.attitude(t) *
                          rotation_of(estimate.attitude->quaternion).transpose())};
}

struct Consistency {
  double place = 0.0;     // NEES
  double rotation = 0.0;  // NEES
  double all = 0.0;       // NEES of the whole error state but for the biases
  double nis = 0.0;
  int rows = 0;
};

template <class Change>
Consistency measure(const Change& change, bool has_all = true) {
  Consistency result;
  AirEkf::Config config = testing::inertial_config();
  change(config);
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const InertialFlight flight = testing::swing_about(seed, 12.0, {}, has_all);
    AirEkf ekf = testing::air_ekf(config, flight.start);
    for (const Message& message : flight.messages) {
      const Outcome outcome = ekf.on(message);
      EXPECT_EQ(outcome.verdict, Verdict::kFused);
      if (outcome.dof > 0) {
        result.nis += outcome.nis;
        result.rows += outcome.dof;
      }
    }
    const AirEstimate end = ekf.estimate();
    const Off error = off(flight, end);
    const Matrix<3, 3> P = end.covariance(kPlace, kPlace);
    result.place += error.place.dot(P.llt().solve(error.place)) / kRuns;
    result.rotation +=
        error.rotation.dot(end.attitude->covariance.llt().solve(error.rotation)) / kRuns;
    Vector<9> whole;
    whole << error.place, error.rotation,
        flight.swing.velocity(static_cast<double>(end.stamp) * 1e-9) - ekf.belief().x.segment<3>(4);
    const std::vector<int> rows{0, 1, 3, 7, 8, 2, 4, 5, 6};
    const Matrix<9, 9> of_all = ekf.belief().P(rows, rows);
    result.all += whole.dot(of_all.llt().solve(whole)) / kRuns;
  }
  result.nis /= result.rows;
  return result;
}

void nothing(AirEkf::Config& /*config*/) {}

TEST(InertialAirEkf, errors_with_every_sensor_are_as_large_as_it_believes) {
  const Consistency result = measure(nothing);
  EXPECT_TRUE(in_band(result.place, 3, kRuns, 0.99)) << result.place;
  EXPECT_TRUE(in_band(result.rotation, 3, kRuns, 0.99)) << result.rotation;
  EXPECT_TRUE(in_band(result.all, 9, kRuns, 0.99)) << result.all;
  EXPECT_TRUE(in_band(result.nis, 1, result.rows, 0.99)) << result.nis;
}

/// Of what may be noise it learns no heading, which makes it cautious where nothing else shows it,
/// by a seventh at most.
bool cautious_in_band(double nees, int dof) {
  return in_band(nees, dof, kRuns, 0.99) || (nees < dof && nees > dof * 6.0 / 7.0);
}

TEST(InertialAirEkf, errors_with_ranges_alone_are_hardly_smaller_than_it_believes) {
  const Consistency result = measure(nothing, false);
  EXPECT_TRUE(cautious_in_band(result.place, 3)) << result.place;
  EXPECT_TRUE(cautious_in_band(result.rotation, 3)) << result.rotation;
  EXPECT_TRUE(cautious_in_band(result.all, 9)) << result.all;
  EXPECT_TRUE(in_band(result.nis, 1, result.rows, 0.99)) << result.nis;
}

TEST(InertialAirEkf, what_is_said_wrong_of_the_sensors_shows) {
  const auto shows = [](const char* what, const auto& change) {
    const Consistency result = measure(change);
    EXPECT_FALSE(in_band(result.all, 9, kRuns, 0.99) && in_band(result.nis, 1, result.rows, 0.99))
        << what << ": " << result.all << ", " << result.nis;
  };
  shows("gyro", [](AirEkf::Config& c) { c.inertial.sigma_turn_per_sqrt_s *= 0.3; });
  shows("accelerometer", [](AirEkf::Config& c) { c.inertial.sigma_velocity_per_sqrt_s *= 0.5; });
  shows("mount", [](AirEkf::Config& c) { c.inertial.mount.x() = 0.1; });
  shows("antenna", [](AirEkf::Config& c) { c.position.antenna_left_m = -0.5; });
  shows("altimeter", [](AirEkf::Config& c) { c.altitude.altimeter_up_m = -0.4; });
  shows("camera", [](AirEkf::Config& c) { c.landmark_in_space.sensor_up_m = -0.3; });
}

TEST(InertialAirEkf, goes_on_for_ten_seconds_without_ranges) {
  int beyond = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const InertialFlight flight = testing::swing_about(seed, 30.0);
    AirEkf ekf = testing::air_ekf(testing::inertial_config(), flight.start);
    for (const Message& message : flight.messages) {
      if (stamp_of(message) <= 20 * kSecond || std::holds_alternative<Imu>(message)) {
        (void)ekf.on(message);
      }
    }
    const AirEstimate end = ekf.estimate();
    const Off error = off(flight, end);
    const Matrix<3, 3> P = end.covariance(kPlace, kPlace);
    beyond += error.place.dot(P.llt().solve(error.place)) > 14.16 ? 1 : 0;  // 99.73 %
  }
  EXPECT_LE(beyond, 2);  // 0.27 are expected
}

TEST(InertialAirEkf, a_body_that_starts_askew_sees_which_way_is_up) {
  const Matrix<3, 3> R = rotation_of(2.5, 0.3, 0.7);  // nearly upside down
  AirEkf ekf = testing::air_ekf(testing::inertial_config(),
                                {0, {1.0, 2.0, yaw_of(R)}, 3.0, 0.01 * Matrix<4, 4>::Identity()});
  const Vector<3> up = R.transpose() * Vector<3>(0.0, 0.0, InertialMotion::kGravity);
  EXPECT_EQ(ekf.on(Imu{0, Vector<3>::Zero(), up}).verdict, Verdict::kFused);
  expect_near(ekf.attitude(), R, 1e-12);
  EXPECT_NEAR(ekf.pose().heading, yaw_of(R), 1e-12);
  const AirEstimate start = ekf.estimate();
  expect_near(rotation_of(start.attitude->quaternion), R, 1e-12);
  for (Stamp k = 1; k <= 100; ++k) {
    (void)ekf.on(Imu{k * kSecond / 100, Vector<3>::Zero(), up});
  }
  expect_near(ekf.attitude(), R, 1e-12);
  EXPECT_NEAR(ekf.height(), 3.0, 1e-9);
}

TEST(InertialAirEkf, turns_over_a_loop_where_there_is_no_heading) {
  AirEkf ekf = testing::air_ekf(testing::inertial_config(),
                                {0, {1.0, 2.0, 0.7}, 3.0, 0.01 * Matrix<4, 4>::Identity()});
  Matrix<3, 3> R = rotation_of(0.0, 0.0, 0.7);
  const Vector<3> rate(0.0, -2.0, 0.0);  // nose up, over, and round again
  for (Stamp k = 0; k <= 400; ++k) {
    const Vector<3> up = R.transpose() * Vector<3>(0.0, 0.0, InertialMotion::kGravity);
    ASSERT_EQ(ekf.on(Imu{k * kSecond / 100, rate, up}).verdict, Verdict::kFused);
    expect_near(ekf.attitude(), R, 1e-9);
    ASSERT_TRUE(testing::is_covariance(ekf.estimate().covariance));
    R *= rotation_by(0.01 * rate);
  }
}

TEST(InertialAirEkf, a_message_that_is_not_fused_changes_no_bit) {
  AirEkf::Config config = testing::inertial_config();
  config.range.gate = 0.999;
  const InertialFlight flight = testing::swing_about(3, 4.0);
  AirEkf ekf = testing::air_ekf(config, flight.start);
  for (const Message& message : flight.messages) {
    (void)ekf.on(message);
  }
  const AirEkf before = ekf;
  const auto expect_same = [&] {
    EXPECT_TRUE(same_bits(ekf.belief(), before.belief()));
    EXPECT_TRUE(same_bits(ekf.attitude(), before.attitude()));
  };
  const Stamp later = ekf.belief().stamp + kSecond / 50;
  const Stamp earlier = ekf.belief().stamp - kSecond;
  EXPECT_EQ(ekf.on(Range{later, 0, 1, 300.0, {}}).verdict, Verdict::kGated);
  expect_same();
  EXPECT_EQ(ekf.on(Range{later, 0, 99, 3.0, {}}).reason, Reason::kUnknownAnchor);
  EXPECT_EQ(ekf.on(Range{later, 7, 1, 3.0, {}}).reason, Reason::kUnknownTag);
  EXPECT_EQ(ekf.on(Range{later, 0, 1, 3.0, {}}).verdict, Verdict::kGated);
  const Vector<3> up(0.0, 0.0, 9.8);
  EXPECT_EQ(ekf.on(Imu{earlier, Vector<3>::Zero(), up}).verdict, Verdict::kStale);
  EXPECT_EQ(ekf.on(Imu{later, Vector<3>(60.0, 0.0, 0.0), up}).verdict, Verdict::kImplausible);
  EXPECT_EQ(ekf.on(Imu{later, Vector<3>::Zero(), 200.0 * up}).verdict, Verdict::kImplausible);
  EXPECT_EQ(ekf.on(Imu{later, Vector<3>::Zero(), {}}).verdict, Verdict::kNotModelled);
  EXPECT_EQ(ekf.on(Velocity{later, 1.0, 0.0}).verdict, Verdict::kIgnored);
  RangeBearing unknown;
  unknown.stamp = later;
  unknown.landmark = 77;
  unknown.bearing = 0.1;
  EXPECT_EQ(ekf.on(unknown).verdict, Verdict::kNotModelled);
  expect_refused([&] { (void)ekf.on(Imu{later, Vector<3>(NAN, 0.0, 0.0), up}); }, "angular_rate");
  expect_same();
}

TEST(InertialAirEkf, only_one_that_is_inertial_takes_samples) {
  for (const AirMotion motion : {AirMotion::kOdometry, AirMotion::kConstantVelocity}) {
    AirEkf ekf = testing::air_ekf(testing::well_informed(motion),
                                  {0, {}, 3.0, 0.01 * Matrix<4, 4>::Identity()});
    EXPECT_EQ(ekf.on(Imu{kSecond, Vector<3>::Zero(), Vector<3>(0.0, 0.0, 9.8)}).reason,
              Reason::kNotUsed);
    EXPECT_FALSE(ekf.estimate().attitude);
  }
}

TEST(InertialAirEkf, coasts_where_samples_are_missing_and_says_so) {
  const InertialFlight flight = testing::swing_about(4, 6.0);
  AirEkf ekf = testing::air_ekf(testing::inertial_config(), flight.start);
  for (const Message& message : flight.messages) {
    if (stamp_of(message) <= 4 * kSecond) {
      (void)ekf.on(message);
    }
  }
  const Matrix<3, 3> now = ekf.estimate().attitude->covariance;
  const AirEstimate held = ekf.estimate(ekf.belief().stamp + kSecond / 20);
  const AirEstimate coasted = ekf.estimate(ekf.belief().stamp + kSecond);
  EXPECT_LT(held.attitude->covariance.trace(), 2.0 * now.trace());
  // 0.2 rad / sqrt(s) about each axis, for 0.9 s
  EXPECT_NEAR(coasted.attitude->covariance.trace() - now.trace(), 3.0 * 0.04 * 0.9, 0.01);
  const Off error = off(flight, coasted);
  const Matrix<3, 3> P = coasted.covariance(kPlace, kPlace);
  EXPECT_LT(error.place.dot(P.llt().solve(error.place)), 14.16);
}

RecoveringEkf recovering(const AirEkf::Config& config, const AirEstimate& start) {
  RecoveringEkf::Config recovery;
  recovery.tracker = config;
  recovery.start.estimator.correlation_s = 0.0;
  RecoveringEkf ekf(recovery, {std::make_shared<AnchorMap>(testing::corners()),
                               {{0, {0.3, -0.2, -0.1}}},
                               {std::make_shared<LandmarkMap>(testing::beacons()), {}}});
  ekf.start_with(testing::air_ekf(config, start));
  return ekf;
}

TEST(InertialAirEkf, finds_a_heading_that_nobody_knows) {
  AirEkf::Config config = testing::inertial_config();
  config.range.gate = 0.999;
  int right = 0;
  int decided = 0;
  int sure_and_wrong = 0;
  constexpr int kStarts = 40;
  for (std::uint64_t seed = 1; seed <= kStarts; ++seed) {
    testing::Rng rng(seed);
    InertialFlight flight = testing::swing_about(seed, 30.0, {}, false);
    flight.start.pose.heading = testing::uniform(rng, -kPi, kPi);
    flight.start.covariance.row(2).setZero();
    flight.start.covariance.col(2).setZero();
    flight.start.covariance(2, 2) = kPi * kPi / 3.0;
    RecoveringEkf ekf = recovering(config, flight.start);
    EXPECT_EQ(ekf.health().state, HealthState::kAmbiguous);
    for (const Message& message : flight.messages) {
      (void)ekf.on(message);
      const AirEstimate now = *ekf.current_in_space();
      const double turned = off(flight, now).rotation.norm();
      const bool is_sure = ekf.health().state == HealthState::kOk;
      sure_and_wrong += is_sure && turned > 0.5 && turned > 4.0 * std::sqrt(now.covariance(2, 2));
    }
    decided += ekf.health().state == HealthState::kOk ? 1 : 0;
    right += off(flight, *ekf.current_in_space()).rotation.norm() < 0.2 ? 1 : 0;
  }
  EXPECT_EQ(sure_and_wrong, 0);
  EXPECT_GE(decided, kStarts - 1);
  EXPECT_GE(right, kStarts - 1);
}

/// Where it believes to be at the end, of a flight whose samples come as `change` lets them.
template <class Change>
Off after(std::uint64_t seed, double seconds, const Change& change) {
  AirEkf::Config config = testing::inertial_config();
  config.range.gate = config.pose.gate = 0.999;
  const InertialFlight flight = testing::swing_about(seed, seconds, {}, false);
  RecoveringEkf ekf = recovering(config, flight.start);
  for (const Message& message : flight.messages) {
    const Imu* sample = std::get_if<Imu>(&message);
    if (sample == nullptr) {
      (void)ekf.on(message);
    } else if (const std::optional<Imu> changed = change(*sample)) {
      (void)ekf.on(*changed);
    }
  }
  return off(flight, *ekf.current_in_space());
}

TEST(InertialAirEkf, finds_its_attitude_again_after_a_silence_of_the_sensor) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Off end = after(seed, 50.0, [](const Imu& z) -> std::optional<Imu> {
      return z.stamp > 10 * kSecond && z.stamp < 30 * kSecond ? std::nullopt : std::optional(z);
    });
    EXPECT_LT(end.place.norm(), 0.5) << seed;
    EXPECT_LT(end.rotation.norm(), 0.3) << seed;
  }
}

TEST(InertialAirEkf, rejects_a_sensor_that_hangs_and_comes_back) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    std::optional<Imu> held;
    const Off end = after(seed, 50.0, [&held](Imu z) {
      if (z.stamp > 10 * kSecond && z.stamp < 20 * kSecond) {
        held = held.value_or(z);
        z.angular_rate = held->angular_rate;
        z.specific_force = held->specific_force;
      }
      return std::optional(z);
    });
    EXPECT_LT(end.place.norm(), 0.5) << seed;
    EXPECT_LT(end.rotation.norm(), 0.3) << seed;
  }
}

TEST(InertialAirEkf, rejects_a_sample_that_leaps_alone_and_takes_what_lasts) {
  AirEkf ekf = testing::air_ekf(testing::inertial_config(),
                                {0, {1.0, 2.0, 0.0}, 3.0, 0.01 * Matrix<4, 4>::Identity()});
  const Vector<3> up(0.0, 0.0, InertialMotion::kGravity);
  const Vector<3> hit = up + Vector<3>(300.0, 0.0, 0.0);
  const Stamp tick = kSecond / 100;
  EXPECT_EQ(ekf.on(Imu{0, Vector<3>::Zero(), up}).verdict, Verdict::kFused);
  EXPECT_EQ(ekf.on(Imu{tick, Vector<3>::Zero(), hit}).reason, Reason::kJumped);
  EXPECT_EQ(ekf.on(Imu{2 * tick, Vector<3>::Zero(), up}).verdict, Verdict::kFused);
  EXPECT_NEAR(ekf.belief().x(4), 0.0, 1e-12);
  EXPECT_EQ(ekf.on(Imu{3 * tick, Vector<3>::Zero(), hit}).reason, Reason::kJumped);
  EXPECT_EQ(ekf.on(Imu{4 * tick, Vector<3>::Zero(), hit}).verdict, Verdict::kFused);
  EXPECT_EQ(ekf.on(Imu{5 * tick, Vector<3>(20.0, 0.0, 0.0), hit}).reason, Reason::kJumped);
}

TEST(InertialAirEkf, does_not_begin_with_a_force_that_is_no_gravity) {
  AirEkf ekf = testing::air_ekf(testing::inertial_config(),
                                {0, {1.0, 2.0, 0.0}, 3.0, 0.01 * Matrix<4, 4>::Identity()});
  const Outcome in_g = ekf.on(Imu{kSecond, Vector<3>::Zero(), Vector<3>(0.0, 0.0, 1.0)});
  EXPECT_EQ(in_g.verdict, Verdict::kImplausible);
  EXPECT_EQ(in_g.reason, Reason::kBeyondLimits);
  EXPECT_EQ(ekf.belief().stamp, 0);
  EXPECT_EQ(ekf.on(Imu{kSecond, Vector<3>::Zero(), Vector<3>::Zero()}).verdict,
            Verdict::kNotModelled);
}

/// A body that stands still for minutes, by one tag, at random noise of the sensor.
AirEkf standing(std::uint64_t seed, double seconds, double force_sigma, double rate_sigma) {
  testing::Rng rng(seed);
  AirEkf::Config config = testing::well_informed(AirMotion::kInertial);
  config.correlation_s = 0.0;
  AirEkf ekf = testing::air_ekf(config, {0, {1.0, 2.0, 0.0}, 3.0, 0.04 * Matrix<4, 4>::Identity()});
  const auto noise = [&rng](double sigma) {
    return Vector<3>(testing::normal(rng, sigma), testing::normal(rng, sigma),
                     testing::normal(rng, sigma));
  };
  const Vector<3> bias = noise(0.01);
  const Vector<3> tag(1.3, 1.8, 2.9);
  for (Stamp k = 0; k <= static_cast<Stamp>(100.0 * seconds); ++k) {
    const Stamp now = k * kSecond / 100;
    (void)ekf.on(Imu{now, noise(rate_sigma) + bias,
                     noise(force_sigma) + Vector<3>(0.0, 0.0, InertialMotion::kGravity)});
    for (const Anchor& a : testing::corners()) {
      if (k % 20 == 0) {
        const double range = (tag - a.position).norm() + testing::normal(rng, 0.1);
        (void)ekf.on(Range{now, 0, a.id, range, {}});
      }
    }
  }
  return ekf;
}

TEST(InertialAirEkf, a_body_at_rest_learns_no_heading_of_noise) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const AirEstimate end = standing(seed, 120.0, 0.5, 0.02).estimate();
    EXPECT_LT(std::abs(end.pose.heading), 3.0 * std::sqrt(end.covariance(2, 2))) << seed;
    EXPECT_GT(end.covariance(2, 2), 0.04) << seed;  // of the start
  }
}

TEST(InertialAirEkf, a_calm_sensor_shows_the_bias_of_its_gyro_at_rest) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const AirEkf ekf = standing(seed, 60.0, 0.05, 0.005);
    const AirEstimate end = ekf.estimate();
    EXPECT_LT(std::abs(end.pose.heading), 3.0 * std::sqrt(end.covariance(2, 2))) << seed;
    EXPECT_LT(end.covariance(2, 2), 0.25) << seed;
    EXPECT_LT(ekf.belief().P(11, 11), 0.002 * 0.002) << seed;
  }
}

TEST(InertialAirEkf, a_heading_is_unknown_where_the_body_points_upwards) {
  const Matrix<3, 3> R = rotation_of(0.0, -1.52, 0.7);
  AirEkf ekf = testing::air_ekf(testing::inertial_config(),
                                {0, {1.0, 2.0, 0.7}, 3.0, 0.01 * Matrix<4, 4>::Identity()});
  (void)ekf.on(
      Imu{0, Vector<3>::Zero(), R.transpose() * Vector<3>(0.0, 0.0, InertialMotion::kGravity)});
  const AirEstimate here = ekf.estimate();
  EXPECT_GT(here.covariance(2, 2), 0.5);
  EXPECT_NEAR(here.attitude->covariance(2, 2), 0.01, 1e-12);
}

TEST(InertialAirEkf, late_messages_give_the_bits_of_those_in_order) {
  AirEkf::Config config = testing::inertial_config();
  config.range.gate = 0.999;
  const InertialFlight flight = testing::swing_about(6, 8.0);
  const RecoveringEkf start = recovering(config, flight.start);
  MessageLog in_order;
  MessageLog late;
  testing::Rng rng(7);
  for (const Message& message : flight.messages) {
    in_order.add(message, stamp_of(message));
    const double delay =
        testing::uniform(rng, 0.0, 1.0) < 0.2 ? testing::uniform(rng, 0.0, 0.5) : 0;
    late.add(message, stamp_of(message) + static_cast<Stamp>(delay * 1e9));
  }
  in_order.sort();
  late.sort();
  const RunLog one = replay(start, in_order, {});
  const RunLog other = replay(start, late, {});
  EXPECT_TRUE(same_bits(one.last.covariance, other.last.covariance));
  EXPECT_EQ(one.last.pose.x, other.last.pose.x);
  ASSERT_FALSE(one.in_space.empty());
  ASSERT_FALSE(other.in_space.empty());
  EXPECT_TRUE(same_bits(one.in_space.back().attitude->quaternion,
                        other.in_space.back().attitude->quaternion));
}

}  // namespace
}  // namespace locfuse::test_air_ekf_inertial
