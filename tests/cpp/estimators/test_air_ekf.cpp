// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <utility>

#include "support/expect.hpp"
#include "support/flight.hpp"
#include "support/linear_kalman.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_air_ekf {
namespace {

using testing::at;
using testing::expect_near;
using testing::expect_pose_near;
using testing::expect_refused;
using testing::kSecond;
using testing::linear_kalman;
using testing::Rng;
using testing::same_bits;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

AirEstimate start_at(const Pose2& pose, double height) {
  Rng rng(5);
  return {0, pose, height, 0.1 * testing::random_covariance(rng, 4)};
}

AirEkf flying(AirMotion motion = AirMotion::kOdometry) {
  AirEkf::Config config = testing::well_informed(motion);
  config.range.gate = config.landmark.gate = config.altitude.gate = 0.999;
  return testing::air_ekf(config, start_at({1.0, 2.0, 0.5}, 3.0));
}

/// A range of the corner with that number from where a body believes to be, and `error` more.
Range range_to(const AirEkf& ekf, Id anchor, Stamp stamp, double error) {
  const AirEstimate e = ekf.estimate(stamp);
  const Vector<2> tag = e.pose.act({0.3, -0.2});
  const Vector<3> a = testing::corners()[static_cast<std::size_t>(anchor)].position;
  return {stamp, 0, anchor, (Vector<3>(tag.x(), tag.y(), e.height - 0.1) - a).norm() + error, {}};
}

TEST(AirEkf, starts_where_it_is_put_with_what_height_and_pose_share) {
  const AirEstimate start = start_at({1.0, 2.0, -kPi}, 3.0);
  const AirEstimate estimate = testing::air_ekf({}, start).estimate();
  expect_pose_near(estimate.pose, start.pose, 0.0);
  EXPECT_EQ(estimate.height, 3.0);
  expect_near(estimate.covariance, start.covariance, 1e-15);
}

TEST(AirEkf, moves_by_odometry_among_more_anchors_than_are_remembered) {
  std::vector<Anchor> anchors;
  for (Id id = 0; id < 100; ++id) {
    anchors.push_back({id, {10.0 * std::cos(id), 10.0 * std::sin(id), 0.1 * id}});
  }
  const AirEkf::Config config = testing::well_informed(AirMotion::kOdometry);
  AirEkf ekf = testing::air_ekf(config, start_at({}, 3.0), anchors);
  for (Stamp k = 1; k <= 300; ++k) {
    const Stamp now = k * kSecond / 10;
    ASSERT_EQ(ekf.on(Increment{now - kSecond / 10, now, {0.01, 0.0, 0.0}}).verdict,
              Verdict::kFused);
    const Vector<3> at = anchors[static_cast<std::size_t>(k % 100)].position;
    const AirEstimate here = ekf.estimate(now);
    const Vector<2> tag = here.pose.act({0.3, -0.2});
    const double range = (Vector<3>(tag.x(), tag.y(), here.height - 0.1) - at).norm();
    ASSERT_EQ(ekf.on(Range{now, 0, static_cast<Id>(k % 100), range, {}}).verdict, Verdict::kFused);
    ASSERT_TRUE(ekf.estimate().covariance.allFinite());
  }
}

TEST(AirEkf, without_odometry_equals_the_linear_filter) {
  // Positions, altitudes and headings are linear, and so is a constant velocity.
  AirEkf ekf = flying(AirMotion::kConstantVelocity);
  const ConstantVelocityMotion motion({0.5, 0.3, 0.2});
  Eigen::VectorXd x = Eigen::VectorXd::Zero(7);
  x.head(4) << 1.0, 2.0, 0.5, 3.0;
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(7, 7);
  P.topLeftCorner(4, 4) = start_at({}, 0.0).covariance;
  P.diagonal().tail(3) << 0.16, 0.16, 0.04;
  Rng rng(1);
  for (int i = 1; i <= 60; ++i) {
    const double T = 0.1 * (1 + i % 3);
    const Stamp stamp = ekf.belief().stamp + at(T);
    const auto step = motion.propagate(x, T);
    P = step.jacobian * P * step.jacobian.transpose() + step.noise;
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3, 7);
    Eigen::VectorXd r(3);
    Eigen::MatrixXd R = Eigen::MatrixXd::Identity(3, 3);
    Outcome outcome;
    if (i % 3 == 0) {
      const Altitude z{stamp, 3.0 + testing::normal(rng, 0.3), 0.3};
      H.conservativeResize(1, 7);
      H(0, 3) = 1.0;
      r = Eigen::VectorXd::Constant(1, z.height - 0.05 - step.moved(3));
      R = Eigen::MatrixXd::Constant(1, 1, 0.09);
      outcome = ekf.on(z);
    } else {
      const PoseObservation z{
          stamp,
          {1.0 + testing::normal(rng, 0.2), 2.0 + testing::normal(rng, 0.2), 0.5},
          0.04 * Matrix<3, 3>::Identity()};
      H.leftCols(3).setIdentity();
      r << z.pose.x - step.moved(0), z.pose.y - step.moved(1), z.pose.heading - step.moved(2);
      R *= 0.04;
      outcome = ekf.on(z);
    }
    const testing::LinearKalman expected = linear_kalman(step.moved, P, r, H, R);
    ASSERT_EQ(outcome.verdict, Verdict::kFused);
    EXPECT_NEAR(outcome.nis, expected.nis, 1e-9);
    x = expected.x;
    P = expected.P;
    expect_near(ekf.belief().x, x, 1e-12);
    expect_near(Eigen::MatrixXd(ekf.belief().P), P, 1e-12);
  }
}

