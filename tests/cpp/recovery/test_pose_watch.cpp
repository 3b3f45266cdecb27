// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "locfuse/recovery/pose_watch.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/timeline.hpp"
#include "recovery/within.hpp"
#include "support/bits.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::test_pose_watch {
namespace {

using testing::at;
using testing::normal;
using testing::Rng;
using testing::same_bits;
using testing::uniform;

constexpr double kLimit = 1.0;

Matrix<3, 3> covariance(double sigma_xy, double sigma_heading) {
  return Vector<3>(sigma_xy * sigma_xy, sigma_xy * sigma_xy, sigma_heading * sigma_heading)
      .asDiagonal();
}

TEST(ProbabilityWithin, is_the_share_of_draws_that_are) {
  Rng rng(1);
  for (int run = 0; run < 30; ++run) {
    const Vector<2> mean(uniform(rng, -2.0, 2.0), uniform(rng, -2.0, 2.0));
    const double a = uniform(rng, 0.01, 1.5);
    const double b = run % 3 == 0 ? 0.02 : uniform(rng, 0.01, 1.5);
    const double turn = uniform(rng, -kPi, kPi);
    Matrix<2, 2> R;
    R << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
    constexpr int kDraws = 40'000;
    int within = 0;
    for (int k = 0; k < kDraws; ++k) {
      const Vector<2> x = mean + R * Vector<2>(normal(rng, a), normal(rng, b));
      within += x.norm() < kLimit ? 1 : 0;
    }
    const Matrix<2, 2> P = R * Vector<2>(a * a, b * b).asDiagonal() * R.transpose();
    const double p = internal::probability_within(kLimit, mean, P);
    const double sigma = std::sqrt(std::max(p * (1.0 - p), 1e-4) / kDraws);
    EXPECT_NEAR(p, static_cast<double>(within) / kDraws, 5.0 * sigma) << mean << "\n" << P;
  }
}

TEST(ProbabilityWithin, about_zero_is_that_of_health) {
  Rng rng(2);
  for (int run = 0; run < 100; ++run) {
    Matrix<2, 2> A;
    A << uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0),
        uniform(rng, -1.0, 1.0);
    const Matrix<2, 2> P = A * A.transpose() + 0.05 * Matrix<2, 2>::Identity();
    EXPECT_NEAR(internal::probability_within(kLimit, Vector<2>::Zero(), P),
                internal::probability_within(kLimit, P), 1e-3);
  }
}

TEST(ProbabilityWithin, has_an_answer_for_any_size) {
  const Matrix<2, 2> nothing = Matrix<2, 2>::Zero();
  EXPECT_NEAR(internal::probability_within(1.0, Vector<2>(0.5, 0.5), nothing), 1.0, 1e-6);
  EXPECT_EQ(internal::probability_within(1.0, Vector<2>(1.5, 0.0), nothing), 0.0);
  const Matrix<2, 2> vast = 1e8 * Matrix<2, 2>::Identity();
  EXPECT_NEAR(internal::probability_within(1.0, Vector<2>(5.0, 0.0), vast), 0.5e-8, 1e-10);
  EXPECT_EQ(internal::probability_within(1.0, Vector<2>(1e9, 0.0), nothing), 0.0);
  EXPECT_NEAR(internal::probability_within(0.5, 0.0, 0.0625), 0.9545, 1e-4);
  EXPECT_NEAR(internal::probability_within(0.5, 4.0, 1.0), 0.000229, 1e-6);
}

/// A watch, with an estimate that drives along x at 1 m/s and is as good as is said.
struct Watched {
  PoseWatch watch{config()};
  Pose2 here;
  Stamp now = 0;
  Matrix<3, 3> P = covariance(0.05, 0.01);
  HealthReport health = good();

  static PoseWatch::Config config() {
    PoseWatch::Config c;
    c.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
    return c;
  }
  static HealthReport good() {
    HealthReport h;
    h.state = HealthState::kOk;
    h.reason = HealthReason::kNone;
    h.wrong = 1e-4;
    h.within = 0.9999;
    h.protection << 0.2, 0.2, 0.05;
    return h;
  }

