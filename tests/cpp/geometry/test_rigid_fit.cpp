// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cmath>

#include "locfuse/geometry/rigid_fit.hpp"
#include "locfuse/math/symmetric.hpp"
#include "support/consistency.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_pose_near;
using testing::expect_refused;
using testing::in_band;
using testing::Rng;
using Points = Matrix<2, Eigen::Dynamic>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const Matrix<2, 3> kBody = (Matrix<2, 3>() << 0.6, -0.3, -0.3, 0.0, 0.25, -0.25).finished();

template <int N>
Matrix<2, N> moved(const Pose2& pose, const Matrix<2, N>& body) {
  Matrix<2, N> world(2, body.cols());
  for (Eigen::Index i = 0; i < body.cols(); ++i) {
    world.col(i) = pose.act(body.col(i));
  }
  return world;
}

TEST(RigidFit, equals_values_computed_by_hand) {
  // Two points two metres apart, turned by a right angle, each with 0.1 m along both axes.
  const Points body = (Matrix<2, 2>() << 1.0, -1.0, 0.0, 0.0).finished();
  const Points world = (Matrix<2, 2>() << 2.0, 2.0, 4.1, 1.9).finished();
  const RigidFit fit = rigid_fit<Eigen::Dynamic>(body, world, 0.01 * Matrix<4, 4>::Identity());
  EXPECT_EQ(fit.status, RigidFitStatus::kFitted);
  expect_pose_near(fit.pose, {2.0, 3.0, kPi / 2.0}, 1e-12);
  expect_near(fit.covariance, Vector<3>(0.005, 0.005, 0.005).asDiagonal().toDenseMatrix(), 1e-12);
  EXPECT_EQ(fit.dof, 1);
  EXPECT_NEAR(fit.nis, 2.0 * 0.1 * 0.1 / 0.01, 1e-10);  // each is 0.1 m off along the line
}

TEST(RigidFit, finds_poses_exactly_whatever_the_weights) {
  Rng rng(4);
  for (int i = 0; i < 200; ++i) {
    const Pose2 truth = testing::random_pose(rng);
    const int n = 2 + i % 4;
    const Points body = testing::random_matrix(rng, 2, n);
    const RigidFit fit = rigid_fit<Eigen::Dynamic>(body, moved<Eigen::Dynamic>(truth, body),
                                                   testing::random_covariance(rng, 2 * n));
    ASSERT_EQ(fit.status, RigidFitStatus::kFitted);
    expect_pose_near(fit.pose, truth, 1e-9);
    EXPECT_LT(fit.nis, 1e-12);
    EXPECT_EQ(fit.dof, 2 * n - 3);
  }
}

TEST(RigidFit, does_not_fit_beyond_double_precision) {
  // Points millimetres apart, a thousand kilometres from the body's origin: to sixteen digits its
  // position and heading are fully correlated, yet the covariance had positive variances.
  Rng rng(6);
  int fitted = 0;
  int given_up = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vector<2> far =
        std::pow(10.0, testing::uniform(rng, 4.5, 7.0)) * testing::random_matrix(rng, 2, 1);
    const Points body = (0.01 * testing::random_matrix(rng, 2, 2)).colwise() + far;
    const double sigma = 0.1;
    const RigidFit fit =
        rigid_fit<Eigen::Dynamic>(body, moved<Eigen::Dynamic>(testing::random_pose(rng), body),
                                  sigma * sigma * Matrix<4, 4>::Identity());
    if (fit.status == RigidFitStatus::kNotConverged) {
      ++given_up;
    } else if (fit.status == RigidFitStatus::kFitted) {
      ++fitted;
      EXPECT_TRUE(is_covariance(fit.covariance)) << fit.covariance;
    }
  }
  EXPECT_GT(fitted, 100);
  EXPECT_GT(given_up, 100);
}

