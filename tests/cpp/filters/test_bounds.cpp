// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "locfuse/filters/kalman.hpp"
#include "locfuse/filters/positive_definite.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_bounds {
namespace {

using testing::is_covariance;

GaussianBelief known_to(double sigma_xy, double sigma_heading) {
  const Vector<3> variances(sigma_xy * sigma_xy, sigma_xy * sigma_xy,
                            sigma_heading * sigma_heading);
  return GaussianBelief::of_pose(0, {1.0, 2.0, 0.3}, variances.asDiagonal());
}

Propagation<Pose2, 3> spread(double variance) {
  return {{1.0, 2.0, 0.3}, Matrix<3, 3>::Identity(), variance * Matrix<3, 3>::Identity()};
}

Linearization<3, 3> seen(double sigma) {
  return {Vector<3>::Zero(), Matrix<3, 3>::Identity(), sigma * sigma * Matrix<3, 3>::Identity()};
}

TEST(Bounds, of_a_belief_inside_them_are_not_felt) {
  GaussianBelief belief = known_to(0.1, 0.05);
  predict(belief, spread(0.01), belief.slot("body"));
  update(belief, seen(0.1), belief.slot("body"), Gate());
  EXPECT_EQ(belief.interventions, 0U);
}

TEST(Bounds, a_ceiling_scales_rows_so_that_correlations_stay) {
  GaussianBelief belief = known_to(100.0, 1.0);
  Propagation<Pose2, 3> step = spread(1e-6);
  step.jacobian(0, 2) = 90.0;  // far from the pivot: x hangs on the heading
  predict(belief, step, belief.slot("body"));
  const auto correlation = [&] {
    return belief.P(0, 2) / std::sqrt(belief.P(0, 0) * belief.P(2, 2));
  };
  const double before = correlation();
  ASSERT_GT(before, 0.5);
  ASSERT_EQ(belief.interventions, 0U);
  step = spread(0.0);
  step.noise = Vector<3>(1e-6, 1e-6, 1e-6).asDiagonal();
  step.jacobian = 1e3 * Matrix<3, 3>::Identity();
  predict(belief, step, belief.slot("body"));
  EXPECT_GT(belief.interventions, 0U);
  EXPECT_EQ(std::sqrt(belief.P(0, 0)), kPositionBounds.max);
  EXPECT_EQ(std::sqrt(belief.P(2, 2)), kHeadingBounds.max);
  EXPECT_NEAR(correlation(), before, 1e-9);
  EXPECT_TRUE(is_covariance(belief.P));
}

TEST(Bounds, a_floor_adds_noise_where_updates_left_none) {
  GaussianBelief belief = known_to(0.1, 0.05);
  for (int i = 0; i < 20; ++i) {
    update(belief, seen(1e-9), belief.slot("body"), Gate());
  }
  EXPECT_GE(std::sqrt(belief.P(0, 0)), kPositionBounds.min);
  EXPECT_GE(std::sqrt(belief.P(2, 2)), kHeadingBounds.min);
  EXPECT_GT(belief.interventions, 0U);
  EXPECT_TRUE(is_covariance(belief.P));
}

TEST(Bounds, hold_for_every_kind_of_variable_and_for_beliefs_too_large_for_fixed_sizes) {
  GaussianBelief belief = known_to(0.1, 0.05);
  const Slot body = belief.slot("body");
  std::vector<Slot> slots{body};
  for (int i = 0; i < 8; ++i) {
    slots.push_back(belief.add("landmark " + std::to_string(i), SlotKind::kPoint2,
                               Vector<2>::Zero(), Matrix<2, 2>::Identity()));
  }
  slots.push_back(belief.add("height", SlotKind::kScalar, Vector<1>(1.0), Matrix<1, 1>(1e-8)));
  const auto n = static_cast<Eigen::Index>(belief.dimension());
  const Eigen::MatrixXd noise = 2e-13 * belief.P.diagonal().asDiagonal().toDenseMatrix();
  update(belief,
         Linearization<Eigen::Dynamic, Eigen::Dynamic>{Eigen::VectorXd::Zero(n),
                                                       Eigen::MatrixXd::Identity(n, n), noise},
         slots, Gate());
  for (Eigen::Index row = 0; row < n; ++row) {
    const double least = row == 2       ? kHeadingBounds.min
                         : row == n - 1 ? kScalarBounds.min
                                        : kPositionBounds.min;
    EXPECT_NEAR(std::sqrt(belief.P(row, row)), least, 1e-3 * least) << row;
  }
  EXPECT_EQ(belief.interventions, static_cast<std::uint64_t>(n));
}

TEST(Bounds, noise_that_rounding_would_lose_is_kept) {
  GaussianBelief belief = known_to(1e4, 1.0);
  Linearization<1, 3> lin;
  lin.residual << 0.0;
  lin.jacobian << 1.0, 0.0, 0.0;
  lin.noise << 1e-4;  // 1 cm beside 10 km
  update(belief, lin, belief.slot("body"), Gate());
  EXPECT_NEAR(belief.P(0, 0), 1e-4, 1e-7);
  EXPECT_EQ(belief.interventions, 0U);
  lin.jacobian << 0.0, 1.0, 0.0;
  lin.noise << 1e-8;
  update(belief, lin, belief.slot("body"), Gate());
  EXPECT_NEAR(belief.P(1, 1), 1e-13 * 1e8, 1e-7);
  EXPECT_EQ(belief.interventions, 1U);
}

TEST(Bounds, noise_of_a_step_that_rounding_would_lose_is_kept) {
  GaussianBelief belief = known_to(0.1, 1.0);
  Propagation<Pose2, 3> step = spread(0.0);
  step.noise.diagonal() << 1e-12, 1e-12, 0.0;
  step.jacobian(0, 2) = 1e3;
  predict(belief, step, belief.slot("body"));
  EXPECT_EQ(belief.interventions, 1U);  // x alone hangs on the heading
  const double rest = belief.P(0, 0) - belief.P(0, 2) * belief.P(0, 2) / belief.P(2, 2);
  EXPECT_NEAR(rest, 0.01 + 1e-13 * 1e6, 1e-8);
}

double power(testing::Rng& rng, double low, double high) {
  return std::pow(10.0, testing::uniform(rng, low, high));
}
double signed_power(testing::Rng& rng, double low, double high) {
  return testing::uniform(rng, -1.0, 1.0) * power(rng, low, high);
}

/// A pose and `points`, each known to anything from a tenth of a millimetre to ten kilometres.
GaussianBelief with_points(testing::Rng& rng, int points) {
  GaussianBelief belief = known_to(power(rng, -3.0, 3.0), 0.3);
  for (int i = 0; i < points; ++i) {
    belief.add(std::to_string(i), SlotKind::kPoint2, Vector<2>::Zero(),
               power(rng, -8.0, 8.0) * Matrix<2, 2>::Identity());
  }
  return belief;
}

/// A step, or a measurement of M rows of the pose and of one of `points`, correlated at will.
template <int M>
void tell_anything(GaussianBelief& belief, testing::Rng& rng, int points) {
  const Slot body = belief.slot("body");
  if (testing::uniform(rng, 0.0, 1.0) < 0.3) {
    Propagation<Pose2, 3> step = spread(power(rng, -20.0, 9.0));
    step.jacobian(0, 2) = signed_power(rng, -3.0, 6.0);
    step.jacobian(1, 2) = signed_power(rng, -3.0, 6.0);
    predict(belief, step, body);
    return;
  }
  Linearization<M, 5> lin;
  for (int i = 0; i < M; ++i) {
    lin.residual(i) = signed_power(rng, -3.0, 6.0);
    for (int k = 0; k < 5; ++k) {
      lin.jacobian(i, k) = testing::uniform(rng, -1.0, 1.0);
    }
    lin.jacobian(i, 2) = signed_power(rng, -3.0, 4.0);
  }
  lin.noise = power(rng, -16.0, 6.0) * testing::random_covariance(rng, M);
  if (points == 0) {
    update(belief,
           Linearization<M, 3>{lin.residual, lin.jacobian.template leftCols<3>(), lin.noise}, body,
           Gate());
  } else {
    const auto point = std::to_string(static_cast<int>(testing::uniform(rng, 0.0, points)));
    update(belief, lin, std::vector<Slot>{body, belief.slot(point)}, Gate());
  }
}

/// Whether P less 2e-14 of its diagonal is positive definite: 90 times what a double rounds.
bool has_digits(const GaussianBelief& belief) {
  Eigen::MatrixXd less = belief.P;
  less.diagonal() *= 1.0 - 2e-14;
  return less.llt().info() == Eigen::Success;
}

// With more variables than a pose it was left to Joseph's form, which these numbers break.
TEST(Bounds, a_belief_of_any_size_is_sound_after_any_sequence_of_steps_and_measurements) {
  for (const int points : {0, 1, 5, 20}) {
    for (std::uint64_t seed = 1; seed <= 200; ++seed) {
      testing::Rng rng(seed);
      GaussianBelief belief = with_points(rng, points);
      for (int i = 0; i < 100; ++i) {
        try {
          i % 2 == 0 ? tell_anything<1>(belief, rng, points)
                     : tell_anything<2>(belief, rng, points);
        } catch (const NumericalError&) {  // refused whole
        }
        ASSERT_TRUE(belief.x.allFinite());
        ASSERT_TRUE(has_digits(belief)) << points << " points, seed " << seed << ", step " << i;
        ASSERT_TRUE(testing::same_bits(belief.P, belief.P.transpose()));
        for (Eigen::Index row = 0; row < belief.x.size(); ++row) {
          const SigmaBounds& bounds = belief.variance_bounds()[static_cast<std::size_t>(row)];
          ASSERT_GE(belief.P(row, row), bounds.min) << "seed " << seed << ", step " << i;
          ASSERT_LE(belief.P(row, row), bounds.max) << "seed " << seed;
        }
      }
    }
  }
}

/// How M numbers of a point are seen from a pose beside it, both known to no better than 10 km.
template <int M>
Linearization<M, 5> beside_each_other(double bearing, double heading, double noise) {
  const double c = std::cos(bearing);
  const double s = std::sin(bearing);
  Linearization<M, 5> lin;
  lin.residual.setZero();
  lin.jacobian.row(0) << -c, -s, heading, c, s;
  if constexpr (M == 2) {
    lin.jacobian.row(1) << s, -c, -1.0, -s, c;
  }
  lin.noise = noise * Matrix<M, M>::Identity();
  return lin;
}

template <int M>
void see_again_and_again(std::uint64_t seed, double turned, double arm) {
  testing::Rng rng(seed);
  GaussianBelief belief = known_to(1e4, 1.0);
  const Slot body = belief.slot("body");
  std::vector<Slot> points;
  for (int i = 0; i < 5; ++i) {
    points.push_back(belief.add(std::to_string(i), SlotKind::kPoint2, Vector<2>::Zero(),
                                1e8 * Matrix<2, 2>::Identity()));
  }
  for (int i = 0; i < 1000; ++i) {
    if (i % 5 == 0) {
      Propagation<Pose2, 3> step = spread(i % 2 == 0 ? 1e-9 : 0.0);
      step.jacobian.col(2).head<2>() << turned * testing::uniform(rng, -1.0, 1.0), 0.0;
      predict(belief, step, body);
    } else {
      const auto point = static_cast<std::size_t>(testing::uniform(rng, 0.0, 5.0));
      update(belief,
             beside_each_other<M>(turned * testing::uniform(rng, -3.0, 3.0),
                                  arm * testing::uniform(rng, -1.0, 1.0), power(rng, -10.0, -2.0)),
             std::vector<Slot>{body, points[point]}, Gate());
    }
    ASSERT_TRUE(has_digits(belief)) << "seed " << seed << ", step " << i;
  }
}

// Each leaves P fewer digits of how they err apart, until rounding has them all.
TEST(Bounds, what_is_seen_again_and_again_leaves_digits_of_what_is_known_of_it) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    see_again_and_again<1>(seed, 0.0, 0.0);
    see_again_and_again<2>(seed, 0.0, 0.0);
    see_again_and_again<1>(seed, 1.0, 0.1);
    see_again_and_again<2>(seed, 1.0, 0.1);
  }
}

