// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "locfuse/filters/kalman.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_kalman_robustness {
namespace {

using testing::is_covariance;
using testing::Rng;
using testing::same_bits;
using testing::uniform;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNan = std::nan("");

/// A pose alone, and the same with company: the fixed-size and the run-time code.
std::vector<GaussianBelief> both_kinds(double variance = 1.0) {
  const GaussianBelief alone =
      GaussianBelief::of_pose(7, {1.0, 2.0, 3.0}, variance * Matrix<3, 3>::Identity());
  GaussianBelief together = alone;
  together.add("point", SlotKind::kPoint2, Vector<2>(1.0, 2.0),
               variance * Matrix<2, 2>::Identity());
  return {alone, together};
}

Linearization<1, 3> along_x(double residual, double noise) {
  Linearization<1, 3> lin;
  lin.residual << residual;
  lin.jacobian << 1.0, 0.0, 0.0;
  lin.noise << noise;
  return lin;
}

Linearization<2, 3> along_xy(const Vector<2>& residual, const Matrix<2, 2>& noise) {
  Linearization<2, 3> lin;
  lin.residual = residual;
  lin.jacobian << 1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  lin.noise = noise;
  return lin;
}

TEST(Update, gated_changes_no_bit_and_says_why) {
  for (GaussianBelief& belief : both_kinds()) {
    const GaussianBelief before = belief;
    const Outcome outcome = update(belief, along_x(4.0, 1.0), belief.slot("body"), Gate(0.95));
    EXPECT_EQ(outcome.verdict, Verdict::kGated);
    EXPECT_NEAR(outcome.nis, 8.0, 1e-14);
    EXPECT_EQ(outcome.dof, 1);
    EXPECT_EQ(outcome.residual, 4.0);
    EXPECT_TRUE(same_bits(belief, before));
  }
}

TEST(Update, gate_divides_at_the_quantile) {
  const double limit = std::sqrt(3.841458820694124 * 2.0);  // S = 2
  for (GaussianBelief& belief : both_kinds()) {
    const Slot body = belief.slot("body");
    EXPECT_EQ(update(belief, along_x(limit + 1e-9, 1.0), body, Gate(0.95)).verdict,
              Verdict::kGated);
    EXPECT_EQ(update(belief, along_x(limit - 1e-9, 1.0), body, Gate(0.95)).verdict,
              Verdict::kFused);
  }
}

/// A measurement of the whole pose; `squared` is its NIS where S = 2 I.
template <int M>
Linearization<M, 3> of_pose(double squared) {
  Linearization<M, 3> lin;
  lin.residual = std::sqrt(2.0 * squared) * Vector<3>(0.6, 0.0, 0.8);
  lin.jacobian = Matrix<3, 3>::Identity();
  lin.noise = Matrix<3, 3>::Identity();
  return lin;
}

template <int M>
void expect_gate_at(double limit) {
  for (const GaussianBelief& start : both_kinds()) {
    const Slot body = start.slot("body");
    GaussianBelief belief = start;
    EXPECT_EQ(update(belief, of_pose<M>(limit + 1e-9), body, Gate(0.95)).verdict, Verdict::kGated);
    EXPECT_TRUE(same_bits(belief, start));
    EXPECT_EQ(update(belief, of_pose<M>(limit - 1e-9), body, Gate(0.95)).verdict, Verdict::kFused);
    EXPECT_FALSE(same_bits(belief, start));
  }
}

TEST(Update, gate_knows_the_degrees_of_freedom_of_a_measurement) {
  expect_gate_at<3>(7.814727903251179);
  expect_gate_at<Eigen::Dynamic>(7.814727903251179);
}

template <int M>
void expect_breaks(const Linearization<M, 3>& lin) {
  for (GaussianBelief& belief : both_kinds()) {
    const GaussianBelief before = belief;
    EXPECT_THROW(update(belief, lin, belief.slot("body"), Gate()), NumericalError);
    EXPECT_TRUE(same_bits(belief, before));
  }
}

TEST(Update, breaks_on_noise_that_is_none_and_changes_no_bit) {
  expect_breaks(along_x(0.1, -2.0));
  expect_breaks(along_x(0.1, kNan));
  expect_breaks(along_x(0.1, kInfinity));
  expect_breaks(along_xy({0.1, 0.1}, -2.0 * Matrix<2, 2>::Identity()));
  expect_breaks(along_xy({0.1, 0.1}, (Matrix<2, 2>() << 1.0, 3.0, 3.0, 1.0).finished()));
  expect_breaks(along_xy({0.1, 0.1}, (Matrix<2, 2>() << 1.0, kNan, 0.0, 1.0).finished()));
  expect_breaks(along_xy({0.1, 0.1}, (Matrix<2, 2>() << 1.0, 0.0, kNan, 1.0).finished()));
}

TEST(Update, breaks_on_numbers_that_are_not_finite_and_changes_no_bit) {
  expect_breaks(along_x(kNan, 1.0));
  expect_breaks(along_x(kInfinity, 1.0));
  expect_breaks(along_xy({0.0, kNan}, Matrix<2, 2>::Identity()));
  Linearization<1, 3> lin = along_x(0.1, 1.0);
  lin.jacobian(1) = kNan;
  expect_breaks(lin);
  lin.jacobian(1) = kInfinity;
  expect_breaks(lin);
}

TEST(Update, refuses_shapes_that_do_not_match) {
  using Lin = Linearization<Eigen::Dynamic, 3>;
  const Eigen::VectorXd r = Eigen::VectorXd::Zero(2);
  const Eigen::MatrixXd H = Eigen::MatrixXd::Ones(2, 3);
  const Eigen::MatrixXd R = Eigen::MatrixXd::Identity(2, 2);
  for (GaussianBelief& belief : both_kinds()) {
    const GaussianBelief before = belief;
    const auto refused = [&](const Lin& lin, const char* text) {
      testing::expect_refused([&] { update(belief, lin, belief.slot("body"), Gate()); }, text);
    };
    const Eigen::MatrixXd none(0, 3);
    refused({Eigen::VectorXd(0), none, Eigen::MatrixXd(0, 0)}, "a residual of 0 rows");
    refused({Eigen::VectorXd::Zero(3), H, R}, "a residual of 3 rows");
    refused({r, Eigen::MatrixXd::Ones(4, 3), R}, "a Jacobian of 4 rows");
    refused({r, H, Eigen::MatrixXd::Identity(5, 5)}, "noise of 5 x 5");
    refused({r, H, Eigen::MatrixXd::Ones(2, 1)}, "noise of 2 x 1");
    EXPECT_TRUE(same_bits(belief, before));
  }
}

TEST(Predict, breaks_on_numbers_that_are_not_finite_and_changes_no_bit) {
  const Matrix<3, 3> I = Matrix<3, 3>::Identity();
  for (GaussianBelief& belief : both_kinds()) {
    const GaussianBelief before = belief;
    const Slot body = belief.slot("body");
    EXPECT_THROW(predict(belief, {{kNan, 0.0, 0.0}, I, I}, body), NumericalError);
    EXPECT_THROW(predict(belief, {{0.0, 0.0, kInfinity}, I, I}, body), NumericalError);
    EXPECT_THROW(predict(belief, {{}, kNan * I, I}, body), NumericalError);
    EXPECT_THROW(predict(belief, {{}, I, kInfinity * I}, body), NumericalError);
    const Eigen::Vector3d bad(kNan, 0.0, 0.0);
    const std::vector<Slot> slots{body};
    EXPECT_THROW(predict(belief, {bad, I, I}, slots), NumericalError);
    EXPECT_THROW(predict(belief, {0.0 * Eigen::Vector3d::Ones(), kNan * I, I}, slots),
                 NumericalError);
    EXPECT_THROW(predict(belief, {0.0 * Eigen::Vector3d::Ones(), I, -9.0 * I}, slots),
                 NumericalError);
    EXPECT_TRUE(same_bits(belief, before));
  }
}

TEST(Predict, breaks_on_noise_that_leaves_no_variance_and_changes_no_bit) {
  // Q of a foreign model may be anything: a belief of negative variance used to be the result.
  const Matrix<3, 3> I = Matrix<3, 3>::Identity();
  for (GaussianBelief& belief : both_kinds()) {
    const GaussianBelief before = belief;
    const Slot body = belief.slot("body");
    for (const double q : {-1.0, -9.0}) {
      EXPECT_THROW(predict(belief, {{}, I, q * I}, body), NumericalError);
    }
    EXPECT_TRUE(same_bits(belief, before));
    EXPECT_NO_THROW(predict(belief, {{}, I, -0.5 * I}, body));
  }
}

/// A measurement of a random direction, as ranges are.
Linearization<1, 3> oblique(Rng& rng, double noise) {
  const double bearing = uniform(rng, -kPi, kPi);
  Linearization<1, 3> lin;
  lin.residual << testing::normal(rng, std::sqrt(noise));
  lin.jacobian << std::cos(bearing), std::sin(bearing), uniform(rng, -1.0, 1.0);
  lin.noise << noise;
  return lin;
}

/// A measurement of one variable, as positions are.
Linearization<1, 3> straight(Rng& rng, double noise) {
  Linearization<1, 3> lin = oblique(rng, noise);
  lin.jacobian = Vector<3>::Unit(static_cast<int>(rng() % 3U)).transpose();
  return lin;
}

/// `steps` measurements with a little motion in between. Looks at the covariance from `first` on:
/// 200 times in a row, then now and then.
template <class Measure>
void expect_stays_a_covariance(int steps, const Measure& measure, double variance, double noise,
                               double walk, int first = 0) {
  SCOPED_TRACE(::testing::Message() << "P " << variance << ", R " << noise << ", Q " << walk);
  for (GaussianBelief& belief : both_kinds(variance)) {
    Rng rng(3);
    const Slot body = belief.slot("body");
    for (int i = 0; i < steps; ++i) {
      const bool look = i >= first && (i < first + 200 || i % 50 == 0);
      ASSERT_EQ(update(belief, measure(rng, noise), body, Gate()).verdict, Verdict::kFused);
      ASSERT_TRUE(same_bits(belief.P, belief.P.transpose()));
      ASSERT_TRUE(!look || is_covariance(belief.P)) << "update " << i << "\n" << belief.P;
      const Matrix<3, 3> Q = walk * Matrix<3, 3>::Identity();
      predict(belief, {belief.pose(body), Matrix<3, 3>::Identity(), Q}, body);
      ASSERT_TRUE(!look || is_covariance(belief.P)) << "prediction " << i << "\n" << belief.P;
    }
  }
}

TEST(Update, leaves_a_covariance_after_ten_thousand_measurements) {
  expect_stays_a_covariance(10'000, oblique, 1.0, 0.01, 1e-6);
  expect_stays_a_covariance(1000, oblique, 1.0, 1e-8, 0.0);
  expect_stays_a_covariance(1000, oblique, 1e-6, 1e4, 0.0);
}

TEST(Update, leaves_a_covariance_where_measurements_are_far_better_than_the_belief) {
  for (const double variance : {1e8, 1e10, 1e12}) {
    expect_stays_a_covariance(1000, straight, variance, 1e-8, 0.0);
    expect_stays_a_covariance(1000, straight, variance, 1e-8, 1e-2);
  }
  expect_stays_a_covariance(1000, oblique, 1e6, 1e-8, 0.0);
  expect_stays_a_covariance(1000, oblique, 1e8, 1e-6, 1e-10);
}

TEST(Update, recovers_where_a_covariance_exceeds_the_digits_of_a_double) {
  // P / R is 1e16 and more: no matrix of doubles is that long and that thin in an oblique
  // direction. Once all directions have been measured it must be a covariance all the same.
  expect_stays_a_covariance(1000, oblique, 1e8, 1e-8, 0.0, 10);
  expect_stays_a_covariance(1000, oblique, 1e12, 1e-4, 0.0, 10);
  expect_stays_a_covariance(1000, oblique, 1e12, 1e-8, 1e-2, 10);
}

}  // namespace
}  // namespace locfuse::test_kalman_robustness