TEST(RigidFit, is_the_weighted_optimum) {
  Rng rng(9);
  for (int i = 0; i < 50; ++i) {
    const Pose2 truth = testing::random_pose(rng);
    const Matrix<6, 6> C = 0.02 * testing::random_covariance(rng, 6);
    Matrix<2, 3> world = moved<3>(truth, kBody);
    const Matrix<6, 6> root = C.llt().matrixL();
    Vector<6> noise;
    for (int k = 0; k < 6; ++k) {
      noise(k) = testing::normal(rng, 0.5);
    }
    const Vector<6> off = root * noise;
    world += Eigen::Map<const Matrix<2, 3>>(off.data());
    const RigidFit fit = rigid_fit(kBody, world, C);
    const auto cost = [&](const Pose2& pose) {
      const Matrix<2, 3> d = world - moved<3>(pose, kBody);
      const Eigen::Map<const Vector<6>> r(d.data());
      return r.dot(C.llt().solve(r));
    };
    EXPECT_NEAR(fit.nis, cost(fit.pose), 1e-9);
    for (int k = 0; k < 3; ++k) {
      for (const double step : {-1e-4, 1e-4}) {
        EXPECT_GT(cost(retract(fit.pose, step * Vector<3>::Unit(k))), cost(fit.pose));
      }
    }
  }
}

TEST(RigidFit, a_precise_point_counts_more) {
  Matrix<2, 3> world = kBody;
  world.col(0) += Vector<2>(0.0, 0.3);
  const Matrix<2, 2> precise = 1e-8 * Matrix<2, 2>::Identity();
  const Matrix<2, 2> vague = Matrix<2, 2>::Identity();
  const RigidFit without = rigid_fit(Points(kBody), Points(world), {vague, precise, precise});
  expect_pose_near(without.pose, {0.0, 0.0, 0.0}, 1e-6);
  const RigidFit with = rigid_fit(Points(kBody), Points(world), {precise, vague, vague});
  EXPECT_LT((with.pose.act(kBody.col(0)) - world.col(0)).norm(), 1e-6);
}

struct Calibration {
  double nees = 0.0;
  double nis = 0.0;
};

constexpr int kRuns = 400;

Calibration calibrate(double factor) {
  Calibration mean;
  for (int seed = 1; seed <= kRuns; ++seed) {
    Rng rng(static_cast<std::uint64_t>(seed));
    const Pose2 truth = testing::random_pose(rng);
    const Matrix<6, 6> C = 0.0009 * testing::random_covariance(rng, 6);
    const Matrix<6, 6> root = C.llt().matrixL();
    Vector<6> unit;
    for (int k = 0; k < 6; ++k) {
      unit(k) = testing::normal(rng, 1.0);
    }
    const Vector<6> off = root * unit;
    const Matrix<2, 3> world = moved<3>(truth, kBody) + Eigen::Map<const Matrix<2, 3>>(off.data());
    const Matrix<6, 6> reported = factor * C;
    const RigidFit fit = rigid_fit(kBody, world, reported);
    const Vector<3> error = local(truth, fit.pose);
    mean.nees += error.dot(fit.covariance.llt().solve(error)) / kRuns;
    mean.nis += fit.nis / kRuns;
  }
  return mean;
}

TEST(RigidFit, covariance_and_misfit_are_calibrated_over_seeds) {
  const Calibration consistent = calibrate(1.0);
  EXPECT_TRUE(in_band(consistent.nees, 3, kRuns)) << consistent.nees;
  EXPECT_TRUE(in_band(consistent.nis, 3, kRuns)) << consistent.nis;
  const Calibration overconfident = calibrate(0.5);
  EXPECT_FALSE(in_band(overconfident.nees, 3, kRuns)) << overconfident.nees;
  EXPECT_FALSE(in_band(overconfident.nis, 3, kRuns)) << overconfident.nis;
}

TEST(RigidFit, mirrored_points_are_never_a_rotation) {
  Rng rng(31);
  const Matrix<6, 6> C = 1e-4 * Matrix<6, 6>::Identity();
  for (int i = 0; i < 500; ++i) {
    Matrix<2, 3> mirrored = kBody;
    mirrored.row(1) *= -1.0;
    mirrored.col(0).y() += 0.2;  // so that it is not its own mirror image
    Matrix<2, 3> body = kBody;
    body.col(0).y() -= 0.2;
    Matrix<2, 3> world = moved<3>(testing::random_pose(rng), mirrored);
    for (int k = 0; k < 6; ++k) {
      world.data()[k] += testing::normal(rng, 0.01);
    }
    const RigidFit fit = rigid_fit(body, world, C);
    EXPECT_NE(fit.status, RigidFitStatus::kFitted);
    EXPECT_GT(fit.nis, 16.3);
  }
}

