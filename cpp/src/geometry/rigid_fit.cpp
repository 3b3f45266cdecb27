// SPDX-License-Identifier: Apache-2.0
#include "locfuse/geometry/rigid_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "locfuse/math/angle.hpp"
#include "locfuse/math/symmetric.hpp"

namespace locfuse {
namespace {

/// Constants of `rigid_fit`.
struct RigidFitTuning {
  /// Extent of the points below which they coincide [m], and the same as a share of their moments.
  static constexpr double kMinExtent = 1e-9;
  static constexpr double kMinShare = 1e-9;
  /// Squared step below which the fit has converged, beside 1 plus the squared extent.
  static constexpr double kConverged = 1e-18;
  static constexpr int kMaxSteps = 50;
};

/// Moments that determine a heading: eq. (4.2) of docs/models/poses.md, and (4.3) of a reflection.
struct Turn {
  Vector<2> rotation = Vector<2>::Zero();  // length times (cos, sin) of the heading
  Vector<2> reflection = Vector<2>::Zero();
  double in_body = 0.0;  // sums of squares about the centres [m^2]
  double in_world = 0.0;
};

template <int N>
Turn turn_of(const Matrix<2, N>& body, const Matrix<2, N>& world, const Vector<2>& body_centre,
             const Vector<2>& world_centre) {
  Turn turn;
  for (Eigen::Index i = 0; i < body.cols(); ++i) {
    const Vector<2> b = body.col(i) - body_centre;
    const Vector<2> w = world.col(i) - world_centre;
    turn.rotation += Vector<2>(b.dot(w), b.x() * w.y() - b.y() * w.x());
    turn.reflection += Vector<2>(b.x() * w.x() - b.y() * w.y(), b.x() * w.y() + b.y() * w.x());
    turn.in_body += b.squaredNorm();
    turn.in_world += w.squaredNorm();
  }
  return turn;
}

template <int N>
void check_points(const Matrix<2, N>& body, const Matrix<2, N>& world) {
  const Eigen::Index n = body.cols();
  if (n < 2 || world.cols() != n) {
    throw std::invalid_argument("a rigid fit got " + std::to_string(n) + " points in body and " +
                                std::to_string(world.cols()) +
                                " in world, expected as many of both, at least 2");
  }
  if (!body.allFinite() || !world.allFinite()) {
    throw std::invalid_argument("a rigid fit got a point that is not finite");
  }
}

}  // namespace

template <int N>
RigidFit rigid_fit(const Matrix<2, N>& body, const Matrix<2, N>& world,
                   const Matrix<internal::twice(N), internal::twice(N)>& covariance) {
  constexpr int kRows = internal::twice(N);
  check_points(body, world);
  const Eigen::Index n = body.cols();
  const Vector<2> body_centre = body.rowwise().mean();
  const Vector<2> world_centre = world.rowwise().mean();
  const Turn turn = turn_of(body, world, body_centre, world_centre);
  if (!(turn.in_body > RigidFitTuning::kMinExtent * RigidFitTuning::kMinExtent)) {
    throw std::invalid_argument("the points of a rigid fit all lie in one place of the body (" +
                                std::to_string(body_centre.x()) + ", " +
                                std::to_string(body_centre.y()) + ") m, which leaves no heading");
  }
  if (covariance.rows() != 2 * n || covariance.cols() != 2 * n || !covariance.allFinite() ||
      !is_symmetric(covariance)) {
    throw std::invalid_argument("the covariance of " + std::to_string(n) + " points is " +
                                std::to_string(covariance.rows()) + " x " +
                                std::to_string(covariance.cols()) +
                                ", expected finite numbers, symmetric, two rows a point");
  }
  const Eigen::LLT<Matrix<kRows, kRows>> factor(covariance);
  if (factor.info() != Eigen::Success) {
    throw std::invalid_argument("the covariance of a rigid fit is not positive definite");
  }
  RigidFit fit;
  fit.dof = static_cast<int>(2 * n - 3);
  const double length = turn.rotation.norm();
  if (!(length > RigidFitTuning::kMinShare * std::sqrt(turn.in_body * turn.in_world))) {
    return fit;
  }
  const double heading = std::atan2(turn.rotation.y(), turn.rotation.x());
  const Vector<2> shift = world_centre - Pose2{0.0, 0.0, heading}.act(body_centre);
  fit.pose = {shift.x(), shift.y(), wrap_angle(heading)};
  fit.status = RigidFitStatus::kNotConverged;
  Matrix<kRows, 3> J(2 * n, 3);
  Vector<kRows> r(2 * n);
  Matrix<3, 3> information;
  for (int step = 0; step < RigidFitTuning::kMaxSteps; ++step) {  // eq. (4.4) to (4.6)
    for (Eigen::Index i = 0; i < n; ++i) {
      const Vector<2> expected = fit.pose.act(body.col(i));
      const Vector<2> arm = expected - fit.pose.position();
      r.template segment<2>(2 * i) = world.col(i) - expected;
      J.template middleRows<2>(2 * i) << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
    }
    factor.matrixL().solveInPlace(r);
    factor.matrixL().solveInPlace(J);
    information.noalias() = J.transpose() * J;
    fit.nis = r.squaredNorm();
    const Vector<3> delta = information.llt().solve(J.transpose() * r);
    if (!delta.allFinite()) {
      break;
    }
    if (delta.squaredNorm() < RigidFitTuning::kConverged * (1.0 + turn.in_world)) {
      const bool is_mirrored = turn.reflection.norm() > (1.0 + RigidFitTuning::kMinShare) * length;
      fit.status = is_mirrored ? RigidFitStatus::kMirrored : RigidFitStatus::kFitted;
      fit.pose = retract(fit.pose, delta);
      break;
    }
    fit.pose = retract(fit.pose, delta);
  }
  const Eigen::LLT<Matrix<3, 3>> of_pose(information);
  const Matrix<3, 3> inverse = of_pose.solve(Matrix<3, 3>::Identity());
  const Matrix<3, 3> of_fit = 0.5 * (inverse + inverse.transpose());
  if (of_pose.info() != Eigen::Success || !is_covariance(of_fit)) {
    fit.status = RigidFitStatus::kNotConverged;  // beyond double precision
    return fit;
  }
  fit.covariance = of_fit;
  return fit;
}

RigidFit rigid_fit(const Matrix<2, Eigen::Dynamic>& body, const Matrix<2, Eigen::Dynamic>& world,
                   const std::vector<Matrix<2, 2>>& covariances) {
  const auto n = static_cast<Eigen::Index>(covariances.size());
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    all.block<2, 2>(2 * i, 2 * i) = covariances[static_cast<std::size_t>(i)];
  }
  return rigid_fit<Eigen::Dynamic>(body, world, all);
}

template RigidFit rigid_fit<3>(const Matrix<2, 3>&, const Matrix<2, 3>&, const Matrix<6, 6>&);
template RigidFit rigid_fit<Eigen::Dynamic>(const Matrix<2, Eigen::Dynamic>&,
                                            const Matrix<2, Eigen::Dynamic>&,
                                            const Matrix<Eigen::Dynamic, Eigen::Dynamic>&);

}  // namespace locfuse
