// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "locfuse/error.hpp"
#include "locfuse/smoothing/smoother.hpp"
#include "smoothing/chain_covariance.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"
#include "support/simulation.hpp"

namespace locfuse::test_smoother {
namespace {

using testing::in_band;
using testing::kSecond;

const Matrix<3, 3> kI3 = Matrix<3, 3>::Identity();

/// Of simulated robots, whose errors are independent.
SmootherConfig well_informed() {
  SmootherConfig config;
  config.estimator.range.sigma_m = 0.1;
  config.estimator.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.estimator.correlation_s = 0.0;
  return config;
}

World hall() { return {testing::hall(), testing::one_tag()}; }

TEST(ChainInformation, its_blocks_are_those_of_the_dense_matrices) {
  testing::Rng rng(4);
  constexpr int kPoses = 7;
  constexpr int kShared = 2;
  constexpr int kSize = 3 * kPoses + kShared;
  const auto random = [&rng](int rows, int columns) {
    Eigen::MatrixXd numbers(rows, columns);
    for (int i = 0; i < rows * columns; ++i) {
      numbers(i % rows, i / rows) = testing::normal(rng, 1.0);
    }
    return numbers;
  };
  std::vector<double> seconds;
  for (int k = 0; k < kPoses; ++k) {
    seconds.push_back(k + 0.1 * k * k);
  }
  internal::ChainInformation chain(seconds, kShared);
  const double lasts[]{2.0, 0.5, 5.0};
  for (const double one : lasts) {
    (void)chain.add_process(one);
  }
  Eigen::MatrixXd known = Eigen::MatrixXd::Zero(kSize, kSize);  // as sure as it says
  std::vector<internal::MeasuredRow> rows;
  for (int k = 0; k < kPoses; ++k) {
    const auto pose = static_cast<std::size_t>(k);
    for (int of_pose = 0; of_pose < 4; ++of_pose) {
      internal::MeasuredRow row{pose, random(3, 1)};
      row.variance = 1.5;
      for (std::size_t i = 0; of_pose < 2 && i <= pose % 2; ++i) {  // one shared variable, or two
        row.shared[i] = i == 0 ? k % kShared : 1 - k % kShared;
        row.by_shared[i] = testing::normal(rng, 1.0);
      }
      row.lasting[0] = {of_pose % 2, 0.3 + 0.1 * k};
      row.lasting[1] = {of_pose < 3 ? 2 : -1, 0.4};
      rows.push_back(row);
      chain.add(row);
    }
    if (k + 1 < kPoses) {
      const Eigen::MatrixXd A = random(3, 6);  // of a pose and the next
      chain.add(pose, A.leftCols(3).transpose() * A.leftCols(3));
      chain.add(pose + 1, A.rightCols(3).transpose() * A.rightCols(3));
      chain.add_next(pose, A.leftCols(3).transpose() * A.rightCols(3));
      known.block<6, 6>(3 * k, 3 * k) += A.transpose() * A;
    }
  }
  const auto count = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(count, kSize);
  Eigen::MatrixXd C(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const internal::MeasuredRow& a = rows[static_cast<std::size_t>(i)];
    J.block<1, 3>(i, 3 * static_cast<Eigen::Index>(a.pose)) = a.by_pose.transpose();
    for (std::size_t j = 0; j < a.shared.size() && a.shared[j] >= 0; ++j) {
      J(i, 3 * kPoses + a.shared[j]) = a.by_shared[j];
    }
    for (Eigen::Index j = 0; j < count; ++j) {
      const internal::MeasuredRow& b = rows[static_cast<std::size_t>(j)];
      const double apart = std::abs(seconds[a.pose] - seconds[b.pose]);
      C(i, j) = 0.0;
      for (std::size_t n = 0; n < 2; ++n) {
        const auto& one = a.lasting[n];
        const auto& other = b.lasting[n];
        if (one.process >= 0 && one.process == other.process) {
          C(i, j) += one.loading * other.loading * std::exp(-apart / lasts[one.process]);
        }
      }
    }
    C(i, i) = a.variance;
  }
  const Eigen::MatrixXd inverse = (known + J.transpose() * J).inverse();
  const Eigen::MatrixXd expected = inverse * (known + J.transpose() * C * J) * inverse;
  const internal::ChainCovariance found = chain.covariance();
  for (int k = 0; k < kPoses; ++k) {
    EXPECT_TRUE(
        found.poses[static_cast<std::size_t>(k)].isApprox(expected.block<3, 3>(3 * k, 3 * k), 1e-9))
        << k;
  }
  EXPECT_TRUE(found.globals.isApprox(expected.bottomRightCorner<kShared, kShared>(), 1e-9));
}

TEST(ChainInformation, says_which_pose_is_not_determined) {
  internal::ChainInformation chain({0.0, 1.0}, 0);
  chain.add(0, kI3);
  EXPECT_THROW((void)chain.covariance(), NumericalError);
}

/// A pose between two fixes is where both and the motions between say: by hand.
TEST(Smoother, three_fixes_and_two_motions_are_a_linear_problem) {
  SmootherConfig config = well_informed();
  config.estimator.odometry = {};
  config.estimator.odometry.sigma_longitudinal_per_sqrt_m = 0.1;
  config.estimator.odometry.sigma_lateral_per_sqrt_m = 0.1;
  config.estimator.odometry.sigma_heading_per_sqrt_m = 1e-9;
  config.estimator.position.gate = 1.0;
  config.keyframe_s = 100.0;
  const Vector<3> sigma(1e3, 1e3, 1e-6);
  const PoseEstimate start{0, {}, sigma.cwiseAbs2().asDiagonal()};
  std::vector<Message> messages;
  const double x[3]{0.1, 0.9, 2.3};
  for (int k = 0; k < 3; ++k) {
    messages.emplace_back(PositionFix{k * kSecond, {x[k], 0.0}, 0.04 * Matrix<2, 2>::Identity()});
    if (k < 2) {
      messages.emplace_back(Increment{k * kSecond, (k + 1) * kSecond, {1.0, 0.0, 0.0}});
    }
  }
  const Smoothed found = smooth(config, {}, start, messages);
  ASSERT_EQ(found.poses.size(), 3U);
  EXPECT_TRUE(found.converged) << found.termination;
  // Information: fixes of 1 / 0.04, motions of 1 m with a variance of 0.01.
  Matrix<3, 3> H;
  H << 125.0, -100.0, 0.0, -100.0, 225.0, -100.0, 0.0, -100.0, 125.0;
  const Vector<3> b(25.0 * x[0] - 100.0, 25.0 * x[1], 25.0 * x[2] + 100.0);
  const Vector<3> expected = H.ldlt().solve(b);
  const Matrix<3, 3> P = H.inverse();
  for (int k = 0; k < 3; ++k) {
    const PoseEstimate& pose = found.poses[static_cast<std::size_t>(k)];
    EXPECT_EQ(pose.stamp, k * kSecond);
    EXPECT_NEAR(pose.pose.x, expected(k), 1e-5);
    EXPECT_NEAR(pose.covariance(0, 0), P(k, k), 1e-6);
  }
}

/// What a run of the simulation says, with the truth at its end.
Vector<3> error_at_end(const testing::Simulation& run, const PoseEstimate& end) {
  return local({run.x, run.y, wrap_angle(run.heading)}, end.pose);
}

TEST(Smoother, its_errors_are_as_large_as_it_says) {
  constexpr int kRuns = 100;
  double at_start = 0.0;
  double at_end = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const testing::Simulation run = testing::simulate(seed, 20.0);
    const Smoothed found = smooth(well_informed(), hall(), run.start, run.messages);
    ASSERT_TRUE(found.converged) << seed;
    const Vector<3> error = error_at_end(run, found.poses.back());
    at_end += error.dot(found.poses.back().covariance.inverse() * error) / kRuns;
    // The true start: the simulation begins with it, from seeds of its own.
    testing::Rng rng(seed);
    const Pose2 truth{2.0 + testing::normal(rng, 0.1), -1.0 + testing::normal(rng, 0.1),
                      0.4 + testing::normal(rng, 0.05)};
    const Vector<3> off = local(truth, found.poses.front().pose);
    at_start += off.dot(found.poses.front().covariance.inverse() * off) / kRuns;
    EXPECT_LT(found.poses.front().sigma_position(), 0.06);  // 0.1 by the start alone
  }
  EXPECT_TRUE(in_band(at_end, 3, kRuns)) << at_end;
  EXPECT_TRUE(in_band(at_start, 3, kRuns)) << at_start;
}

TEST(Smoother, at_the_end_it_knows_what_a_filter_knows) {
  const testing::Simulation run = testing::simulate(7, 20.0);
  PoseEkf ekf(well_informed().estimator, hall(), run.start);
  for (const Message& message : run.messages) {
    (void)ekf.on(message);
  }
  const PoseEstimate end = smooth(well_informed(), hall(), run.start, run.messages).poses.back();
  EXPECT_EQ(end.stamp, ekf.estimate().stamp);
  EXPECT_LT(local(end.pose, ekf.estimate().pose).head<2>().norm(), 0.02);
  EXPECT_NEAR(end.sigma_position() / ekf.estimate().sigma_position(), 1.0, 0.1);
}

TEST(Smoother, messages_in_any_order_give_the_same_bits) {
  const testing::Simulation run = testing::simulate(3, 5.0);
  const Smoothed in_order = smooth(well_informed(), hall(), run.start, run.messages);
  std::vector<Message> mixed = run.messages;
  std::reverse(mixed.begin(), mixed.end());
  std::stable_sort(mixed.begin(), mixed.end(), [](const Message& a, const Message& b) {
    return a.index() < b.index();  // equal stamps stay in one order a source
  });
  std::vector<Message> by_source = run.messages;
  std::stable_sort(by_source.begin(), by_source.end(),
                   [](const Message& a, const Message& b) { return a.index() > b.index(); });
  const Smoothed other = smooth(well_informed(), hall(), run.start, by_source);
  ASSERT_EQ(in_order.poses.size(), other.poses.size());
  for (std::size_t i = 0; i < other.poses.size(); ++i) {
    EXPECT_EQ(in_order.poses[i].pose.x, other.poses[i].pose.x);
    EXPECT_EQ(in_order.poses[i].covariance, other.poses[i].covariance);
  }
  EXPECT_EQ(smooth(well_informed(), hall(), run.start, mixed).poses.size(), other.poses.size());
}

TEST(Smoother, gross_errors_are_found_and_do_no_harm) {
  int missed = 0;
  int accused = 0;
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    testing::Simulation run = testing::simulate(seed, 20.0);
    testing::Rng rng(seed + 1000);
    std::vector<bool> wrong(run.messages.size(), false);
    for (std::size_t i = 0; i < run.messages.size(); ++i) {
      if (auto* z = std::get_if<Range>(&run.messages[i]);
          z && testing::uniform(rng, 0.0, 1.0) < 0.2) {
        z->range += testing::uniform(rng, 1.0, 6.0);
        wrong[i] = true;
      }
    }
    const Smoothed found = smooth(well_informed(), hall(), run.start, run.messages);
    for (std::size_t i = 0; i < wrong.size(); ++i) {
      missed += wrong[i] && found.outcomes[i].verdict != Verdict::kGated ? 1 : 0;
      accused += !wrong[i] && found.outcomes[i].verdict == Verdict::kGated ? 1 : 0;
    }
    worst = std::max(worst, error_at_end(run, found.poses.back()).head<2>().norm());
  }
  EXPECT_EQ(missed, 0);
  EXPECT_LT(accused, 20 * 400 * 0.8 * 0.003);  // the gate lets a thousandth of the good ones fall
  EXPECT_LT(worst, 0.3);
}