  [[nodiscard]] PoseEstimate estimate() const { return {now, here, P}; }
  [[nodiscard]] WatchReport report() const { return watch.report(estimate(), health); }

  void drive(double seconds, double speed = 1.0) {
    const auto end = now + at(seconds);
    for (; now < end; now += at(0.1)) {
      watch.on(Increment{now, now + at(0.1), {0.1 * speed, 0.0, 0.0}});
      here = here * Pose2{0.1 * speed, 0.0, 0.0};
    }
  }
  Outcome pose(const Pose2& off, double sigma = 0.05) {
    const PoseObservation z{now, here * off, covariance(sigma, 0.02)};
    return watch.on(z, estimate(), health);
  }
  /// Ten seconds with a pose that is that far off each half second.
  void follow(const Pose2& off, double sigma = 0.05) {
    for (int k = 0; k < 20; ++k) {
      drive(0.5);
      (void)pose(off, sigma);
    }
  }
};

TEST(PoseWatch, says_nothing_before_there_is_a_pose) {
  const Watched w;
  EXPECT_EQ(w.report().state, HealthState::kInitializing);
  EXPECT_EQ(w.report().reason, WatchReason::kNoPose);
  EXPECT_EQ(w.report().within, 0.0);
}

TEST(PoseWatch, is_ok_while_poses_are_as_far_off_as_they_say) {
  Watched w;
  w.follow({0.05, 0.04, 0.01});
  const WatchReport report = w.report();
  EXPECT_EQ(report.state, HealthState::kOk);
  EXPECT_EQ(report.reason, WatchReason::kNone);
  EXPECT_GT(report.within, 0.999);
  EXPECT_EQ(report.wrong, 1.0 - report.within);
  EXPECT_NEAR(report.error.x(), 0.05, 1e-12);
  EXPECT_NEAR(report.error.y(), 0.04, 1e-12);
  EXPECT_NEAR(report.protection.x(), 0.25, 1e-12);  // that of the estimate and the distance to it
  EXPECT_NEAR(report.protection.y(), 0.24, 1e-12);
}

TEST(PoseWatch, names_what_it_does_with_a_pose) {
  Watched w;
  w.drive(1.0);
  const Outcome outcome = w.pose({0.1, 0.0, 0.0});
  EXPECT_EQ(outcome.verdict, Verdict::kIgnored);
  EXPECT_EQ(outcome.reason, Reason::kWatched);
  EXPECT_EQ(outcome.dof, 3);
  EXPECT_NEAR(outcome.nis, 0.1 * 0.1 / (2.0 * 0.05 * 0.05), 1e-9);
}

TEST(PoseWatch, is_lost_at_once_where_a_pose_is_too_far_off_and_ok_once_it_is_back) {
  for (const Pose2& off : {Pose2{3.0, 0.0, 0.0}, Pose2{0.0, 0.0, 0.8}, Pose2{0.0, -10.0, 3.0}}) {
    Watched w;
    w.follow({});
    (void)w.pose(off);
    EXPECT_EQ(w.report().state, HealthState::kLost);
    EXPECT_EQ(w.report().reason, WatchReason::kFarOff);
    EXPECT_LT(w.report().within, 0.01);
    w.drive(0.5);
    (void)w.pose({});
    EXPECT_EQ(w.report().state, HealthState::kOk);
  }
}

TEST(PoseWatch, is_degraded_near_the_limit_and_where_sigmas_are_too_small) {
  Watched w;
  w.follow({});
  (void)w.pose({0.97, 0.0, 0.0}, 0.5);
  EXPECT_EQ(w.report().state, HealthState::kDegraded);
  EXPECT_EQ(w.report().reason, WatchReason::kFarOff);
  w.follow({0.4, 0.0, 0.0});  // eight times the stated sigma
  EXPECT_EQ(w.report().reason, WatchReason::kSigmasTooSmall);
  w.follow({0.4, 0.0, 0.0}, 0.4);
  EXPECT_EQ(w.report().state, HealthState::kOk);
}