TEST(Bounds, a_pose_is_positive_definite_if_its_eigenvalues_are) {
  testing::Rng rng(5);
  int definite = 0;
  for (int i = 0; i < 2000; ++i) {
    const Matrix<3, 3> A = testing::random_matrix(rng, 3, 3);
    Covariance P;
    P = (A + A.transpose() + testing::uniform(rng, -1.0, 3.0) * Matrix<3, 3>::Identity()).eval();
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(P).eigenvalues().minCoeff();
    if (std::abs(least) > 1e-9) {
      EXPECT_EQ(internal::is_pose_positive_definite(P), least > 0.0) << P;
      definite += least > 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(definite, 200);
  EXPECT_LT(definite, 1800);
}

TEST(Bounds, correlations_above_one_are_widened_no_more_than_they_need) {
  for (const double above : {1e-9, 1e-5, 1e-2}) {
    GaussianBelief belief = GaussianBelief::of_pose(0, {}, Matrix<3, 3>::Identity());
    belief.P(0, 1) = belief.P(1, 0) = 1.0 + above;
    internal::keep_in_bounds(belief, 0, 3, true);
    EXPECT_TRUE(internal::is_positive_definite(belief.P)) << above;
    EXPECT_GT(belief.P(0, 0), 1.0 + above);
    EXPECT_LT(belief.P(0, 0), 1.0 + 12.0 * above);
    EXPECT_EQ(belief.P(0, 1), 1.0 + above);
    EXPECT_EQ(belief.interventions, 1U);
  }
}

TEST(Bounds, few_digits_are_left_by_little_of_the_state_or_by_little_noise) {
  const Vector<2> reach(1.0, 1.0);
  const Matrix<2, 2> one = Matrix<2, 2>::Identity();
  const double little = 0.1 * internal::GuardTuning::kFewDigitsShare;
  EXPECT_FALSE(internal::leaves_few_digits(one, Matrix<2, 2>(2.0 * one), reach));
  const Matrix<2, 2> seen = Vector<2>(1.0 + little, 2.0).asDiagonal();
  EXPECT_TRUE(internal::leaves_few_digits(one, seen, reach));
  const Matrix<2, 2> noise = Vector<2>(little, 1.0).asDiagonal();
  EXPECT_TRUE(internal::leaves_few_digits(noise, Matrix<2, 2>(noise + one), reach));
}

}  // namespace
}  // namespace locfuse::test_bounds