TEST(Smoother, offsets_of_anchors_are_learnt) {
  constexpr int kRuns = 40;
  double nees = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    testing::Simulation run = testing::simulate(seed, 20.0);
    testing::Rng rng(seed + 500);
    std::vector<double> offsets;
    for (int k = 0; k < 4; ++k) {
      offsets.push_back(testing::normal(rng, 0.5));
    }
    for (Message& message : run.messages) {
      if (auto* z = std::get_if<Range>(&message)) {
        z->range += offsets[static_cast<std::size_t>(z->anchor)];
      }
    }
    SmootherConfig config = well_informed();
    config.estimator.calibration.sigma_anchor_offset_m = 0.5;
    config.estimator.range.gate = 1.0;
    const Smoothed found = smooth(config, hall(), run.start, run.messages);
    ASSERT_EQ(found.errors.size(), 4U);
    for (std::size_t k = 0; k < 4; ++k) {
      const double off = found.errors[k].value - offsets[k];
      nees += off * off / (found.errors[k].sigma * found.errors[k].sigma) / (4 * kRuns);
      EXPECT_LT(found.errors[k].sigma, 0.1);
    }
  }
  EXPECT_GT(nees, 0.6);  // those of one run go together
  EXPECT_LT(nees, 1.5);
}

/// Half of the variance of ranges wanders over some seconds: counted as independent, the covariance
/// would be that of ten times as many ranges as there are.
TEST(Smoother, errors_that_last_are_not_counted_as_independent) {
  constexpr int kRuns = 40;
  double learnt = 0.0;
  double independent = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    testing::Simulation run = testing::simulate(seed, 60.0);
    testing::Rng rng(seed + 77);
    const double kept = std::exp(-0.2 / 3.0);
    double wander[4]{};
    for (double& one : wander) {
      one = testing::normal(rng, 0.2);
    }
    for (Message& message : run.messages) {
      if (auto* z = std::get_if<Range>(&message)) {
        double& one = wander[z->anchor];
        one = kept * one + std::sqrt(1.0 - kept * kept) * testing::normal(rng, 0.2);
        z->range += one;
      }
    }
    SmootherConfig config = well_informed();
    config.estimator.range.sigma_m = std::hypot(0.1, 0.2);
    const auto nees_of = [&](double correlation_s) {
      config.estimator.correlation_s = correlation_s;
      const PoseEstimate end = smooth(config, hall(), run.start, run.messages).poses.back();
      const Vector<3> error = error_at_end(run, end);
      return error.dot(end.covariance.inverse() * error);
    };
    learnt += nees_of(10.0) / kRuns;
    independent += nees_of(0.0) / kRuns;
  }
  EXPECT_GT(independent, 5.0);
  EXPECT_LT(learnt, 4.5);
  EXPECT_GT(learnt, 1.0);
}