TEST(PoseWatch, says_that_poses_are_silent_once_the_robot_has_moved_on) {
  Watched w;
  w.follow({});
  w.drive(30.0, 0.0);  // AMCL has nothing to say of a robot that stands
  EXPECT_EQ(w.report().state, HealthState::kOk);
  w.drive(0.9);
  EXPECT_EQ(w.report().state, HealthState::kOk);
  w.drive(0.3);
  EXPECT_EQ(w.report().state, HealthState::kDeadReckoning);
  EXPECT_EQ(w.report().reason, WatchReason::kSilent);
  EXPECT_NEAR(w.report().error.norm(), 0.0, 1e-9);  // where odometry has carried it
  (void)w.pose({});
  EXPECT_EQ(w.report().state, HealthState::kOk);
}

TEST(PoseWatch, is_lost_with_the_estimate_at_one_place_and_unverified_at_another) {
  Watched w;
  w.follow({});
  w.health.state = HealthState::kLost;
  w.health.reason = HealthReason::kScansDoNotFit;
  w.health.wrong = 0.9;
  w.health.within = 0.1;
  EXPECT_EQ(w.report().state, HealthState::kLost);
  EXPECT_EQ(w.report().reason, WatchReason::kContradicted);
  EXPECT_NEAR(w.report().within, 0.1, 1e-3);
  w.health.wrong = 0.9;
  Watched other;
  other.health = w.health;
  other.drive(1.0);
  (void)other.pose({});
  other.drive(1.0);
  (void)other.pose({5.0, 0.0, 0.0});  // which odometry does not explain either
  EXPECT_EQ(other.report().state, HealthState::kDegraded);
  EXPECT_EQ(other.report().reason, WatchReason::kUnverified);
  other.here = other.here * Pose2{5.0, 0.0, 0.0};  // it looks for itself, and finds itself there
  (void)other.pose({});
  EXPECT_EQ(other.report().state, HealthState::kDegraded);
  other.health = Watched::good();
  EXPECT_EQ(other.report().state, HealthState::kOk);
}

/// With an estimate too vague to judge anything.
Watched with_odometry_alone() {
  Watched w;
  w.follow({});
  w.P = covariance(2.0, 0.5);
  w.health.state = HealthState::kDeadReckoning;
  w.health.reason = HealthReason::kSilence;
  w.health.within = 0.01;
  w.health.protection.setConstant(std::numeric_limits<double>::infinity());
  return w;
}

TEST(PoseWatch, notices_a_jump_by_odometry_alone_and_believes_one_that_stays) {
  Watched w = with_odometry_alone();
  w.follow({});
  EXPECT_EQ(w.report().state, HealthState::kDegraded);
  EXPECT_EQ(w.report().reason, WatchReason::kUnverified);
  w.drive(0.5);
  (void)w.pose({6.0, 0.0, 0.0});
  EXPECT_EQ(w.report().state, HealthState::kLost);
  EXPECT_EQ(w.report().reason, WatchReason::kJumped);
  w.drive(0.5);
  (void)w.pose({});
  EXPECT_EQ(w.report().reason, WatchReason::kUnverified);
  w.drive(0.5);
  (void)w.pose({6.0, 0.0, 0.0});
  EXPECT_EQ(w.report().reason, WatchReason::kJumped);
  w.follow({6.0, 0.0, 0.0});
  EXPECT_EQ(w.report().reason, WatchReason::kJumped);
  w.follow({6.0, 0.0, 0.0});
  w.follow({6.0, 0.0, 0.0});
  EXPECT_EQ(w.report().reason, WatchReason::kUnverified);
}

