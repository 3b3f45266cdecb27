// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "locfuse/filters/kalman.hpp"
#include "support/expect.hpp"
#include "support/linear_kalman.hpp"
#include "support/random.hpp"

namespace locfuse::test_kalman {
namespace {

using Eigen::Dynamic;
using testing::expect_near;
using testing::expect_refused;
using testing::linear_kalman;
using testing::LinearKalman;
using testing::random_covariance;
using testing::random_matrix;
using testing::Rng;
using testing::uniform;

template <int M, int N>
Linearization<M, N> random_linearization(Rng& rng, Eigen::Index rows, Eigen::Index columns) {
  Linearization<M, N> lin;
  lin.residual = 0.3 * random_matrix(rng, rows, 1);
  lin.jacobian = random_matrix(rng, rows, columns);
  lin.noise = random_covariance(rng, rows);
  return lin;
}

GaussianBelief random_pose_belief(Rng& rng) {
  return GaussianBelief::of_pose(0, {uniform(rng, -1.0, 1.0), uniform(rng, -1.0, 1.0), 0.2},
                                 random_covariance(rng, 3));
}

/// Two points around the pose, all correlated.
GaussianBelief random_large_belief(Rng& rng) {
  GaussianBelief belief = random_pose_belief(rng);
  belief.add("a", SlotKind::kPoint2, Vector<2>(1.0, -1.0), Matrix<2, 2>::Identity());
  belief.add("b", SlotKind::kPoint2, Vector<2>(2.0, 3.0), Matrix<2, 2>::Identity());
  belief.P = random_covariance(rng, 7);
  return belief;
}

template <int M, int N>
void expect_textbook(GaussianBelief belief, const Linearization<M, N>& lin,
                     const std::vector<Slot>& slots) {
  const Eigen::MatrixXd H = testing::spread(lin.jacobian, belief.rows(slots), belief.dimension());
  const LinearKalman expected = linear_kalman(belief.x, belief.P, lin.residual, H, lin.noise);
  const Outcome outcome = update(belief, lin, slots, Gate());
  EXPECT_EQ(outcome.verdict, Verdict::kFused);
  EXPECT_EQ(outcome.dof, static_cast<int>(lin.residual.size()));
  EXPECT_EQ(outcome.residual, lin.residual(0));
  EXPECT_NEAR(outcome.nis, expected.nis, 1e-12);
  EXPECT_NEAR(outcome.log_likelihood(), expected.log_likelihood, 1e-12);
  expect_near(belief.x, expected.x, 1e-13);
  expect_near(belief.P, expected.P, 1e-13);
}

TEST(Update, equals_the_textbook_at_fixed_sizes) {
  Rng rng(1);
  for (int i = 0; i < 50; ++i) {
    const GaussianBelief belief = random_pose_belief(rng);
    const std::vector<Slot> body = {belief.slot("body")};
    expect_textbook(belief, random_linearization<1, 3>(rng, 1, 3), body);
    expect_textbook(belief, random_linearization<3, 3>(rng, 3, 3), body);
  }
}

TEST(Update, equals_the_textbook_at_run_time_sizes) {
  Rng rng(2);
  for (int i = 0; i < 50; ++i) {
    const GaussianBelief belief = random_pose_belief(rng);
    const std::vector<Slot> body = {belief.slot("body")};
    for (int rows = 1; rows <= 5; ++rows) {
      expect_textbook(belief, random_linearization<Dynamic, 3>(rng, rows, 3), body);
      expect_textbook(belief, random_linearization<Dynamic, Dynamic>(rng, rows, 3), body);
    }
  }
}

TEST(Update, equals_the_textbook_where_the_model_sees_some_variables_only) {
  Rng rng(3);
  for (int i = 0; i < 50; ++i) {
    const GaussianBelief belief = random_large_belief(rng);
    const Slot body = belief.slot("body");
    const Slot a = belief.slot("a");
    const Slot b = belief.slot("b");
    expect_textbook(belief, random_linearization<1, 3>(rng, 1, 3), {body});
    expect_textbook(belief, random_linearization<1, 7>(rng, 1, 7), {body, a, b});
    expect_textbook(belief, random_linearization<1, 7>(rng, 1, 7), {a, body, b});
    const auto expect_of = [&](int rows, int columns, const std::vector<Slot>& slots) {
      expect_textbook(belief, random_linearization<Dynamic, Dynamic>(rng, rows, columns), slots);
    };
    expect_of(2, 2, {b});
    expect_of(2, 5, {b, body});
    expect_of(1, 4, {b, a});
    expect_of(2, 7, {body, a, b});
    expect_of(2, 7, {a, body, b});
    expect_of(4, 5, {body, a});
  }
}

TEST(Update, of_a_pose_does_not_depend_on_strangers_in_the_belief) {
  Rng rng(4);
  GaussianBelief alone = random_pose_belief(rng);
  GaussianBelief together = alone;
  together.add("stranger", SlotKind::kPoint2, Vector<2>(1.0, 2.0), Matrix<2, 2>::Identity());
  const Slot body = alone.slot("body");
  for (int i = 0; i < 100; ++i) {
    const Linearization<1, 3> lin = random_linearization<1, 3>(rng, 1, 3);
    const Outcome first = update(alone, lin, body, Gate());
    const Outcome second = update(together, lin, body, Gate());
    EXPECT_NEAR(first.nis, second.nis, 1e-12);
  }
  expect_near(together.mean(body), alone.x, 1e-13);
  expect_near(together.marginal(body), alone.P, 1e-14);
  EXPECT_EQ(together.mean(together.slot("stranger")), Eigen::VectorXd(Vector<2>(1.0, 2.0)));
  EXPECT_EQ(together.P.bottomRightCorner(2, 2), Eigen::MatrixXd(Matrix<2, 2>::Identity()));
}

/// A linear measurement z = H x + noise; its residual depends on the belief it meets.
struct LinearMeasurement {
  Eigen::VectorXd z;
  Eigen::MatrixXd H;
  Eigen::MatrixXd R;