TEST(Smoother, what_it_does_not_use_is_kept_in_its_place) {
  const PoseEstimate start{kSecond, {1.0, 2.0, 0.5}, 0.01 * kI3};
  RangeBearing nameless;
  nameless.stamp = 2 * kSecond;
  nameless.range = 2.0;
  nameless.bearing = 0.1;
  const std::vector<Message> messages{
      Range{0, 0, 0, 5.0, {}},             // before the start
      Altitude{2 * kSecond, 1.0, {}},      // no use in the plane
      nameless,                            // whose?
      Range{2 * kSecond, 0, 99, 5.0, {}},  // no such anchor
      PositionFix{2 * kSecond, {1.0, 2.0}, 0.01 * Matrix<2, 2>::Identity(), {}},
      PositionFix{2 * kSecond, {1e9, 2.0}, 0.01 * Matrix<2, 2>::Identity(), {}},
  };
  const Smoothed found = smooth({}, hall(), start, messages);
  std::vector<Verdict> verdicts;
  for (const Outcome& outcome : found.outcomes) {
    verdicts.push_back(outcome.verdict);
  }
  EXPECT_EQ(verdicts,
            (std::vector<Verdict>{Verdict::kStale, Verdict::kIgnored, Verdict::kIgnored,
                                  Verdict::kNotModelled, Verdict::kFused, Verdict::kImplausible}));
}

