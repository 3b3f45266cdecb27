// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/filters/kalman.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_augment {
namespace {

using testing::expect_near;
using testing::expect_refused;
using testing::random_covariance;
using testing::random_matrix;
using testing::Rng;
using testing::same_bits;

GaussianBelief pose_and_two_points(Rng& rng) {
  GaussianBelief belief = GaussianBelief::of_pose(3, {1.0, 2.0, 0.3}, Matrix<3, 3>::Identity());
  belief.add("a", SlotKind::kPoint2, Vector<2>(4.0, 5.0), Matrix<2, 2>::Identity());
  belief.add("b", SlotKind::kPoint2, Vector<2>(6.0, 7.0), Matrix<2, 2>::Identity());
  belief.P = random_covariance(rng, 7);
  return belief;
}

TEST(Augment, equals_the_closed_form) {
  Rng rng(1);
  for (int i = 0; i < 50; ++i) {
    GaussianBelief belief = pose_and_two_points(rng);
    const GaussianBelief before = belief;
    const std::vector<Slot> slots = {belief.slot("b"), belief.slot("body")};
    const Eigen::MatrixXd Gx = random_matrix(rng, 2, 5);
    const Eigen::MatrixXd noise = random_covariance(rng, 2);
    const Vector<2> mean(1.5, -2.5);
    const Slot added = augment(belief, "c", SlotKind::kPoint2, mean, Gx, noise, slots);

    Eigen::MatrixXd G = Eigen::MatrixXd::Zero(9, 7);  // (old state, new point) by the old state
    G.topRows(7).setIdentity();
    G.block(7, 5, 2, 2) = Gx.leftCols(2);
    G.block(7, 0, 2, 3) = Gx.rightCols(3);
    Eigen::MatrixXd expected = G * before.P * G.transpose();
    expected.bottomRightCorner(2, 2) += noise;
    expect_near(belief.P, expected, 1e-14);
    EXPECT_TRUE(testing::is_covariance(belief.P));
    EXPECT_TRUE(same_bits(belief.P.topLeftCorner(7, 7), before.P));
    EXPECT_TRUE(same_bits(belief.x.head(7), before.x));
    EXPECT_EQ(belief.mean(added), Eigen::VectorXd(mean));
    EXPECT_EQ(belief.slot("c").id, added.id);
  }
}

TEST(Augment, a_wrong_call_changes_no_bit) {
  Rng rng(2);
  GaussianBelief belief = pose_and_two_points(rng);
  const GaussianBelief before = belief;
  const Eigen::MatrixXd Gx = random_matrix(rng, 2, 3);
  const Matrix<2, 2> I = Matrix<2, 2>::Identity();
  const Vector<2> zero = Vector<2>::Zero();
  const auto add = [&](const char* name, const Eigen::VectorXd& mean, const Eigen::MatrixXd& G,
                       const Eigen::MatrixXd& noise) {
    augment(belief, name, SlotKind::kPoint2, mean, G, noise, belief.slot("body"));
  };
  expect_refused([&] { add("a", zero, Gx, I); }, "'a'", "already");
  expect_refused([&] { add("c", zero, Gx.leftCols(2), I); }, "'c'", "2 x 2");
  expect_refused([&] { add("c", zero, Gx, Matrix<3, 3>::Identity()); }, "3 x 3");
  expect_refused([&] { add("c", zero, Gx, Matrix<2, 3>::Zero()); }, "2 x 3");
  expect_refused([&] { add("c", zero, Gx, Matrix<3, 2>::Zero()); }, "3 x 2");
  expect_refused([&] { add("c", Vector<3>::Zero(), Gx, I); }, "a mean of 3");
  EXPECT_THROW(add("c", Vector<2>(std::nan(""), 0.0), Gx, I), NumericalError);
  EXPECT_THROW(add("c", zero, std::nan("") * Gx, I), NumericalError);
  EXPECT_THROW(add("c", zero, Gx, -I), NumericalError);
  EXPECT_THROW(add("c", zero, Gx, Matrix<2, 2>::Zero()), NumericalError);
  EXPECT_TRUE(same_bits(belief, before));
  expect_refused([&] { (void)belief.slot("c"); }, "no slot");
}

TEST(Covariance, grows_and_shrinks_as_a_matrix_would) {
  Rng rng(3);
  Covariance P;
  Eigen::MatrixXd expected(0, 0);
  for (int i = 0; i < 40; ++i) {
    if (i % 4 == 3) {
      const Eigen::Index first = static_cast<Eigen::Index>(rng() % 3U);
      std::vector<Eigen::Index> keep;
      for (Eigen::Index row = 0; row < expected.rows(); ++row) {
        if (row < first || row >= first + 2) {
          keep.push_back(row);
        }
      }
      expected = Eigen::MatrixXd(expected(keep, keep));
      P.remove(first, 2);
    } else {
      const Eigen::Index size = expected.rows();
      P.grow(3);
      expected.conservativeResize(size + 3, size + 3);
      expected.rightCols(3).setZero();
      expected.bottomRows(3).setZero();
      ASSERT_EQ(P, expected);
      expected = random_matrix(rng, size + 3, size + 3);
      P = expected;
    }
    ASSERT_EQ(P, expected);
  }
}

TEST(Covariance, copies_and_parts_are_independent) {
  Rng rng(4);
  Covariance P;
  P = random_matrix(rng, 5, 5);
  const Eigen::MatrixXd before = P;
  Covariance copy = P;
  copy(0, 0) = 9.0;
  EXPECT_EQ(P, before);
  Covariance moved = std::move(copy);
  EXPECT_EQ(moved(0, 0), 9.0);
  P = P.topLeftCorner(3, 3);  // a part of itself
  EXPECT_EQ(P, before.topLeftCorner(3, 3));
  P = moved;
  EXPECT_EQ(P(0, 0), 9.0);
}

/// A body and `points` points that are correlated with it.
GaussianBelief crowd(Rng& rng, int points) {
  GaussianBelief belief =
      GaussianBelief::of_pose(0, {0.0, 0.0, 0.1}, 0.01 * Matrix<3, 3>::Identity());
  const Slot body = belief.slot("body");
  for (int i = 0; i < points; ++i) {
    augment(belief, std::to_string(i), SlotKind::kPoint2, random_matrix(rng, 2, 1),
            random_matrix(rng, 2, 3), 0.01 * random_covariance(rng, 2), body);
  }
  return belief;
}

TEST(Update, of_two_slots_among_many_stays_a_covariance_and_equals_the_textbook) {
  Rng rng(5);
  for (const int points : {1, 7, 8, 20, 33}) {  // around the size of a tile
    GaussianBelief belief = crowd(rng, points);
    for (int i = 0; i < 200; ++i) {
      const std::vector<Slot> slots = {
          belief.slot("body"),
          belief.slot(std::to_string(rng() % static_cast<std::uint64_t>(points)))};
      const Linearization<2, 5> lin{0.01 * random_matrix(rng, 2, 1), random_matrix(rng, 2, 5),
                                    1e-4 * random_covariance(rng, 2)};
      Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2, belief.dimension());
      H(Eigen::all, belief.rows(slots)) = lin.jacobian;
      const Eigen::MatrixXd S = H * belief.P * H.transpose() + lin.noise;
      const Eigen::MatrixXd K = S.llt().solve(H * belief.P).transpose();
      const Eigen::VectorXd x = belief.x + K * lin.residual;
      const Eigen::MatrixXd P = belief.P - K * S * K.transpose();
      ASSERT_EQ(update(belief, lin, slots, Gate()).verdict, Verdict::kFused);
      expect_near(belief.P, P, 1e-13);
      expect_near(belief.x, x, 1e-12);
      ASSERT_TRUE(testing::is_covariance(belief.P));
    }
  }
}

// Large parts that cancel leave nothing of the noise; rounding decides what is left.
TEST(Augment, refuses_a_covariance_without_digits_and_leaves_the_belief) {
  int refused = 0;
  for (int k = 0; k < 20; ++k) {
    GaussianBelief belief =
        GaussianBelief::of_pose(0, {}, Vector<3>(1e-12, 1e-12, 100.0).asDiagonal());
    const GaussianBelief before = belief;
    Matrix<2, 3> jacobian;
    jacobian << 1.0, 0.0, -9000.0 * std::sin(0.3 * k), 0.0, 1.0, 9000.0 * std::cos(0.3 * k);
    try {
      augment(belief, "point", SlotKind::kPoint2, Vector<2>::Zero(), jacobian,
              1e-12 * Matrix<2, 2>::Identity(), belief.slot("body"));
      EXPECT_TRUE(Eigen::MatrixXd(belief.P.bottomRightCorner(2, 2)).llt().info() == Eigen::Success);
    } catch (const NumericalError&) {
      ++refused;
      EXPECT_TRUE(testing::same_bits(belief, before));
    }
  }
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace locfuse::test_augment
