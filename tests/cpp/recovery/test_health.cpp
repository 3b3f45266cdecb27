// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "locfuse/recovery/health.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_health {
namespace {

using testing::expect_refused;
using testing::normal;
using testing::Rng;
using testing::uniform;

constexpr Stamp kStep = 100'000'000;
constexpr double kLimit = 10.8;  // of the gate
constexpr double kScale = 0.01;  // variance of an innovation
constexpr double kSpan = 20.0;

Outcome of_residual(double residual) {
  const double nis = residual * residual / kScale;
  return {
      nis > kLimit ? Verdict::kGated : Verdict::kFused, Reason::kNone, 1, nis, residual, kScale};
}

NamedSource anchor(Id name) { return {Source::kRanges, name}; }

struct Room {
  Health health{Health::Config{}};
  Stamp stamp = 0;
  Rng rng{1};

  /// One range of each anchor; those below `wrong` are off by `by`.
  void listen(int steps, int anchors, int wrong, double by) {
    for (int k = 0; k < steps; ++k) {
      stamp += kStep;
      for (int i = 0; i < anchors; ++i) {
        const double noise = normal(rng, std::sqrt(kScale));
        health.record(anchor(i), stamp, of_residual(i < wrong ? by + noise : noise), kLimit, kSpan);
      }
    }
  }

  [[nodiscard]] HealthReport report(double sigma = 0.05) const {
    return health.report({stamp, {}, sigma * sigma * Matrix<3, 3>::Identity()});
  }
};

TEST(Health, is_ok_while_all_agree) {
  Room room;
  room.health.start(0);
  room.listen(600, 4, 0, 0.0);
  const HealthReport report = room.report();
  EXPECT_EQ(report.state, HealthState::kOk);
  EXPECT_EQ(report.reason, HealthReason::kNone);
  EXPECT_LT(report.wrong, 1e-4);
  EXPECT_GT(report.within, 0.999);
}

TEST(Health, a_single_faulty_source_is_named_and_the_pose_trusted) {
  Room room;
  room.health.start(0);
  room.listen(100, 4, 0, 0.0);
  room.listen(600, 4, 1, 3.0);
  const HealthReport report = room.report();
  EXPECT_EQ(report.state, HealthState::kDegraded);
  EXPECT_EQ(report.reason, HealthReason::kSourceIsWrong);
  ASSERT_TRUE(report.source);
  EXPECT_EQ(report.source->name, 0);
  EXPECT_TRUE(room.health.is_excluded(anchor(0)));
  EXPECT_FALSE(room.health.is_excluded(anchor(1)));
  room.listen(100, 4, 0, 0.0);
  EXPECT_FALSE(room.health.is_excluded(anchor(0)));
  EXPECT_EQ(room.report().state, HealthState::kOk);
}

/// Each range reads 3 m long by itself, with a probability.
struct Reflections : Room {
  double share = 0.1;

