// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>

#include "locfuse/filters/robust.hpp"
#include "support/expect.hpp"
#include "support/linear_kalman.hpp"
#include "support/random.hpp"

namespace locfuse::test_kalman_consider {
namespace {

using testing::MatrixXl;
using testing::random_covariance;
using testing::random_matrix;
using testing::VectorXl;

/// A pose, a point and two numbers, correlated at random; `considered` of them are.
GaussianBelief some_belief(testing::Rng& rng, const std::vector<std::string>& considered) {
  GaussianBelief belief = GaussianBelief::of_pose(0, {1.0, 2.0, 0.5}, random_covariance(rng, 3));
  belief.add("lamp", SlotKind::kPoint2, Vector<2>(3.0, 4.0), random_covariance(rng, 2));
  belief.add("offset", SlotKind::kScalar, Vector<1>(0.1), random_covariance(rng, 1));
  belief.add("scale", SlotKind::kScalar, Vector<1>(0.2), random_covariance(rng, 1));
  belief.P = random_covariance(rng, 7);
  for (const std::string& name : considered) {
    belief.consider(belief.slot(name));
  }
  return belief;
}

const std::vector<std::string>& names() {
  static const std::vector<std::string> all{"body", "lamp", "offset", "scale"};
  return all;
}

/// Schmidt's update as the textbook has it, in long double: rows of the gain taken as zero.
template <int M>
void expect_textbook(testing::Rng& rng) {
  for (int i = 0; i < 200; ++i) {
    std::vector<std::string> considered;
    for (const std::string& name : names()) {
      if (testing::uniform(rng, 0.0, 1.0) < 0.4) {
        considered.push_back(name);
      }
    }
    GaussianBelief belief = some_belief(rng, considered);
    const GaussianBelief before = belief;
    const Linearization<Eigen::Dynamic, Eigen::Dynamic> lin{
        0.1 * random_matrix(rng, M, 1), random_matrix(rng, M, 7), random_covariance(rng, M)};
    std::vector<Slot> slots;
    for (const std::string& name : names()) {
      slots.push_back(belief.slot(name));
    }
    ASSERT_EQ(update(belief, lin, slots, Gate()).verdict, Verdict::kFused);

    const MatrixXl P = MatrixXl(Eigen::MatrixXd(before.P).cast<long double>());
    const MatrixXl H = lin.jacobian.cast<long double>();
    const MatrixXl R = lin.noise.cast<long double>();
    MatrixXl K = P * H.transpose() * MatrixXl(H * P * H.transpose() + R).inverse();
    for (const int row : before.considered_rows()) {
      K.row(row).setZero();
    }
    const MatrixXl I_KH = MatrixXl::Identity(7, 7) - K * H;
    const MatrixXl joseph = I_KH * P * I_KH.transpose() + K * R * K.transpose();
    const VectorXl x = before.x.cast<long double>() + K * lin.residual.cast<long double>();
    testing::expect_near(belief.x, x.cast<double>(), 1e-12);
    testing::expect_near(Eigen::MatrixXd(belief.P), joseph.cast<double>(), 1e-12);
    EXPECT_TRUE(testing::is_covariance(belief.P));
    for (const int row : before.considered_rows()) {
      EXPECT_EQ(belief.x(row), before.x(row));
      EXPECT_NEAR(belief.P(row, row), before.P(row, row), 1e-14);
    }
  }
}

TEST(Consider, is_the_textbooks_update_with_rows_of_the_gain_taken_as_zero) {
  testing::Rng rng(1);
  expect_textbook<1>(rng);
  expect_textbook<2>(rng);
  expect_textbook<3>(rng);
}

TEST(Consider, a_belief_that_is_whole_is_not_updated_as_if_nothing_were_considered) {
  testing::Rng rng(2);
  const GaussianBelief before = some_belief(rng, {"scale"});
  const std::vector<Slot> slots{before.slot("body"), before.slot("lamp"), before.slot("offset"),
                                before.slot("scale")};
  const Linearization<1, 7> lin{Vector<1>(0.5), random_matrix(rng, 1, 7), Matrix<1, 1>(0.1)};
  for (const NoiseKind kind : {NoiseKind::kGaussian, NoiseKind::kStudentT}) {
    GaussianBelief belief = before;
    update(belief, lin, slots, Gate(), NoiseShape({kind}));
    EXPECT_EQ(belief.x(6), before.x(6));
    EXPECT_NEAR(belief.P(6, 6), before.P(6, 6), 1e-14);
    EXPECT_NE(belief.x(0), before.x(0));
  }
}

TEST(Consider, rows_follow_when_another_variable_is_removed_and_copies_keep_their_own) {
  testing::Rng rng(3);
  GaussianBelief belief = some_belief(rng, {"scale"});
  const GaussianBelief copy = belief;
  belief.remove(belief.slot("lamp"));
  EXPECT_EQ(belief.considered_rows(), std::vector<int>{4});
  belief.consider(belief.slot("offset"));
  EXPECT_EQ(belief.considered_rows(), (std::vector<int>{3, 4}));
  EXPECT_EQ(copy.considered_rows(), std::vector<int>{6});
  EXPECT_THROW(belief.consider(Slot{1}), std::invalid_argument);
}

}  // namespace
}  // namespace locfuse::test_kalman_consider