TEST(PoseWatch, notices_by_odometry_alone_that_poses_stand_still) {
  Watched w = with_odometry_alone();
  const Pose2 frozen = w.here;
  for (int k = 0; k < 8; ++k) {
    w.drive(0.5);
    (void)w.watch.on(PoseObservation{w.now, frozen, covariance(0.05, 0.02)}, w.estimate(),
                     w.health);
  }
  EXPECT_EQ(w.report().state, HealthState::kLost);
  EXPECT_EQ(w.report().reason, WatchReason::kJumped);
}

TEST(PoseWatch, a_vague_estimate_does_not_call_a_pose_lost) {
  Watched w;
  w.follow({});
  w.P = covariance(0.8, 0.1);  // a pose that is right is 1.2 m off in one of three
  w.health.within = 0.54;
  w.health.state = HealthState::kDegraded;
  (void)w.pose({1.2, 0.0, 0.0});
  EXPECT_EQ(w.report().state, HealthState::kDegraded);
  EXPECT_EQ(w.report().reason, WatchReason::kUnverified);
  (void)w.pose({5.0, 0.0, 0.0});
  EXPECT_EQ(w.report().state, HealthState::kLost);
  EXPECT_EQ(w.report().reason, WatchReason::kFarOff);
  w = with_odometry_alone();  // however much it says of its drift
  w.P = covariance(0.05, 0.01);
  w.drive(0.5);
  (void)w.pose({0.9, 0.0, 0.0});
  EXPECT_EQ(w.report().state, HealthState::kDegraded);
}

TEST(PoseWatch, notices_a_jump_after_a_long_silence) {
  Watched w = with_odometry_alone();
  w.drive(40.0, 0.0);
  (void)w.pose({6.0, 0.0, 0.0});
  EXPECT_EQ(w.report().reason, WatchReason::kJumped);
  w.drive(15.0, 0.0);
  (void)w.pose({6.0, 0.0, 0.0});
  EXPECT_EQ(w.report().reason, WatchReason::kJumped);
  w.drive(10.0, 0.0);
  (void)w.pose({6.0, 0.0, 0.0});
  EXPECT_EQ(w.report().reason, WatchReason::kUnverified);
}

TEST(PoseWatch, takes_no_motion_for_a_jump_that_odometry_did_not_see) {
  Watched w = with_odometry_alone();
  w.now += at(10.0);  // without odometry
  w.here = w.here * Pose2{8.0, 0.0, 0.0};
  (void)w.pose({});
  EXPECT_EQ(w.report().reason, WatchReason::kUnverified);
}

TEST(PoseWatch, refuses_a_pose_from_before_odometry_as_stale) {
  Watched w;
  w.follow({});
  const PoseObservation z{w.now - at(1.0), w.here, covariance(0.05, 0.02)};
  const Outcome outcome = w.watch.on(z, w.estimate(), w.health);
  EXPECT_EQ(outcome.verdict, Verdict::kStale);
  EXPECT_EQ(*w.report().judged, w.now);
  EXPECT_EQ(w.report().state, HealthState::kOk);
}

TEST(PoseWatch, a_turn_on_the_spot_without_a_pose_stays_silent) {
  Watched w;
  w.follow({});
  for (int k = 0; k < 63; ++k) {  // a whole turn
    w.watch.on(Increment{w.now, w.now + at(0.1), {0.0, 0.0, 0.1}});
    w.here = w.here * Pose2{0.0, 0.0, 0.1};
    w.now += at(0.1);
  }
  EXPECT_EQ(w.report().reason, WatchReason::kSilent);
}

TEST(PoseWatch, takes_poses_without_a_covariance_and_with_headings_beyond_a_turn) {
  Watched w;
  w.follow({});
  PoseObservation z{w.now, w.here};
  z.pose.heading += 4.0 * kPi;
  EXPECT_EQ(w.watch.on(z, w.estimate(), w.health).dof, 0);
  EXPECT_EQ(w.report().state, HealthState::kOk);
  z.pose.x += 4.0;
  (void)w.watch.on(z, w.estimate(), w.health);
  EXPECT_EQ(w.report().state, HealthState::kLost);
  w = with_odometry_alone();
  z.stamp = w.now;
  z.pose = w.here * Pose2{4.0, 0.0, 0.0};
  (void)w.watch.on(z, w.estimate(), w.health);
  EXPECT_EQ(w.report().reason, WatchReason::kJumped);
}