TEST(AirEkf, a_fix_in_space_is_a_position_and_an_altitude_of_one_stamp) {
  AirEkf ekf = flying();
  const AirEstimate start = start_at({1.0, 2.0, 0.5}, 3.0);
  ekf.on(PositionFix{0, {1.2, 1.9}, 0.04 * Matrix<2, 2>::Identity()});
  ekf.on(Altitude{0, 3.25, 0.2});
  Matrix<3, 4> H = Matrix<3, 4>::Zero();
  H(0, 0) = H(1, 1) = H(2, 3) = 1.0;
  const auto expected =
      linear_kalman(Vector<4>(1.0, 2.0, 0.5, 3.0), start.covariance, Vector<3>(0.2, -0.1, 0.2), H,
                    0.04 * Matrix<3, 3>::Identity());
  expect_near(ekf.belief().x, expected.x, 1e-13);
  expect_near(Eigen::MatrixXd(ekf.belief().P), expected.P, 1e-13);
}

TEST(AirEkf, a_position_of_a_tag_is_one_of_an_antenna_there) {
  AirEkf::Config config;
  config.position = {0.3, -0.2};
  const AirEstimate start = start_at({1.0, 2.0, 0.5}, 3.0);
  AirEkf antenna(config, {testing::hall(), testing::one_tag()}, start);
  AirEkf tag({}, {testing::hall(), testing::one_tag()}, start);
  PositionFix z{0, {1.2, 1.9}, 0.04 * Matrix<2, 2>::Identity()};
  antenna.on(z);
  z.tag = 0;
  tag.on(z);
  EXPECT_TRUE(testing::same_bits(tag.belief(), antenna.belief()));
  z.tag = 9;
  EXPECT_EQ(tag.on(z).verdict, Verdict::kNotModelled);
  EXPECT_TRUE(testing::same_bits(tag.belief(), antenna.belief()));
}

TEST(AirEkf, at_a_known_height_is_the_filter_of_the_plane) {
  const testing::Simulation run = testing::simulate(3, 20.0);
  PoseEkf::Config plane;
  plane.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  AirEkf::Config space;
  space.odometry = plane.odometry;
  space.sigma_height_per_sqrt_s = 0.0;
  AirEstimate start{0, run.start.pose, 0.0, Matrix<4, 4>::Zero()};
  start.covariance.topLeftCorner<3, 3>() = run.start.covariance;
  start.covariance(3, 3) = 1e-16;
  PoseEkf expected(plane, {testing::hall(), testing::one_tag()}, run.start);
  AirEkf ekf(space, {testing::hall(), testing::one_tag()}, start);
  for (const Message& message : run.messages) {
    expected.on(message);
    if (const auto* u = std::get_if<Increment>(&message)) {
      EXPECT_EQ(ekf.on(*u).verdict, Verdict::kFused);
    } else {
      ekf.on(std::get<Range>(message));
    }
  }
  expect_pose_near(ekf.estimate().pose, expected.estimate().pose, 1e-9);
  EXPECT_NEAR(ekf.estimate().height, 0.0, 1e-9);
  expect_near(Matrix<3, 3>(ekf.estimate().covariance.topLeftCorner<3, 3>()),
              expected.estimate().covariance, 1e-9);
}

TEST(AirEkf, climbs_as_long_as_its_odometry_is_held) {
  AirEkf::Config config = testing::well_informed(AirMotion::kOdometry);
  config.hold_s = 2.0;
  config.sigma_lost_height_per_sqrt_s = 0.7;
  AirEkf ekf = testing::air_ekf(config, start_at({}, 3.0));
  const double variance = ekf.estimate().covariance(3, 3);
  ekf.on(Velocity{kSecond, 1.0, 0.1}, 0.5);
  EXPECT_NEAR(ekf.estimate(2 * kSecond).height, 3.5, 1e-14);
  EXPECT_NEAR(ekf.estimate(2 * kSecond).covariance(3, 3), variance + 2.0 * 0.01, 1e-14);
  const AirEstimate lost = ekf.estimate(5 * kSecond);
  EXPECT_NEAR(lost.height, 4.0, 1e-14);
  EXPECT_NEAR(lost.covariance(3, 3), variance + 3.0 * 0.01 + 2.0 * 0.49, 1e-13);
  for (int i = 11; i <= 50; ++i) {
    ekf.advance_to(i * kSecond / 10);
  }
  EXPECT_NEAR(ekf.height(), 4.0, 1e-13);
  EXPECT_NEAR(ekf.estimate().covariance(3, 3), lost.covariance(3, 3), 1e-13);
}

