// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "locfuse/messages/messages.hpp"
#include "locfuse/messages/reported_covariance.hpp"
#include "support/expect.hpp"

namespace locfuse::test_reported_covariance {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMax = std::numeric_limits<double>::max();
const Vector<3> kMinSigma(1e-3, 1e-3, 1e-4);

ReportedNoise<3> noise_of(const Matrix<3, 3>& covariance,
                          const Vector<3>& unknown = Vector<3>::Zero()) {
  validate(PoseObservation{0, {}, covariance});
  return reported_noise<3>(covariance, unknown, kMinSigma);
}

Matrix<3, 3> diagonal(double x, double y, double heading) {
  return Vector<3>(x, y, heading).asDiagonal();
}

TEST(ReportedCovariance, one_that_is_reported_is_unchanged_bit_for_bit) {
  Matrix<3, 3> R = diagonal(0.04, 0.09, 0.01);
  R(0, 1) = R(1, 0) = 0.03;
  const ReportedNoise<3> noise = noise_of(R);
  ASSERT_EQ(noise.rows, 3);
  EXPECT_EQ((noise.noise - R).norm(), 0.0);
}

TEST(ReportedCovariance, minus_one_and_all_zero_are_not_reported) {
  Matrix<3, 3> one = diagonal(-1.0, 0.5, 0.5);
  one(0, 1) = 7.0;  // ignored
  for (const Matrix<3, 3>& R : {one, Matrix<3, 3>(Matrix<3, 3>::Zero())}) {
    EXPECT_EQ(noise_of(R).rows, 0);
    const ReportedNoise<3> noise = noise_of(R, {0.5, 0.5, 0.1});
    ASSERT_EQ(noise.rows, 3);
    EXPECT_TRUE(noise.noise.isApprox(diagonal(0.25, 0.25, 0.01)));
    const ReportedNoise<3> position = noise_of(R, {0.5, 0.5, 0.0});
    ASSERT_EQ(position.rows, 2);
    EXPECT_EQ(position.axes[1], 1);
  }
}

TEST(ReportedCovariance, an_axis_that_is_not_measured_drops_out_with_all_its_correlations) {
  for (const double variance : {1e6, 1e9, kMax, kInfinity}) {
    Matrix<3, 3> R = diagonal(0.04, variance, 0.01);
    R(0, 1) = R(1, 0) = variance;
    R(0, 2) = R(2, 0) = 0.005;
    const ReportedNoise<3> noise = noise_of(R);
    ASSERT_EQ(noise.rows, 2) << variance;
    EXPECT_EQ(noise.axes[0], 0);
    EXPECT_EQ(noise.axes[1], 2);
    EXPECT_EQ(noise.noise(0, 0), 0.04);
    EXPECT_EQ(noise.noise(0, 1), 0.005);
    EXPECT_EQ(noise.noise(1, 1), 0.01);
  }
  EXPECT_EQ(noise_of(diagonal(kMax, 1e6, kInfinity), {1.0, 1.0, 1.0}).rows, 0);
  EXPECT_EQ(noise_of(diagonal(999999.0, 1.0, 1.0)).rows, 3);
}

TEST(ReportedCovariance, one_below_the_minimum_is_raised_and_keeps_its_correlation) {
  Matrix<3, 3> R = diagonal(1e-20, 0.04, 1e-30);
  R(0, 1) = R(1, 0) = 0.5 * 1e-10 * 0.2;
  const ReportedNoise<3> noise = noise_of(R);
  EXPECT_NEAR(noise.noise(0, 0), 1e-6, 1e-18);
  EXPECT_NEAR(noise.noise(0, 1), 0.5 * 1e-3 * 0.2, 1e-15);
  EXPECT_EQ(noise.noise(1, 1), 0.04);
  EXPECT_NEAR(noise.noise(2, 2), 1e-8, 1e-20);
  EXPECT_EQ(noise.noise.llt().info(), Eigen::Success);
}

TEST(ReportedCovariance, rejects_values_that_no_convention_explains) {
  const double nan = std::nan("");
  for (const Matrix<3, 3>& R :
       {diagonal(0.04, 0.0, 0.01), diagonal(0.04, -1.0, 0.01), diagonal(0.04, nan, 0.01),
        diagonal(-1.0, nan, 0.0), diagonal(-kInfinity, 1.0, 1.0), diagonal(0.04, kMax, -0.01)}) {
    testing::expect_refused(
        [&] {
          validate(PoseObservation{0, {}, R});
        },
        "PoseObservation.covariance");
  }
}

TEST(ReportedCovariance, a_variance_whose_root_underflows_is_the_minimum) {
  for (const double variance : {1e-314, 1e-316, 5e-324}) {
    const Matrix<2, 2> R = variance * Matrix<2, 2>::Identity();
    const ReportedNoise<2> noise = reported_noise<2>(R, {1.0, 1.0}, {1e-3, 1e-3});
    EXPECT_NEAR(noise.noise(0, 0), 1e-6, 1e-8) << variance;
    EXPECT_EQ(noise.noise(0, 1), 0.0) << variance;
  }
}

}  // namespace
}  // namespace locfuse::test_reported_covariance