TEST(RigidFit, a_mirrored_equilateral_triangle_has_no_direction) {
  const double h = std::sqrt(0.75);
  const Matrix<2, 3> body = (Matrix<2, 3>() << 0.0, 1.0, 0.5, 0.0, 0.0, h).finished();
  const Matrix<2, 3> mirrored = (Matrix<2, 3>() << 0.0, 1.0, 0.5, 0.0, 0.0, -h).finished();
  const RigidFit fit = rigid_fit(body, mirrored, 1e-4 * Matrix<6, 6>::Identity());
  EXPECT_EQ(fit.status, RigidFitStatus::kNoDirection);
  EXPECT_TRUE(std::isnan(fit.pose.heading));
}

TEST(RigidFit, points_on_a_line_are_not_a_reflection) {
  const Matrix<2, 3> line = (Matrix<2, 3>() << 0.0, 1.0, 3.0, 0.0, 0.5, 1.5).finished();
  const Pose2 truth{3.0, -2.0, 2.5};
  const RigidFit fit = rigid_fit(line, moved<3>(truth, line), 1e-4 * Matrix<6, 6>::Identity());
  EXPECT_EQ(fit.status, RigidFitStatus::kFitted);
  expect_pose_near(fit.pose, truth, 1e-9);
}

TEST(RigidFit, points_that_coincide_in_world_have_no_direction) {
  const Matrix<2, 3> world = Vector<2>(3.0, 4.0).replicate<1, 3>();
  const RigidFit fit = rigid_fit(kBody, world, 1e-4 * Matrix<6, 6>::Identity());
  EXPECT_EQ(fit.status, RigidFitStatus::kNoDirection);
}

TEST(RigidFit, every_covariance_is_valid) {
  const Points body = (Matrix<2, 2>() << 0.1, 0.3, 0.2, -0.1).finished();
  const Points world = moved<Eigen::Dynamic>({-1.0, -1.4, 0.644}, body);
  for (const double variance : {1e-16, 1e-200, 1e-320}) {
    const Eigen::MatrixXd C = Vector<4>(variance, 1.0, 1.0, 1.0).asDiagonal();
    const RigidFit fit = rigid_fit<Eigen::Dynamic>(body, world, C);
    EXPECT_TRUE(fit.covariance.allFinite()) << variance;
    EXPECT_TRUE(fit.status != RigidFitStatus::kFitted || fit.covariance(2, 2) > 1e-3) << variance;
  }
}

TEST(RigidFit, rejects_invalid_bodies_and_covariances) {
  const Points one = Points::Zero(2, 1);
  const auto fit = [](const Points& body, const Points& world, const Eigen::MatrixXd& C) {
    return [=] { (void)rigid_fit<Eigen::Dynamic>(body, world, C); };
  };
  const Points body = kBody;
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(6, 6);
  expect_refused(fit(one, one, Eigen::MatrixXd::Identity(2, 2)), "1 points", "at least 2");
  expect_refused(fit(body, one, I), "3 points in body and 1 in world");
  expect_refused(fit(Vector<2>(1.5, 2.0).replicate<1, 3>(), body, I), "one place", "1.5");
  Points wrong = body;
  wrong(1, 2) = kNan;
  expect_refused(fit(wrong, body, I), "not finite");
  expect_refused(fit(body, wrong, I), "not finite");
  expect_refused(fit(body, body, -I), "positive definite");
  expect_refused(fit(body, body, kNan * I), "finite");
  expect_refused(fit(body, body, Eigen::MatrixXd::Identity(4, 4)), "4 x 4");
  Eigen::MatrixXd skewed = I;
  skewed(0, 1) = 0.5;
  expect_refused(fit(body, body, skewed), "symmetric");
}

}  // namespace
}  // namespace locfuse