TEST(AirEkf, climbs_during_an_increment_from_its_beginning) {
  AirEkf ekf = flying();
  ekf.on(Increment{kSecond, 3 * kSecond, {1.0, 0.0, 0.2}}, -0.25);
  EXPECT_EQ(ekf.belief().stamp, kSecond);
  EXPECT_EQ(ekf.height(), 3.0);
  EXPECT_NEAR(ekf.estimate(2 * kSecond).height, 2.75, 1e-14);
  EXPECT_NEAR(ekf.estimate().height, 2.5, 1e-14);
  ekf.on(Increment{3 * kSecond, 3 * kSecond, {1.0, 0.0, 0.0}}, 9.0);  // takes no time
  EXPECT_NEAR(ekf.height(), 2.5, 1e-14);
}

/// `refuse(ekf)` leaves no trace, now or in what follows.
template <class Refuse>
void expect_no_trace(AirMotion motion, const Refuse& refuse) {
  AirEkf ekf = flying(motion);
  ekf.on(Increment{0, 2 * kSecond, {1.0, 0.1, 0.7}}, 0.3);
  ekf.advance_to(kSecond);
  AirEkf twin = ekf;
  refuse(ekf);
  EXPECT_TRUE(same_bits(ekf.belief(), twin.belief()));
  EXPECT_EQ(ekf.estimate().stamp, twin.estimate().stamp);
  const Range next = range_to(twin, 1, 3 * kSecond, 0.1);
  EXPECT_EQ(ekf.on(next).verdict, twin.on(next).verdict);
  EXPECT_TRUE(same_bits(ekf.belief(), twin.belief()));
}

template <class Message>
void expect_no_trace(const Message& message, Verdict verdict) {
  for (const AirMotion motion : {AirMotion::kOdometry, AirMotion::kConstantVelocity}) {
    expect_no_trace(motion, [&](AirEkf& ekf) { EXPECT_EQ(ekf.on(message).verdict, verdict); });
  }
}

TEST(AirEkf, messages_that_are_not_fused_change_no_bit) {
  const Stamp later = 2 * kSecond;
  const Matrix<2, 2> I2 = 1e-4 * Matrix<2, 2>::Identity();
  const Matrix<3, 3> I3 = 1e-4 * Matrix<3, 3>::Identity();
  expect_no_trace(Range{later, 0, 0, 90.0, 0.1}, Verdict::kGated);
  expect_no_trace(PositionFix{later, {70.0, 0.0}, I2}, Verdict::kGated);
  expect_no_trace(Altitude{later, 90.0, 0.1}, Verdict::kGated);
  expect_no_trace(PoseObservation{later, {70.0, 0.0, 0.0}, I3}, Verdict::kGated);
  expect_no_trace(RangeBearing{later, 0, 90.0, {}, {}}, Verdict::kGated);
  expect_no_trace(Range{later, 0, 9, 4.0, {}}, Verdict::kNotModelled);
  expect_no_trace(RangeBearing{later, 9, 4.0, {}, {}}, Verdict::kNotModelled);
  expect_no_trace(RangeBearing{later, {}, 4.0, {}, {}}, Verdict::kNotModelled);
}

TEST(AirEkf, messages_older_than_the_belief_are_stale) {
  const Stamp old = kSecond - 1;
  expect_no_trace(Range{old, 0, 0, 9.0, 0.1}, Verdict::kStale);
  expect_no_trace(Altitude{old, 3.0, 0.1}, Verdict::kStale);
  expect_no_trace(RangeBearing{old, {}, 9.0, {}, {}}, Verdict::kStale);
  expect_no_trace(AirMotion::kOdometry, [&](AirEkf& ekf) {
    EXPECT_EQ(ekf.on(Velocity{old, 1.0, 0.0}, 2.0).verdict, Verdict::kStale);
    EXPECT_EQ(ekf.on(Increment{0, old, {1.0, 0.0, 0.0}}, 2.0).verdict, Verdict::kStale);
  });
}

TEST(AirEkf, with_constant_velocity_odometry_is_ignored) {
  expect_no_trace(AirMotion::kConstantVelocity, [](AirEkf& ekf) {
    EXPECT_EQ(ekf.on(Velocity{2 * kSecond, 1.0, 0.0}, 2.0).verdict, Verdict::kIgnored);
  });
}

