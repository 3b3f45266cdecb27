// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <cmath>

#include "locfuse/filters/robust.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_robust {
namespace {

using testing::expect_refused;
using testing::same_bits;

const NoiseShape& one_sided() {
  static const NoiseShape shape({NoiseKind::kOneSided});
  return shape;
}
const NoiseShape& student_t() {
  static const NoiseShape shape({NoiseKind::kStudentT});
  return shape;
}
const NoiseShape& cauchy() {
  static const NoiseShape shape({NoiseKind::kCauchy});
  return shape;
}

/// Five variables, the body first.
GaussianBelief some_belief(testing::Rng& rng) {
  GaussianBelief belief =
      GaussianBelief::of_pose(0, {1.0, 2.0, 0.5}, testing::random_covariance(rng, 3));
  belief.add("lamp", SlotKind::kPoint2, Vector<2>(3.0, 4.0), testing::random_covariance(rng, 2));
  return belief;
}

GaussianBelief scalar_belief(double variance) {
  GaussianBelief belief;
  belief.add("level", SlotKind::kScalar, Vector<1>(0.0), Matrix<1, 1>(variance));
  return belief;
}

Linearization<1, 1> level_of(double z, double variance) {
  return {Vector<1>(z), Matrix<1, 1>(1.0), Matrix<1, 1>(variance)};
}

/// Density of the shape's noise with R = 1.
double density(const NoiseShape& shape, double v) {
  double all = 0.0;
  double sum = 0.0;
  for (const NoiseShape::Part& part : shape) {
    const double share = std::exp(part.log_share);
    all += share;
    sum += share * std::exp(-0.5 * std::pow(v - part.mean, 2) / part.variance) /
           std::sqrt(2.0 * kPi * part.variance);
  }
  return sum / all;
}

TEST(Robust, gives_mean_and_variance_of_what_bayes_leaves) {
  for (const NoiseShape* shape : {&student_t(), &cauchy(), &one_sided()}) {
    for (const double prior : {0.01, 1.0, 30.0}) {
      for (const double z : {0.3, 1.5, 3.0, 5.0, 12.0}) {
        GaussianBelief belief = scalar_belief(prior);
        update(belief, level_of(z, 0.25), belief.slot("level"), Gate(), *shape);

        double sum = 0.0;
        double mean = 0.0;
        double square = 0.0;
        const double sigma = std::sqrt(prior);
        for (double h = -10.0 * sigma; h <= 10.0 * sigma; h += sigma / 2000.0) {
          const double p = std::exp(-0.5 * h * h / prior) * density(*shape, (z - h) / 0.5);
          sum += p;
          mean += p * h;
          square += p * h * h;
        }
        mean /= sum;
        EXPECT_NEAR(belief.x(0), mean, 1e-6 * sigma) << prior << " " << z;
        EXPECT_NEAR(belief.P(0, 0) / prior, (square / sum - mean * mean) / prior, 1e-6)
            << prior << " " << z;
      }
    }
  }
}

TEST(Robust, tails_are_those_of_student) {
  // Their scale is what makes clean noise consistent, so densities are compared in its unit.
  for (const double dof : {1.0, 4.0, 20.0}) {
    const NoiseShape shape({NoiseKind::kStudentT, dof});
    const double middle = density(shape, 0.0);
    const double half = 0.5 * (dof + 1.0);
    const double at_zero =
        std::exp(std::lgamma(half) - std::lgamma(0.5 * dof)) / std::sqrt(dof * kPi);
    const double scale = at_zero / middle;
    for (const double t : {0.5, 1.0, 2.0, 4.0, 8.0}) {
      const double expected = middle * std::pow(1.0 + t * t / dof, -half);
      EXPECT_NEAR(density(shape, t * scale) / expected, 1.0, 0.1) << dof << " " << t;
    }
  }
}

/// At its scale clean noise leaves a filter as sure as it says: eq. (2.7) of
/// docs/models/updates.md.
TEST(Robust, is_as_wide_as_clean_noise_allows) {
  for (const NoiseKind kind : {NoiseKind::kStudentT, NoiseKind::kCauchy}) {
    const NoiseShape shape({kind, 4.0, 0.05});
    double squares = 0.0;
    double slopes = 0.0;
    for (int i = -4000; i <= 4000; ++i) {
      const double r = i / 500.0;
      double total = 0.0;
      double score = 0.0;
      double curvature = 0.0;
      for (const NoiseShape::Part& part : shape) {
        const double share =
            std::exp(part.log_share - 0.5 * r * r / part.variance) / std::sqrt(part.variance);
        total += share;
        score += share * r / part.variance;
        curvature += share * (1.0 / part.variance - r * r / (part.variance * part.variance));
      }
      score /= total;
      const double of_clean = std::exp(-0.5 * r * r);
      squares += of_clean * score * score;
      slopes += of_clean * (curvature / total + score * score);
    }
    EXPECT_NEAR(squares / slopes, 1.0, 1e-3);
  }
}

TEST(Robust, shares_of_one_sided_noise_are_all_there_is) {
  double all = 0.0;
  double late = 0.0;
  for (const NoiseShape::Part& part : NoiseShape({NoiseKind::kOneSided, 4.0, 0.1})) {
    all += std::exp(part.log_share);
    late += part.mean > 0.0 ? std::exp(part.log_share) : 0.0;
  }
  EXPECT_NEAR(all, 1.0, 1e-12);
  EXPECT_NEAR(late, 0.1, 1e-12);
}

TEST(Robust, gaussian_noise_is_the_plain_update_bit_for_bit) {
  testing::Rng rng(1);
  GaussianBelief plain = some_belief(rng);
  GaussianBelief robust = plain;
  const Linearization<1, 3> lin{Vector<1>(2.0), Matrix<1, 3>(0.3, 0.4, 0.5), Matrix<1, 1>(0.1)};
  const Outcome a = update(plain, lin, plain.slot("body"), Gate());
  const Outcome b = update(robust, lin, robust.slot("body"), Gate(), NoiseShape());
  EXPECT_TRUE(same_bits(plain, robust));
  EXPECT_EQ(a.nis, b.nis);
}

TEST(Robust, one_sided_noise_takes_what_is_too_short_as_it_is) {
  testing::Rng rng(2);
  GaussianBelief plain = some_belief(rng);
  GaussianBelief robust = plain;
  const Linearization<1, 3> lin{Vector<1>(-9.0), Matrix<1, 3>(0.3, 0.4, 0.5), Matrix<1, 1>(0.1)};
  update(plain, lin, plain.slot("body"), Gate());
  update(robust, lin, robust.slot("body"), Gate(), one_sided());
  EXPECT_TRUE(same_bits(plain, robust));
}

TEST(Robust, what_is_far_off_hardly_moves_the_belief_and_what_is_near_does) {
  for (const NoiseShape* shape : {&student_t(), &cauchy(), &one_sided()}) {
    GaussianBelief near = scalar_belief(1.0);
    update(near, level_of(1.0, 1.0), near.slot("level"), Gate(), *shape);
    EXPECT_NEAR(near.x(0), 0.5, 0.08);
    EXPECT_LT(near.P(0, 0), 0.75);

    GaussianBelief far = scalar_belief(1.0);
    const Outcome outcome = update(far, level_of(100.0, 1.0), far.slot("level"), Gate(), *shape);
    EXPECT_EQ(outcome.verdict, Verdict::kFused);
    EXPECT_DOUBLE_EQ(outcome.nis, 100.0 * 100.0 / 2.0);  // as if the noise were Gaussian
    EXPECT_LT(far.x(0), 0.12);
    EXPECT_GT(far.x(0), 0.0);
    EXPECT_NEAR(far.P(0, 0), 1.0, 0.02);
  }
}

TEST(Robust, in_doubt_it_knows_less_than_before) {
  GaussianBelief belief = scalar_belief(1.0);
  update(belief, level_of(5.0, 0.25), belief.slot("level"), Gate(), cauchy());
  EXPECT_GT(belief.P(0, 0), 1.0);
}

TEST(Robust, the_gate_decides_first_and_a_gated_measurement_changes_no_bit) {
  testing::Rng rng(3);
  GaussianBelief belief = some_belief(rng);
  const GaussianBelief before = belief;
  const Linearization<1, 3> lin{Vector<1>(50.0), Matrix<1, 3>(0.3, 0.4, 0.5), Matrix<1, 1>(0.1)};
  const Outcome outcome = update(belief, lin, belief.slot("body"), Gate(0.999), student_t());
  EXPECT_EQ(outcome.verdict, Verdict::kGated);
  EXPECT_TRUE(same_bits(belief, before));
}

TEST(Robust, a_part_of_a_belief_is_fused_as_the_whole_is) {
  testing::Rng rng(4);
  for (int i = 0; i < 50; ++i) {
    GaussianBelief part = some_belief(rng);
    GaussianBelief whole = part;
    Linearization<2, 3> lin;
    lin.residual = 3.0 * testing::random_matrix(rng, 2, 1);
    lin.jacobian = testing::random_matrix(rng, 2, 3);
    lin.noise = 0.1 * testing::random_covariance(rng, 2);
    Linearization<2, 5> wide{lin.residual, Matrix<2, 5>::Zero(), lin.noise};
    wide.jacobian.leftCols<3>() = lin.jacobian;
    update(part, lin, part.slot("body"), Gate(), student_t());
    update(whole, wide, std::vector<Slot>{whole.slot("body"), whole.slot("lamp")}, Gate(),
           student_t());
    EXPECT_LT((part.x - whole.x).norm(), 1e-12);
    EXPECT_LT((part.P - whole.P).norm(), 1e-12);
    EXPECT_EQ(part.P, part.P.transpose());
    EXPECT_GT(Eigen::MatrixXd(part.P).selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(),
              0.0);
  }
}

TEST(Robust, a_measurement_beyond_all_precision_leaves_a_positive_variance) {
  for (const double variance : {1e-16, 1e-12, 1e-6}) {
    GaussianBelief belief = scalar_belief(1e4);
    update(belief, level_of(1.0, variance), belief.slot("level"), Gate(), student_t());
    EXPECT_GT(belief.P(0, 0), 0.0);
    EXPECT_NEAR(belief.x(0), 1.0, 1e-6);
  }
}

/// Whatever the noise, the messages and how far they are off.
TEST(Robust, leaves_a_covariance_however_far_off_a_measurement_is) {
  testing::Rng rng(6);
  for (int i = 0; i < 3000; ++i) {
    GaussianBelief belief = some_belief(rng);
    const auto decade = [&](double low, double high) {
      return std::pow(10.0, testing::uniform(rng, low, high));
    };
    const Eigen::VectorXd scale =
        Eigen::VectorXd::NullaryExpr(5, [&](Eigen::Index /*row*/) { return decade(-2.0, 1.0); });
    belief.P = scale.asDiagonal() * belief.P * scale.asDiagonal();
    Linearization<2, 3> lin{decade(-3.0, 12.0) * testing::random_matrix(rng, 2, 1),
                            testing::random_matrix(rng, 2, 3),
                            decade(-12.0, 1.0) * testing::random_covariance(rng, 2)};
    update(belief, lin, belief.slot("body"), Gate(), i % 2 == 0 ? student_t() : cauchy());
    ASSERT_TRUE(testing::is_covariance(belief.P)) << i << '\n' << belief.P;
  }
}

TEST(Robust, doubt_stays_below_the_ceiling) {
  GaussianBelief belief = GaussianBelief::of_pose(
      0, {}, Vector<3>(1.0, 1.0, std::pow(kHeadingBounds.max, 2)).asDiagonal());
  const Linearization<1, 3> lin{Vector<1>(5.0 * kHeadingBounds.max), Matrix<1, 3>(0.0, 0.0, 1.0),
                                Matrix<1, 1>(0.25 * std::pow(kHeadingBounds.max, 2))};
  update(belief, lin, belief.slot("body"), Gate(), cauchy());
  EXPECT_EQ(std::sqrt(belief.P(2, 2)), kHeadingBounds.max);
  EXPECT_EQ(belief.interventions, 1U);
}

TEST(Robust, refuses_what_it_cannot_be) {
  expect_refused([] { NoiseShape({NoiseKind::kStudentT, 0.9}); }, "dof");
  expect_refused([] { NoiseShape({NoiseKind::kOneSided, 4.0, 0.0}); }, "late_share");
  expect_refused([] { NoiseShape({NoiseKind::kOneSided, 4.0, 1.0}); }, "late_share");
  testing::Rng rng(5);
  GaussianBelief belief = some_belief(rng);
  const Linearization<2, 3> lin{Vector<2>(1.0, 1.0), testing::random_matrix(rng, 2, 3),
                                Matrix<2, 2>::Identity()};
  expect_refused([&] { update(belief, lin, belief.slot("body"), Gate(), one_sided()); },
                 "no long side");
}

}  // namespace
}  // namespace locfuse::test_robust
