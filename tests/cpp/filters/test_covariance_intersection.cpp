// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <limits>

#include "locfuse/error.hpp"
#include "locfuse/filters/covariance_intersection.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse::test_covariance_intersection {
namespace {

using testing::Rng;

Matrix<3, 3> random_covariance(Rng& rng) {
  Matrix<3, 3> root;
  for (int i = 0; i < root.size(); ++i) {
    root(i) = testing::normal(rng, 1.0);
  }
  return root * root.transpose() + 0.01 * Matrix<3, 3>::Identity();
}

double determinant_at(double weight, const Matrix<3, 3>& A, const Matrix<3, 3>& B) {
  return (weight * A.inverse() + (1.0 - weight) * B.inverse()).inverse().determinant();
}

TEST(CovarianceIntersection, has_the_smallest_determinant_of_all_weights) {
  Rng rng(4);
  for (int k = 0; k < 50; ++k) {
    const Matrix<3, 3> A = random_covariance(rng);
    const Matrix<3, 3> B = random_covariance(rng);
    const double best = determinant_at(intersection_weight(A, B), A, B);
    for (double weight = 0.001; weight < 1.0; weight += 0.01) {
      EXPECT_LE(best, determinant_at(weight, A, B) * (1.0 + 1e-9)) << weight;
    }
  }
}

TEST(CovarianceIntersection, of_two_of_which_one_is_smaller_everywhere_is_that_one) {
  Rng rng(5);
  const Matrix<3, 3> A = random_covariance(rng);
  EXPECT_NEAR(intersection_weight(A, 1.5 * A), 0.999, 1e-9);
  EXPECT_NEAR(intersection_weight(1.5 * A, A), 0.001, 1e-9);
}

TEST(CovarianceIntersection, refuses_what_is_no_covariance) {
  Matrix<3, 3> bad = Matrix<3, 3>::Identity();
  bad(2, 2) = -1.0;
  const Matrix<3, 3> good = Matrix<3, 3>::Identity();
  EXPECT_THROW((void)intersection_weight(bad, good), NumericalError);
  EXPECT_THROW((void)intersection_weight(good, bad), NumericalError);
  bad(2, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)intersection_weight(bad, good), NumericalError);
}

}  // namespace
}  // namespace locfuse::test_covariance_intersection