TEST(AirEkf, mistakes_and_broken_numbers_leave_no_trace) {
  for (const AirMotion motion : {AirMotion::kOdometry, AirMotion::kConstantVelocity}) {
    expect_no_trace(motion, [](AirEkf& ekf) {
      expect_refused([&] { ekf.on(Range{2 * kSecond, 0, 0, -1.0, {}}); }, "-1");
      expect_refused([&] { ekf.on(Altitude{2 * kSecond, kNan, 0.1}); }, "Altitude.height");
      expect_refused([&] { ekf.on(Altitude{2 * kSecond, 1.0, 0.0}); }, "Altitude.sigma");
      expect_refused([&] { ekf.on(RangeBearing{2 * kSecond, 0, {}, {}, {}}); }, "neither");
      expect_refused([&] { ekf.on(RangeBearing{2 * kSecond, 0, {}, {}, {}, 1.6, {}}); }, "1.6");
      expect_refused([&] { ekf.on(RangeBearing{2 * kSecond, 0, {}, {}, {}, 0.1, -1.0}); }, "-1");
      expect_refused([&] { ekf.on(Velocity{2 * kSecond, 1.0, 0.0}, kNan); }, "climb_rate", "nan");
      expect_refused([&] { ekf.advance_to(kStampLimit); }, "stamp");
      expect_refused([&] { (void)ekf.estimate(kSecond - 1); }, "before");
    });
  }
  const double huge = std::numeric_limits<double>::max();
  expect_no_trace(AirMotion::kOdometry, [&](AirEkf& ekf) {
    EXPECT_EQ(ekf.on(Increment{2 * kSecond, 2 * kSecond, {huge, huge, 0.0}}, 1.0).verdict,
              Verdict::kImplausible);
    EXPECT_EQ(ekf.on(Velocity{2 * kSecond, 0.0, 0.0}, huge).verdict, Verdict::kImplausible);
  });
}

TEST(AirEkf, the_fastest_climb_that_limits_allow_breaks_no_number) {
  AirEkf::Config config;
  config.hold_s = 10.0;
  config.limits.speed_mps = 1e12;
  AirEkf ekf = testing::air_ekf(config, start_at({}, 3.0));
  ekf.on(Velocity{0, 0.0, 0.0}, 1e12);
  const AirEkf twin = ekf;
  EXPECT_EQ(ekf.on(Altitude{10 * kSecond, 3.0, 0.1}).verdict, Verdict::kGated);
  EXPECT_TRUE(same_bits(ekf.belief(), twin.belief()));
  ekf.advance_to(10 * kSecond);
  EXPECT_TRUE(ekf.belief().P.allFinite());
}

TEST(AirEkf, refuses_settings_and_starts_that_are_none) {
  const AirEstimate start = start_at({}, 3.0);
  const auto refused = [&](auto change, const char* word) {
    AirEkf::Config config;
    change(config);
    expect_refused([&] { (void)testing::air_ekf(config, start); }, word);
  };
  refused([](AirEkf::Config& c) { c.sigma_height_per_sqrt_s = -0.1; }, "sigma_height_per_sqrt_s");
  refused([](AirEkf::Config& c) { c.sigma_height_per_sqrt_s = 1e160; }, "expected 0 to 1e6");
  refused([](AirEkf::Config& c) { c.sigma_lost_height_per_sqrt_s = 1e160; }, "expected 0 to 1e6");
  refused([](AirEkf::Config& c) { c.sigma_lost_height_per_sqrt_s = 0.0; }, "sigma_lost_height");
  refused([](AirEkf::Config& c) { c.sigma_start_velocity_mps = 0.0; }, "sigma_start_velocity_mps");
  refused([](AirEkf::Config& c) { c.sigma_start_climb_mps = kNan; }, "sigma_start_climb_mps");
  refused([](AirEkf::Config& c) { c.altitude.altimeter_up_m = kNan; }, "altimeter_up_m");
  refused([](AirEkf::Config& c) { c.landmark_in_space.sigma_elevation_rad = 0.0; }, "elevation");
  refused([](AirEkf::Config& c) { c.constant_velocity.sigma_climb_per_sqrt_s = 0.0; }, "climb");
  refused([](AirEkf::Config& c) { c.altitude.gate = 0.0; }, "0");
  AirEstimate wrong = start;
  wrong.height = kNan;
  expect_refused([&] { (void)testing::air_ekf({}, wrong); }, "height", "nan");
  wrong = start;
  wrong.covariance.col(3).setZero();
  wrong.covariance.row(3).setZero();
  expect_refused([&] { (void)testing::air_ekf({}, wrong); }, "positive definite");
}

}  // namespace
}  // namespace locfuse::test_air_ekf