TEST(Smoother, refuses_what_it_cannot_do_in_a_sentence) {
  const PoseEstimate start{0, {}, 0.01 * kI3};
  const std::vector<Message> fix{PositionFix{0, {0.0, 0.0}, Matrix<2, 2>::Identity(), {}}};
  testing::expect_refused([&] { (void)smooth({}, {}, start, {}); }, "nothing to smooth");
  SmootherConfig config;
  config.keyframe_s = 0.0;
  testing::expect_refused([&] { (void)smooth(config, {}, start, fix); }, "keyframe_s");
  config = {};
  config.max_iterations = 0;
  testing::expect_refused([&] { (void)smooth(config, {}, start, fix); }, "max_iterations");
  config = {};
  config.estimator.calibration.sigma_scale = 0.1;
  testing::expect_refused([&] { (void)smooth(config, {}, start, fix); }, "sigma_anchor_offset_m");
  testing::expect_refused([&] { (void)smooth({}, {}, {0, {}, -kI3}, fix); }, "positive");
}

/// An hour of standing is no division by zero, and a gap no loss.
TEST(Smoother, a_robot_may_stand_and_odometry_may_end) {
  std::vector<Message> messages{Velocity{0, 0.0, 0.0}};
  for (int k = 0; k < 50; ++k) {
    messages.emplace_back(Velocity{k * kSecond, 0.0, 0.0});
    messages.emplace_back(
        PositionFix{k * kSecond, {0.1, 0.2}, 0.01 * Matrix<2, 2>::Identity(), {}});
  }
  messages.emplace_back(
      PositionFix{3600 * kSecond, {5.0, 0.2}, 0.01 * Matrix<2, 2>::Identity(), {}});
  const Smoothed found = smooth({}, {}, {0, {}, kI3}, messages);
  EXPECT_TRUE(found.converged) << found.termination;
  EXPECT_LT((found.poses.back().pose.position() - Vector<2>(5.0, 0.2)).norm(), 0.1);
  EXPECT_LT((found.poses.front().pose.position() - Vector<2>(0.1, 0.2)).norm(), 0.05);
}

}  // namespace
}  // namespace locfuse::test_smoother