TEST(PoseWatch, refuses_a_config_out_of_range) {
  PoseWatch::Config c;
  c.hold_s = -1.0;
  testing::expect_refused([&] { PoseWatch{c}; }, "hold_s");
  c = {};
  c.health.risk = 2.0;
  testing::expect_refused([&] { PoseWatch{c}; }, "risk");
}

RecoveringEkf::Config config(bool watches) {
  RecoveringEkf::Config c;
  c.start.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  c.start.estimator.range.sigma_m = 0.1;
  c.start.watch_poses = watches;
  return c;
}

RecoveringEkf robot(bool watches) {
  return {config(watches), {testing::hall(), testing::one_tag()}};
}

/// Messages of a robot that drives a circle, by ranges and odometry, with poses that jump by 4 m
/// from 10 s to 20 s and odometry in between.
std::vector<Message> messages(unsigned seed, bool with_poses) {
  Rng rng(seed);
  std::vector<Message> all;
  Pose2 here{0.0, -5.0, 0.0};
  for (Stamp now = 0; now < at(30.0); now += at(0.1)) {
    const Pose2 motion = arc(0.05, 0.0, 0.01);
    all.emplace_back(Increment{now, now + at(0.1), motion});
    here = here * motion;
    const Stamp then = now + at(0.1);
    for (Id anchor = 0; anchor < 4; ++anchor) {
      all.emplace_back(testing::range_to(anchor, here, then, normal(rng, 0.1)));
    }
    const bool jumps = then > at(10.0) && then < at(20.0);
    const PoseObservation z{then, here * Pose2{jumps ? 4.0 : 0.0, 0.0, 0.0},
                            covariance(0.05, 0.02)};
    if (with_poses && (then / at(0.1)) % 5 == 0) {
      all.emplace_back(z);
    }
  }
  return all;
}

TEST(RecoveringEkf, watches_poses_without_a_bit_of_harm) {
  RecoveringEkf with = robot(true);
  RecoveringEkf without = robot(false);
  EXPECT_FALSE(without.watched().has_value());
  EXPECT_EQ(with.watched()->reason, WatchReason::kNoEstimate);
  const PoseEstimate start{0, {0.0, -5.0, 0.0}, covariance(0.1, 0.05)};
  with.start_at(start);
  without.start_at(start);
  for (const Message& message : messages(1, false)) {
    without.on(message);
  }
  int lost = 0;
  for (const Message& message : messages(1, true)) {
    const Outcome outcome = with.on(message);
    if (const auto* z = std::get_if<PoseObservation>(&message)) {
      EXPECT_EQ(outcome.reason, Reason::kWatched);
      const bool jumps = z->stamp > at(10.0) && z->stamp < at(20.0);
      EXPECT_EQ(with.watched()->state, jumps ? HealthState::kLost : HealthState::kOk) << z->stamp;
      EXPECT_NEAR(with.watched()->error.head<2>().norm(), jumps ? 4.0 : 0.0, 0.3);
      lost += jumps ? 1 : 0;
    }
  }
  EXPECT_GT(lost, 15);
  EXPECT_TRUE(same_bits(with.belief(), without.belief()));
}

TEST(RecoveringEkf, does_not_start_by_poses_that_it_watches) {
  RecoveringEkf with = robot(true);
  RecoveringEkf without = robot(false);
  for (int k = 0; k < 5; ++k) {
    const PoseObservation z{at(0.1 * k), {3.0, 1.0, 0.0}, covariance(0.05, 0.02)};
    EXPECT_EQ(with.on(z).reason, Reason::kNotStarted);
    without.on(z);
  }
  EXPECT_TRUE(without.has_started());
  EXPECT_FALSE(with.has_started());
}