  [[nodiscard]] Linearization<Dynamic, 3> at(const GaussianBelief& belief) const {
    return {z - H * belief.x, H, R};
  }
};

TEST(Update, does_not_depend_on_the_order_of_independent_measurements) {
  Rng rng(5);
  GaussianBelief forth = random_pose_belief(rng);
  GaussianBelief back = forth;
  std::vector<LinearMeasurement> all;
  for (int i = 0; i < 20; ++i) {
    all.push_back(
        {0.3 * random_matrix(rng, 2, 1), random_matrix(rng, 2, 3), random_covariance(rng, 2)});
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    update(forth, all[i].at(forth), forth.slot("body"), Gate());
    const LinearMeasurement& last = all[all.size() - 1 - i];
    update(back, last.at(back), back.slot("body"), Gate());
  }
  expect_near(forth.x, back.x, 1e-12);
  expect_near(forth.P, back.P, 1e-13);
}

TEST(Update, of_measurements_jointly_equals_one_after_the_other) {
  Rng rng(6);
  GaussianBelief joint = random_pose_belief(rng);
  GaussianBelief single = joint;
  const LinearMeasurement all{0.3 * random_matrix(rng, 6, 1), random_matrix(rng, 6, 3),
                              Eigen::MatrixXd(0.2 * Eigen::MatrixXd::Identity(6, 6))};
  const Outcome at_once = update(joint, all.at(joint), joint.slot("body"), Gate());
  double nis = 0.0;
  double log_likelihood = 0.0;
  for (int i = 0; i < 6; ++i) {
    const LinearMeasurement one{all.z.row(i), all.H.row(i), all.R.block(i, i, 1, 1)};
    const Outcome outcome = update(single, one.at(single), single.slot("body"), Gate());
    nis += outcome.nis;
    log_likelihood += outcome.log_likelihood();
  }
  expect_near(single.x, joint.x, 1e-13);
  expect_near(single.P, joint.P, 1e-14);
  EXPECT_NEAR(nis, at_once.nis, 1e-12);
  EXPECT_NEAR(log_likelihood, at_once.log_likelihood(), 1e-12);
}

TEST(Update, wraps_the_heading) {
  GaussianBelief belief =
      GaussianBelief::of_pose(0, {0.0, 0.0, kPi - 0.05}, Matrix<3, 3>::Identity());
  Linearization<1, 3> lin;
  lin.residual << 0.2;
  lin.jacobian << 0.0, 0.0, 1.0;
  lin.noise << 1.0;
  update(belief, lin, belief.slot("body"), Gate());
  EXPECT_NEAR(belief.x(2), -kPi + 0.05, 1e-14);
}

TEST(Update, refuses_slots_that_do_not_match_the_jacobian) {
  Rng rng(7);
  GaussianBelief belief = random_large_belief(rng);
  const Slot a = belief.slot("a");
  const Linearization<1, 3> lin = random_linearization<1, 3>(rng, 1, 3);
  expect_refused([&] { update(belief, lin, a, Gate()); }, "3 columns", "2 variables");
  const std::vector<Slot> both = {belief.slot("body"), a};
  expect_refused([&] { update(belief, lin, both, Gate()); }, "3 columns", "5 variables");
  belief.remove(a);
  expect_refused([&] { update(belief, lin, a, Gate()); }, "slot 1");
}

TEST(Predict, equals_the_textbook_with_all_cross_covariances) {
  Rng rng(8);
  for (int i = 0; i < 50; ++i) {
    GaussianBelief belief = random_large_belief(rng);
    if (i % 2 == 0) {  // the pose last instead of first
      belief.remove(belief.slot("body"));
      belief.add("body", SlotKind::kPose2, Vector<3>(0.0, 0.0, 0.0), Matrix<3, 3>::Identity());
      belief.P = random_covariance(rng, 7);
    }
    const Slot body = belief.slot("body");
    const int row = belief.offset(body);
    const Propagation<Pose2, 3> step{
        {1.0, 2.0, -1.5}, random_matrix(rng, 3, 3), random_covariance(rng, 3)};
    Eigen::MatrixXd F = Eigen::MatrixXd::Identity(7, 7);
    F.block(row, row, 3, 3) = step.jacobian;
    Eigen::MatrixXd expected = F * belief.P * F.transpose();
    expected.block(row, row, 3, 3) += step.noise;
    Eigen::VectorXd x = belief.x;
    x.segment(row, 3) << 1.0, 2.0, -1.5;

    predict(belief, step, body);
    expect_near(belief.P, expected, 1e-14);
    EXPECT_TRUE(testing::same_bits(belief.P, belief.P.transpose()));
    EXPECT_EQ(belief.x, x);
  }
}

TEST(TurnWithMean, is_the_congruence_that_turns_the_world_about_its_origin) {
  Rng rng(12);
  for (int i = 0; i < 50; ++i) {
    GaussianBelief belief = random_large_belief(rng);
    const Slot body = belief.slot("body");
    const int row = belief.offset(body);
    const Vector<2> shift{testing::normal(rng, 1.0), testing::normal(rng, 1.0)};
    Eigen::MatrixXd M = Eigen::MatrixXd::Identity(7, 7);
    M.block(row, row + 2, 2, 1) << -shift.y(), shift.x();
    const Eigen::MatrixXd expected = M * belief.P * M.transpose();
    const Eigen::VectorXd x = belief.x;

    turn_with_mean(belief, body, belief.pose(body).position() - shift);
    expect_near(belief.P, expected, 1e-13);
    EXPECT_TRUE(testing::same_bits(belief.P, belief.P.transpose()));
    EXPECT_EQ(belief.x, x);
  }
}

TEST(TurnWithMean, of_a_mean_that_stood_still_changes_no_bit) {
  Rng rng(13);
  GaussianBelief belief = random_large_belief(rng);
  const Eigen::MatrixXd P = belief.P;
  turn_with_mean(belief, belief.slot("body"), belief.pose(belief.slot("body")).position());
  EXPECT_TRUE(testing::same_bits(belief.P, P));
}

/// A motion of the pose and `moving - 3` numbers of "a" and "b", which depends on all slots.
void expect_textbook_motion(GaussianBelief belief, Rng& rng, Eigen::Index moving,
                            const std::vector<Slot>& slots) {
  const std::vector<int> rows = belief.rows(slots);
  const auto columns = static_cast<Eigen::Index>(rows.size());
  Propagation<Eigen::VectorXd, Dynamic> step{0.5 * random_matrix(rng, moving, 1),
                                             random_matrix(rng, moving, columns),
                                             random_covariance(rng, moving)};
  Eigen::MatrixXd F = Eigen::MatrixXd::Identity(7, 7);
  Eigen::MatrixXd Q = Eigen::MatrixXd::Zero(7, 7);
  Eigen::VectorXd x = belief.x;
  for (Eigen::Index i = 0; i < moving; ++i) {
    const int row = rows[static_cast<std::size_t>(i)];
    F(row, row) = 0.0;
    x(row) = step.moved(i);
    for (Eigen::Index k = 0; k < columns; ++k) {
      F(row, rows[static_cast<std::size_t>(k)]) = step.jacobian(i, k);
    }
    for (Eigen::Index j = 0; j < moving; ++j) {
      Q(row, rows[static_cast<std::size_t>(j)]) = step.noise(i, j);
    }
  }
  const Eigen::MatrixXd expected = F * belief.P * F.transpose() + Q;
  predict(belief, step, slots);
  expect_near(belief.P, expected, 1e-13);
  EXPECT_TRUE(testing::same_bits(belief.P, belief.P.transpose()));
  EXPECT_EQ(belief.x, x);
}

TEST(Predict, of_several_variables_that_depend_on_others_equals_the_textbook) {
  Rng rng(10);
  for (int i = 0; i < 50; ++i) {
    const GaussianBelief belief = random_large_belief(rng);
    const Slot body = belief.slot("body");
    const Slot a = belief.slot("a");
    const Slot b = belief.slot("b");
    expect_textbook_motion(belief, rng, 3, {body, b});
    expect_textbook_motion(belief, rng, 5, {body, b});
    expect_textbook_motion(belief, rng, 2, {a, body});
    expect_textbook_motion(belief, rng, 7, {b, body, a});
  }
}

TEST(Predict, at_fixed_sizes_equals_that_of_several_variables) {
  Rng rng(12);
  for (int i = 0; i < 50; ++i) {
    GaussianBelief fixed;
    const std::vector<Slot> slots = {
        fixed.add("a", SlotKind::kPoint2, Vector<2>(1.0, 2.0), Matrix<2, 2>::Identity()),
        fixed.add("body", SlotKind::kPose2, Vector<3>(1.0, 2.0, 3.1), Matrix<3, 3>::Identity())};
    fixed.P = random_covariance(rng, 5);
    const bool is_compact = i % 2 == 0;
    if (is_compact) {
      fixed = GaussianBelief(fixed);
    }
    GaussianBelief dynamic = fixed;
    const Matrix<5, 5> F = random_matrix(rng, 5, 5);
    const Matrix<5, 5> Q = random_covariance(rng, 5);
    const Vector<5> moved = Vector<5>::Constant(3.5);
    predict(fixed, Propagation<Vector<5>, 5>{moved, F, Q}, slots);
    predict(dynamic, Propagation<Eigen::VectorXd, Dynamic>{moved, F, Q}, slots);
    expect_near(fixed.P, dynamic.P, 1e-13);
    EXPECT_TRUE(testing::same_bits(fixed.P, fixed.P.transpose()));
    EXPECT_EQ(fixed.x, dynamic.x);
    EXPECT_NEAR(fixed.x(4), 3.5 - 2.0 * kPi, 1e-15);
  }
  // Slots in another order than the belief's are not its whole state as it lies in memory.
  GaussianBelief fixed = random_pose_belief(rng);
  fixed.add("a", SlotKind::kPoint2, Vector<2>(1.0, 2.0), Matrix<2, 2>::Identity());
  fixed.P = random_covariance(rng, 5);
  GaussianBelief dynamic = fixed;
  const std::vector<Slot> swapped = {fixed.slot("a"), fixed.slot("body")};
  const Matrix<5, 5> F = random_matrix(rng, 5, 5);
  const Vector<5> moved(1.0, 2.0, 3.0, 4.0, 0.5);
  const Matrix<5, 5> Q = random_covariance(rng, 5);
  predict(fixed, Propagation<Vector<5>, 5>{moved, F, Q}, swapped);
  predict(dynamic, Propagation<Eigen::VectorXd, Dynamic>{moved, F, Q}, swapped);
  EXPECT_EQ(fixed.x, dynamic.x);
  EXPECT_EQ(fixed.x, (Vector<5>(3.0, 4.0, 0.5, 1.0, 2.0)));
  expect_near(fixed.P, dynamic.P, 1e-13);

  GaussianBelief belief = random_pose_belief(rng);
  const GaussianBelief before = belief;
  const Slot body = belief.slot("body");
  Propagation<Vector<3>, 3> step{Vector<3>::Zero(), Matrix<3, 3>::Identity(), -2.0 * belief.P};
  EXPECT_THROW(predict(belief, step, body), NumericalError);
  step.noise.setConstant(std::nan(""));
  EXPECT_THROW(predict(belief, step, body), NumericalError);
  EXPECT_TRUE(testing::same_bits(belief, before));
}

TEST(Predict, of_several_variables_refuses_sizes_that_do_not_match) {
  Rng rng(11);
  GaussianBelief belief = random_large_belief(rng);
  const std::vector<Slot> slots{belief.slot("body"), belief.slot("a")};
  const auto refused = [&](Eigen::Index moving, Eigen::Index rows, Eigen::Index columns) {
    expect_refused(
        [&] {
          predict(belief,
                  {Eigen::VectorXd::Zero(moving), Eigen::MatrixXd::Zero(rows, columns),
                   Eigen::MatrixXd::Identity(rows, rows)},
                  slots);
        },
        "out of 5 variables", "Jacobian");
  };
  refused(3, 3, 4);
  refused(3, 2, 5);
  refused(6, 6, 5);
}

TEST(Predict, keeps_headings_wrapped) {
  GaussianBelief belief = GaussianBelief::of_pose(0, {}, Matrix<3, 3>::Identity());
  const Matrix<3, 3> I = Matrix<3, 3>::Identity();
  predict(belief, {{0.0, 0.0, kPi + 0.5}, I, I}, belief.slot("body"));
  EXPECT_NEAR(belief.x(2), -kPi + 0.5, 1e-14);
}

TEST(Predict, refuses_to_move_a_point) {
  Rng rng(9);
  GaussianBelief belief = random_large_belief(rng);
  const Matrix<3, 3> I = Matrix<3, 3>::Identity();
  expect_refused([&] { predict(belief, {{}, I, I}, belief.slot("a")); }, "'a'", "not a pose");
}

TEST(Kalman, refuses_a_motion_and_a_measurement_of_nothing) {
  GaussianBelief belief = GaussianBelief::of_pose(0, {}, Matrix<3, 3>::Identity());
  const Propagation<Eigen::VectorXd, Eigen::Dynamic> nothing;
  testing::expect_refused([&] { predict(belief, nothing, std::vector<Slot>{}); }, "a motion of 0");
  const Linearization<Eigen::Dynamic, Eigen::Dynamic> seen{Vector<1>(0.0), Eigen::MatrixXd(1, 0),
                                                           Matrix<1, 1>(1.0)};
  testing::expect_refused([&] { (void)update(belief, seen, std::vector<Slot>{}, Gate()); },
                          "at least 1");
}

}  // namespace
}  // namespace locfuse::test_kalman
