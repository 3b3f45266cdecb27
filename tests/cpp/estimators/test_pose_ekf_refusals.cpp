// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/estimators/pose_ekf.hpp"
#include "support/expect.hpp"
#include "support/robot.hpp"

namespace locfuse::test_pose_ekf_refusals {
namespace {

using testing::ekf_at;
using testing::expect_refused;
using testing::kSecond;
using testing::range_to;
using testing::same_bits;

const Pose2 kStart{1.0, 2.0, 0.5};
const Matrix<2, 2> kI2 = Matrix<2, 2>::Identity();
const Matrix<3, 3> kI3 = Matrix<3, 3>::Identity();

/// In the middle of an increment, so that a message would move the belief before it is refused.
PoseEkf moving() {
  PoseEkf ekf = ekf_at(kStart);
  ekf.on(Increment{0, 2 * kSecond, {1.0, 0.1, 0.7}});
  ekf.advance_to(kSecond);
  return ekf;
}

/// `refuse(ekf)` leaves no trace, now or in what follows.
template <class Refuse>
void expect_no_trace(const Refuse& refuse) {
  PoseEkf ekf = moving();
  PoseEkf twin = moving();
  refuse(ekf);
  EXPECT_TRUE(same_bits(ekf.belief(), twin.belief()));
  EXPECT_EQ(ekf.estimate().stamp, twin.estimate().stamp);
  const Range next = range_to(0, kStart, 3 * kSecond, 0.1);
  EXPECT_EQ(ekf.on(next).verdict, twin.on(next).verdict);
  EXPECT_TRUE(same_bits(ekf.belief(), twin.belief()));
}

void expect_no_trace(const Message& message, Verdict verdict) {
  expect_no_trace([&](PoseEkf& ekf) { EXPECT_EQ(ekf.on(message).verdict, verdict); });
}

TEST(PoseEkf, refuses_times_whose_differences_would_overflow) {
  constexpr Stamp kLast = std::numeric_limits<Stamp>::max();
  expect_no_trace([](PoseEkf& ekf) {
    expect_refused([&] { ekf.advance_to(kLast); }, "stamp", std::to_string(kLast));
    expect_refused([&] { (void)ekf.estimate(kStampLimit); }, "stamp");
    expect_refused([&] { ekf.on(range_to(0, kStart, kLast)); }, "stamp");
  });
  EXPECT_NO_THROW((void)moving().estimate(kStampLimit - 1));
}

TEST(PoseEkf, messages_older_than_the_belief_are_stale) {
  const Stamp old = kSecond - 1;
  expect_no_trace(Velocity{old, 1.0, 0.0}, Verdict::kStale);
  expect_no_trace(Increment{old - 1, old, {1.0, 0.0, 0.0}}, Verdict::kStale);
  expect_no_trace(Increment{old, old, {1.0, 0.0, 0.0}}, Verdict::kStale);
  expect_no_trace(range_to(0, kStart, old), Verdict::kStale);
  expect_no_trace(PositionFix{old, {1.0, 2.0}, kI2}, Verdict::kStale);
  expect_no_trace(PoseObservation{old, kStart, kI3}, Verdict::kStale);
  expect_no_trace([&](PoseEkf& ekf) {
    EXPECT_EQ(ekf.on_joint({range_to(0, kStart, old)}).verdict, Verdict::kStale);
    EXPECT_EQ(ekf.fuse(old, {kI3.col(0), kI3, kI3}, Gate()).verdict, Verdict::kStale);
  });
}

TEST(PoseEkf, an_unknown_anchor_or_tag_is_not_modelled) {
  expect_no_trace(Range{2 * kSecond, 0, 99, 5.0, {}}, Verdict::kNotModelled);
  expect_no_trace(Range{2 * kSecond, 99, 0, 5.0, {}}, Verdict::kNotModelled);
  expect_no_trace(Range{kSecond, 0, -1, 5.0, {}}, Verdict::kNotModelled);
  expect_no_trace([](PoseEkf& ekf) {
    const Range unknown{2 * kSecond, 0, 99, 5.0, {}};
    EXPECT_EQ(ekf.on_joint({unknown, unknown}).verdict, Verdict::kNotModelled);
  });
}

TEST(PoseEkf, an_outcome_without_comparison_has_no_numbers) {
  PoseEkf ekf = moving();
  for (const Outcome& outcome :
       {ekf.on(range_to(0, kStart, 0)), ekf.on(Range{kSecond, 0, 99, 5.0, {}}),
        ekf.on(Velocity{kSecond, 1.0, 0.0}), ekf.on(Increment{kSecond, kSecond, {}})}) {
    EXPECT_EQ(outcome.dof, 0);
    EXPECT_TRUE(std::isnan(outcome.nis));
    EXPECT_TRUE(std::isnan(outcome.residual));
    EXPECT_TRUE(std::isnan(outcome.log_likelihood()));
  }
}

TEST(PoseEkf, what_is_too_unlikely_is_gated) {
  for (const Stamp stamp : {kSecond, kSecond + 7, 2 * kSecond, 5 * kSecond}) {
    expect_no_trace(range_to(0, kStart, stamp, 20.0), Verdict::kGated);
    expect_no_trace(PositionFix{stamp, {50.0, 50.0}, 0.01 * kI2}, Verdict::kGated);
    expect_no_trace(PoseObservation{stamp, {50.0, 2.0, 0.5}, 0.01 * kI3}, Verdict::kGated);
  }
}

TEST(PoseEkf, each_kind_of_message_has_its_own_gate) {
  PoseEkf::Config open;
  open.range.gate = 1.0;
  open.position.gate = 1.0;
  open.pose.gate = 1.0;
  const Range range = range_to(0, kStart, 0, 20.0);
  const PositionFix fix{0, {50.0, 50.0}, kI2};
  const PoseObservation pose{0, {50.0, 50.0, 0.0}, kI3};
  EXPECT_EQ(ekf_at(kStart, open).on(range).verdict, Verdict::kFused);
  EXPECT_EQ(ekf_at(kStart, open).on(fix).verdict, Verdict::kFused);
  EXPECT_EQ(ekf_at(kStart, open).on(pose).verdict, Verdict::kFused);
  PoseEkf::Config config = open;
  config.range.gate = 0.99;
  EXPECT_EQ(ekf_at(kStart, config).on(range).verdict, Verdict::kGated);
  EXPECT_EQ(ekf_at(kStart, config).on(fix).verdict, Verdict::kFused);
  config = open;
  config.position.gate = 0.99;
  EXPECT_EQ(ekf_at(kStart, config).on(fix).verdict, Verdict::kGated);
  EXPECT_EQ(ekf_at(kStart, config).on(pose).verdict, Verdict::kFused);
  config = open;
  config.pose.gate = 0.99;
  EXPECT_EQ(ekf_at(kStart, config).on(pose).verdict, Verdict::kGated);
  EXPECT_EQ(ekf_at(kStart, config).on(range).verdict, Verdict::kFused);
}

TEST(PoseEkf, messages_that_are_not_valid_are_refused) {
  const double nan = std::nan("");
  const auto refused = [](const Message& message, const char* text) {
    expect_no_trace([&](PoseEkf& ekf) { expect_refused([&] { ekf.on(message); }, text); });
  };
  refused(Velocity{2 * kSecond, nan, 0.0}, "forward");
  refused(Increment{2 * kSecond, 3 * kSecond, {0.0, nan, 0.0}}, "motion.y");
  refused(Increment{3 * kSecond, 2 * kSecond, {}}, "begins");
  refused(Range{2 * kSecond, 0, 0, -1.0, {}}, "Range.range");
  refused(PositionFix{2 * kSecond, {1.0, 2.0}, -2.0 * kI2}, "PositionFix.covariance");
  refused(PoseObservation{2 * kSecond, kStart, -2.0 * kI3}, "PoseObservation.covariance");
}

TEST(PoseEkf, epochs_that_are_none_are_refused) {
  expect_no_trace([](PoseEkf& ekf) {
    const Range good = range_to(0, kStart, 2 * kSecond);
    expect_refused([&] { ekf.on_joint(std::vector<Range>{}); }, "0 ranges");
    expect_refused(
        [&] {
          ekf.on_joint({good, range_to(1, kStart, 2 * kSecond + 1)});
        },
        "2000000001");
    expect_refused([&] { ekf.on_joint({good, Range{2 * kSecond, 0, 0, -3.5, {}}}); }, "-3.5");
    expect_refused([&] { ekf.on_joint(std::vector<Range>(33, good)); }, "33 ranges", "32");
  });
  EXPECT_EQ(moving().on_joint(std::vector<Range>(32, range_to(0, kStart, 2 * kSecond))).dof, 32);
}

TEST(PoseEkf, broken_numbers_leave_no_trace) {
  expect_no_trace([](PoseEkf& ekf) {
    EXPECT_THROW(ekf.fuse(2 * kSecond, {kI3.col(0), kI3, -9.0 * kI3}, Gate()), NumericalError);
    EXPECT_THROW(ekf.fuse(kSecond, {kI3.col(0), kI3, -9.0 * kI3}, Gate()), NumericalError);
    const double huge = std::numeric_limits<double>::max();
    EXPECT_EQ(ekf.on(Increment{2 * kSecond, 2 * kSecond, {huge, huge, 0.0}}).verdict,
              Verdict::kImplausible);
  });
}

TEST(PoseEkf, linearizations_of_the_wrong_shape_are_refused) {
  expect_no_trace([](PoseEkf& ekf) {
    using Lin = Linearization<Eigen::Dynamic, 3>;
    const Eigen::MatrixXd none(0, 3);
    const Lin empty{Eigen::VectorXd(0), none, Eigen::MatrixXd(0, 0)};
    const Lin uneven{Vector<2>(1.0, 2.0), kI3, kI3};
    expect_refused([&] { ekf.fuse(2 * kSecond, empty, Gate()); }, "residual of 0 rows");
    expect_refused([&] { ekf.fuse(2 * kSecond, uneven, Gate()); }, "residual of 2 rows");
  });
}

TEST(PoseEkf, advancing_to_an_earlier_stamp_changes_nothing) {
  expect_no_trace([](PoseEkf& ekf) { ekf.advance_to(kSecond / 2); });
}

TEST(PoseEkf, knows_no_past) {
  expect_refused([] { (void)moving().estimate(7); }, "7 ns", "1000000000 ns");
}

TEST(PoseEkf, refuses_a_config_out_of_range) {
  const auto refused = [](double PoseEkf::Config::*field, double value, const char* text) {
    PoseEkf::Config config;
    config.*field = value;
    expect_refused([&] { (void)ekf_at(kStart, config); }, text);
  };
  refused(&PoseEkf::Config::hold_s, 0.0, "hold_s");
  refused(&PoseEkf::Config::hold_s, -1.5, "-1.5");
  refused(&PoseEkf::Config::hold_s, std::nan(""), "nan");
  PoseEkf::Config gated;
  for (double* gate :
       {&gated.range.gate, &gated.position.gate, &gated.pose.gate, &gated.landmark.gate}) {
    for (const double wrong : {0.0, 1.5, -0.5}) {
      *gate = wrong;
      expect_refused([&] { (void)ekf_at(kStart, gated); }, "gate", std::to_string(wrong));
    }
    *gate = 1.0;
  }
  refused(&PoseEkf::Config::sigma_lost_xy_per_sqrt_s, 0.0, "sigma_lost_xy_per_sqrt_s");
  refused(&PoseEkf::Config::sigma_lost_heading_per_sqrt_s, -1.0, "sigma_lost_heading_per_sqrt_s");
}

TEST(PoseEkf, refuses_a_start_that_is_none) {
  const auto start = [](const Pose2& pose, const Matrix<3, 3>& covariance) {
    (void)PoseEkf({}, {testing::hall()}, {0, pose, covariance});
  };
  expect_refused([&] { start({std::nan(""), 0.0, 0.0}, kI3); }, "nan");
  expect_refused([&] { start(kStart, Matrix<3, 3>::Zero()); }, "positive definite");
  expect_refused([&] { start(kStart, -kI3); }, "-1");
}

}  // namespace
}  // namespace locfuse::test_pose_ekf_refusals