TEST(RecoveringEkf, refuses_or_leaves_out_bad_poses_that_it_watches) {
  RecoveringEkf ekf = robot(true);
  ekf.start_at({at(1.0), {}, covariance(0.1, 0.05)});
  PoseObservation z{at(2.0), {std::nan(""), 0.0, 0.0}, covariance(0.05, 0.02)};
  testing::expect_refused([&] { ekf.on(z); }, "finite");
  z.pose = {1e9, 0.0, 0.0};
  EXPECT_EQ(ekf.on(z).verdict, Verdict::kImplausible);
  z.pose = {};
  z.stamp = 0;
  EXPECT_EQ(ekf.on(z).verdict, Verdict::kStale);
  EXPECT_EQ(ekf.watched()->reason, WatchReason::kNoPose);
}

/// Poses that are far ahead of everything, or from long before: a wrong clock.
TEST(RecoveringEkf, is_not_moved_by_the_clock_of_poses_that_it_watches) {
  for (const double off : {-100.0, -3.0, 0.3, 4.0, 1000.0}) {
    for (const ClockJump jump : {ClockJump::kRefuse, ClockJump::kReset, ClockJump::kContinue}) {
      RecoveringEkf ekf = robot(true);
      ekf.start_at({0, {0.0, -5.0, 0.0}, covariance(0.1, 0.05)});
      Timeline<RecoveringEkf> with(ekf, at(2.0), {jump});
      Timeline<RecoveringEkf> without(ekf, at(2.0), {jump});
      int stale = 0;
      const auto sink = [&](std::size_t /*index*/, const Outcome& outcome) {
        stale += outcome.verdict == Verdict::kStale ? 1 : 0;
      };
      for (Message message : messages(5, true)) {
        if (auto* z = std::get_if<PoseObservation>(&message)) {
          z->stamp += at(off);
          with.on(message, sink);
        } else {
          with.on(message, sink);
          without.on(message, sink);
        }
      }
      EXPECT_EQ(with.jumps(), 0U);
      EXPECT_TRUE(same_bits(with.estimator().belief(), without.estimator().belief())) << off;
      EXPECT_EQ(stale > 0, off < 0.0);
      if (off == 0.3) {
        EXPECT_EQ(with.estimator().watched()->state, HealthState::kOk);
      }
    }
  }
}

TEST(RecoveringEkf, judges_a_late_pose_as_if_it_had_been_in_time) {
  const std::vector<Message> all = messages(3, true);
  const auto report_of = [&](Stamp late) {
    RecoveringEkf ekf = robot(true);
    ekf.start_at({0, {0.0, -5.0, 0.0}, covariance(0.1, 0.05)});
    Timeline<RecoveringEkf> timeline(ekf, at(2.0), {});
    std::vector<std::pair<Stamp, Message>> order;
    for (const Message& message : all) {
      const Stamp delay = std::holds_alternative<PoseObservation>(message) ? late : 0;
      order.emplace_back(stamp_of(message) + delay, message);
    }
    std::stable_sort(order.begin(), order.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    std::size_t index = 0;
    for (const auto& [arrival, message] : order) {
      const bool is_seen =
          stamp_of(message) <= at(14.0) || !std::holds_alternative<PoseObservation>(message);
      if (arrival <= at(15.0) && is_seen) {
        timeline.on(index++, message, [](std::size_t, const Outcome&) {});
      }
    }
    return *timeline.estimator().watched();
  };
  const WatchReport in_time = report_of(0);
  const WatchReport late = report_of(at(0.35));
  EXPECT_EQ(in_time.state, HealthState::kLost);
  EXPECT_EQ(late.state, HealthState::kLost);
  EXPECT_EQ(late.stamp, in_time.stamp);
  EXPECT_TRUE(same_bits(late.error, in_time.error));
  EXPECT_EQ(late.within, in_time.within);
}

}  // namespace
}  // namespace locfuse::test_pose_watch