  /// Ranges of four anchors at a pose that is off by `off` along each of them; those below `wrong`
  /// are off by 3 m. Returns the share of the steps in which one anchor was named.
  double listen_on(int steps, int wrong = 0, double off = 0.0) {
    int named = 0;
    for (int k = 0; k < steps; ++k) {
      stamp += kStep;
      for (int i = 0; i < 4; ++i) {
        const double by = uniform(rng, 0.0, 1.0) < share ? 3.0 : 0.0;
        const double residual = (i < wrong ? 3.0 : by) + (i % 2 == 0 ? off : -off);
        const double noise = normal(rng, std::sqrt(kScale));
        health.record(anchor(i), stamp, of_residual(residual + noise), kLimit, kSpan);
      }
      named += report().reason == HealthReason::kSourceIsWrong ? 1 : 0;
    }
    return static_cast<double>(named) / steps;
  }
};

TEST(Health, outliers_of_all_sources_are_no_fault_of_one) {
  for (const double share : {0.0, 0.05, 0.1}) {
    Reflections hall;
    hall.share = share;
    hall.health.start(0);
    hall.listen_on(600);
    EXPECT_LT(hall.listen_on(36'000), 0.01) << share;
    EXPECT_LT(hall.report().wrong, 1e-3) << share;
    EXPECT_EQ(hall.report().reason, HealthReason::kNone) << share;
  }
}

TEST(Health, more_outliers_are_noise_that_is_larger_than_its_sigma) {
  Reflections hall;
  hall.share = 0.25;
  hall.health.start(0);
  hall.listen_on(6'000);
  EXPECT_EQ(hall.report().state, HealthState::kDegraded);
  EXPECT_GT(hall.report().inflation, 1.5);
}

TEST(Health, a_faulty_source_is_named_among_outliers) {
  Reflections hall;
  hall.health.start(0);
  hall.listen_on(600);
  hall.listen_on(50, 1);
  EXPECT_GT(hall.listen_on(200, 1), 0.99);
  EXPECT_EQ(hall.report().source->name, 0);
  EXPECT_TRUE(hall.health.is_excluded(anchor(0)));
}

TEST(Health, a_wrong_pose_is_noticed_among_outliers) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Reflections hall;
    hall.rng.seed(seed);
    hall.health.start(0);
    hall.listen_on(600);
    hall.listen_on(20, 0, 2.0);
    EXPECT_TRUE(hall.health.is_lost()) << seed;
  }
}

TEST(Health, several_at_once_contradict_the_pose) {
  Room room;
  room.health.start(0);
  room.listen(100, 4, 0, 0.0);
  room.listen(3, 4, 4, -3.0);
  EXPECT_FALSE(room.health.is_lost());  // it must last
  EXPECT_EQ(room.report().reason, HealthReason::kMeasurements);
  EXPECT_LT(room.report().within, 0.1);
  EXPECT_TRUE(std::isinf(room.report().protection.x()));
  room.listen(5, 4, 4, -3.0);
  EXPECT_TRUE(room.health.is_lost());
  EXPECT_EQ(room.report().state, HealthState::kLost);
  room.listen(20, 4, 0, 0.0);
  EXPECT_FALSE(room.health.is_lost());
}

TEST(Health, short_ranges_of_all_are_worse_than_long_ones) {
  const auto odds_after = [](double by) {
    Room room;
    room.health.start(0);
    room.listen(100, 2, 0, 0.0);
    room.listen(2, 2, 2, by);
    return room.health.wrong() / (1.0 - room.health.wrong());
  };
  EXPECT_GT(odds_after(-3.0), 10.0 * odds_after(3.0));
}

TEST(Health, without_measurements_trust_runs_out) {
  Room room;
  room.health.start(0);
  room.listen(100, 4, 0, 0.0);
  double before = room.report().within;
  for (const double seconds : {1.0, 3.0, 30.0, 70.0}) {
    const Stamp later = room.stamp + static_cast<Stamp>(seconds * kNanosecondsPerSecond);
    const HealthReport report = room.health.report({later, {}, 0.0025 * Matrix<3, 3>::Identity()});
    EXPECT_LT(report.within, before);
    before = report.within;
    EXPECT_EQ(report.state, seconds < 2.0    ? HealthState::kOk
                            : seconds < 60.0 ? HealthState::kDeadReckoning
                                             : HealthState::kLost);
  }
}

/// Behaviour follows `is_lost`, users see the report: they must agree.
TEST(Health, silence_for_too_long_is_loss_until_sources_agree_again) {
  Room room;
  room.health.start(0);
  room.listen(100, 4, 0, 0.0);
  room.stamp += 61'000'000'000;
  room.health.advance(room.stamp);
  EXPECT_TRUE(room.health.is_lost());
  EXPECT_EQ(room.report().state, HealthState::kLost);
  EXPECT_EQ(room.report().reason, HealthReason::kSilence);
  EXPECT_GE(room.health.wrong(), 0.5);
  room.listen(100, 4, 3, 3.0);  // one that agrees, maybe since the filter has followed it
  EXPECT_TRUE(room.health.is_lost());
  room.listen(20, 4, 0, 0.0);
  EXPECT_FALSE(room.health.is_lost());
  EXPECT_EQ(room.report().state, HealthState::kOk);
}

TEST(Health, a_kind_of_source_that_falls_silent_is_reported) {
  Room room;
  room.health.start(0);
  for (int k = 0; k < 50; ++k) {
    room.listen(1, 3, 0, 0.0);
    room.health.record({Source::kPoses, NamedSource::kUnnamed}, room.stamp, of_residual(0.01),
                       kLimit, kSpan);
  }
  EXPECT_EQ(room.report().state, HealthState::kOk);
  room.listen(50, 3, 0, 0.0);
  EXPECT_EQ(room.report().state, HealthState::kDegraded);
  EXPECT_EQ(room.report().reason, HealthReason::kSourceIsSilent);
  EXPECT_EQ(room.report().source->kind, Source::kPoses);
}

TEST(Health, noise_larger_than_reported_widens_the_levels) {
  Room as_reported;
  Room larger;
  as_reported.health.start(0);
  larger.health.start(0);
  as_reported.listen(300, 4, 0, 0.0);
  for (int k = 0; k < 300; ++k) {
    larger.stamp += kStep;
    for (int i = 0; i < 4; ++i) {
      larger.health.record(anchor(i), larger.stamp,
                           of_residual(normal(larger.rng, 1.8 * std::sqrt(kScale))), kLimit, kSpan);
    }
  }
  EXPECT_NEAR(as_reported.report().inflation, 1.0, 0.5);
  EXPECT_GT(larger.report().inflation, 3.0);
  EXPECT_GT(larger.report().protection.x(), 1.5 * as_reported.report().protection.x());
}

/// Eq. (7) against a million draws.
TEST(Health, within_is_the_probability_of_an_ellipse_in_a_circle) {
  Health::Config config;
  config.limit_m = 0.7;
  Health health(config);
  health.start(0);
  Matrix<3, 3> P = Matrix<3, 3>::Identity();
  P.topLeftCorner<2, 2>() << 0.5, 0.3, 0.3, 0.25;
  const Matrix<2, 2> L = P.topLeftCorner<2, 2>().llt().matrixL();
  Rng rng(3);
  int inside = 0;
  constexpr int kDraws = 200'000;
  for (int k = 0; k < kDraws; ++k) {
    const Vector<2> e = L * Vector<2>{normal(rng, 1.0), normal(rng, 1.0)};
    inside += e.norm() < 0.7 ? 1 : 0;
  }
  EXPECT_NEAR(health.report({0, {}, P}).within, static_cast<double>(inside) / kDraws, 0.005);
}

/// Eq. (5) is Bayes' rule: with bits and measurements drawn from the model the odds are
/// calibrated.
TEST(Health, the_probability_of_being_wrong_is_calibrated) {
  Health::Config config;
  config.mean_s_between_losses = 20.0;
  Rng rng(5);
  double said = 0.0;
  double wrong = 0.0;
  constexpr int kRuns = 4000;
  constexpr double kSigma = 0.1;
  for (int run = 0; run < kRuns; ++run) {
    Health health(config);
    health.start(0);
    bool is_wrong = false;
    for (int k = 1; k <= 20; ++k) {
      is_wrong = is_wrong || uniform(rng, 0.0, 1.0) < 0.1 / config.mean_s_between_losses;
      for (Id i = 0; i < 3; ++i) {
        const double share = is_wrong ? config.chance_share : 1.0 - config.wrong_share;
        const double r = uniform(rng, 0.0, 1.0) < share ? normal(rng, kSigma)
                                                        : uniform(rng, -0.5 * kSpan, 0.5 * kSpan);
        const double nis = r * r / (kSigma * kSigma);
        health.record(anchor(i), k * kStep,
                      {nis > kLimit ? Verdict::kGated : Verdict::kFused, Reason::kNone, 1, nis, r,
                       kSigma * kSigma},
                      kLimit, kSpan);
      }
    }
    said += health.wrong();
    wrong += is_wrong ? 1.0 : 0.0;
  }
  EXPECT_NEAR(said / kRuns, wrong / kRuns, 0.015);
  EXPECT_GT(wrong / kRuns, 0.05);
}

TEST(Health, counts_the_outcomes_of_each_source) {
  Room room;
  room.health.start(0);
  room.listen(200, 3, 1, 5.0);
  ASSERT_EQ(room.health.sources().size(), 3U);
  const SourceStatus& bad = room.health.sources()[0];
  const SourceStatus& good = room.health.sources()[1];
  EXPECT_LT(bad.accepted, 0.01);
  EXPECT_FALSE(bad.fused.has_value());
  EXPECT_GT(bad.test_ratio, 1.0);
  EXPECT_GT(bad.faulty, 0.9);
  EXPECT_GT(good.accepted, 0.9);
  EXPECT_EQ(good.fused, room.stamp);
  EXPECT_NEAR(good.interval, 0.1, 1e-9);
  EXPECT_NEAR(good.sigma, 0.1, 1e-9);
  EXPECT_LT(good.test_ratio, 1.0);
  EXPECT_NEAR(good.nis, 1.0, 0.7);
}

TEST(Health, restarting_forgets_everything) {
  Room room;
  room.health.start(0);
  room.listen(100, 3, 3, -5.0);
  room.health.start(room.stamp);
  Health fresh{Health::Config{}};
  fresh.start(room.stamp);
  const PoseEstimate here{room.stamp, {}, Matrix<3, 3>::Identity()};
  EXPECT_EQ(room.health.report(here).within, fresh.report(here).within);
  EXPECT_EQ(room.health.report(here).protection, fresh.report(here).protection);
  EXPECT_TRUE(room.health.sources().empty());
}

/// A fuzzer's risk of 1e-17 ended the program: 1 minus a quarter of it rounds to 1, whose quantile
/// is infinite.
TEST(Health, levels_of_any_risk_are_finite_and_grow_as_it_shrinks) {
  double last = 0.0;
  for (const double risk : {0.1, 1e-2, 1e-3, 1e-9, 1e-17, 1e-100, 1e-300}) {
    Health::Config config;
    config.risk = risk;
    Health health(config);
    health.start(0, 0.0);
    const Vector<3> level = health.report({0, {}, Matrix<3, 3>::Identity()}).protection;
    ASSERT_TRUE(level.allFinite()) << risk;
    EXPECT_GT(level.x(), last) << risk;
    last = level.x();
  }
  Health::Config config;
  config.risk = 5e-324;  // half of it is 0
  EXPECT_NO_THROW(Health{config});
}

TEST(Health, bad_config_is_refused) {
  const auto with = [](double Health::Config::*field, double value) {
    Health::Config config;
    config.*field = value;
    return [config] { Health{config}; };
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused(with(&Health::Config::limit_m, 0.0), "limit_m is 0.0");
  expect_refused(with(&Health::Config::risk, nan), "risk is nan");
  expect_refused(with(&Health::Config::faulty_share, 1.0),
                 "faulty_share is 1, expected a number between 0 and 1");
  expect_refused(with(&Health::Config::exclude_above, 1.5), "exclude_above is 1.5");
  expect_refused(with(&Health::Config::probability_found, 0.9),
                 "probability_found <= probability_lost");
}

TEST(Health, a_measurement_without_information_leaves_the_report_finite) {
  Health health(Health::Config{});
  health.start(0, 0.0);
  for (int k = 1; k < 50; ++k) {
    health.record(anchor(0), k * kStep, {Verdict::kFused, Reason::kNone, 1, 9.0, 1e154, 1e307},
                  kLimit, kSpan);
  }
  const HealthReport report = health.report({50 * kStep, {}, 1e-6 * Matrix<3, 3>::Identity()});
  EXPECT_TRUE(std::isfinite(report.inflation));
  EXPECT_GE(report.within, 0.0);
  EXPECT_GE(report.protection.minCoeff(), 0.0);
}

TEST(Health, refuses_times_and_spans_that_leave_no_probability) {
  Health::Config config;
  config.mean_s_between_losses = 1e-310;
  expect_refused([&] { Health{config}; }, "mean_s_between_losses");
  config = {};
  config.wrong_span_m = 1e155;
  expect_refused([&] { Health{config}; }, "wrong_span_m");
  Health health(Health::Config{});
  expect_refused([&] { health.start(0, -1e-301); }, "wrong is");
  expect_refused([&] { health.start(std::numeric_limits<Stamp>::min(), 0.0); }, "stamp");
}

TEST(Health, a_refused_start_changes_nothing) {
  Room room;
  room.health.start(0);
  room.listen(20, 3, 0, 0.0);
  const HealthReport before = room.report();
  expect_refused([&] { room.health.start(std::numeric_limits<Stamp>::min()); }, "stamp");
  expect_refused([&] { room.health.start(1000 * kStep, 2.0); }, "wrong is 2");
  const HealthReport after = room.report();
  EXPECT_EQ(after.stamp, before.stamp);
  EXPECT_EQ(after.wrong, before.wrong);
  EXPECT_EQ(room.health.sources().size(), 3U);
  room.health.advance(room.stamp + 1);
}

TEST(Health, refuses_an_estimate_at_an_invalid_stamp) {
  Health health(Health::Config{});
  health.start(-1000);
  expect_refused(
      [&] {
        (void)health.report({std::numeric_limits<Stamp>::max(), {}, Matrix<3, 3>::Identity()});
      },
      "stamp");
}

/// No source published within the time for which sources are remembered: their agreement was 0 / 0.
TEST(Health, recovers_from_lost_by_a_late_message) {
  Health health(Health::Config{});
  health.start(0);
  Stamp stamp = 610 * kStep;
  health.advance(stamp);
  ASSERT_TRUE(health.is_lost());
  health.record(anchor(0), stamp - 110 * kStep, of_residual(0.03), kLimit, kSpan);
  EXPECT_LE(health.wrong(), 1.0);
  for (int k = 0; k < 100; ++k) {
    stamp += kStep;
    health.record(anchor(k % 4), stamp, of_residual(0.03), kLimit, kSpan);
  }
  EXPECT_FALSE(health.is_lost());
}

/// Rounding made it 1 + 2^-52: more than a limit of 1, so the source was excluded.
TEST(Health, no_probability_of_a_faulty_source_exceeds_one) {
  Rng rng(3);
  for (int run = 0; run < 20000; ++run) {
    Health::Config config;
    config.wrong_share = 1.1e-9;
    config.exclude_above = 1.0;
    config.faulty_share = uniform(rng, 1e-3, 0.999);
    Health health(config);
    health.start(0);
    for (int k = 0; k < 14; ++k) {
      const double residual = std::sqrt(kScale * uniform(rng, 60.0, 1060.0));
      health.record(anchor(0), 0, of_residual(residual), kLimit, kSpan);
      ASSERT_LE(health.sources()[0].faulty, 1.0) << run;
      ASSERT_FALSE(health.is_excluded(anchor(0))) << run;
    }
  }
}

/// With so small an outlier share a likelihood was divided by 0 or by a denormal number.
TEST(Health, refuses_a_share_that_leaves_no_likelihood) {
  Health::Config config;
  config.wrong_share = 5e-324;
  expect_refused([&] { Health{config}; }, "wrong_share is", "between 1e-09 and 1");
}

/// The likelihood of a measurement that fits to the bit was infinite.
TEST(Health, a_measurement_without_noise_leaves_valid_probabilities) {
  Health health(Health::Config{});
  health.start(0, 0.5);
  health.record({Source::kPoses, NamedSource::kUnnamed}, 0,
                {Verdict::kFused, Reason::kNone, 3, 0.0, 0.0, 1e-300}, kLimit, kSpan);
  EXPECT_GE(health.wrong(), 0.0);
  EXPECT_LE(health.wrong(), 1.0);
}

}  // namespace
}  // namespace locfuse::test_health
