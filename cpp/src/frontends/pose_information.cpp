// SPDX-License-Identifier: Apache-2.0
#include "frontends/pose_information.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "locfuse/math/symmetric.hpp"

namespace locfuse::internal {
namespace {

using Solver3 = Eigen::SelfAdjointEigenSolver<Matrix<3, 3>>;

/// Constants of the information of a scan; docs/models/scans.md eq. (1.7).
struct PoseInformationTuning {
  /// Information of a weak direction as a share of the largest: twice the square of 0.11 rad, by
  /// which lines of a straight wall turn as its cells are rounded, and lines through a few noisy
  /// end points.
  static constexpr double kWeakShare = 0.024;
  /// Eigenvalue of a direction without information as a share of the largest: rounding.
  static constexpr double kMinEigenvalueShare = 1e-9;
  /// Minimum of an information that scales a matrix.
  static constexpr double kMinScaleInformation = 1e-12;
  /// Maximum information; products of larger ones overflow.
  static constexpr double kMaxInformation = 1e200;
};

/// Smallest solution of A x = b where A may leave directions open, at which b is zero.
Vector<3> solve(const Matrix<3, 3>& A, const Vector<3>& b, bool open) {
  if (!open) {
    return A.llt().solve(b);
  }
  const Solver3 eigen(A);
  Vector<3> x = eigen.eigenvectors().transpose() * b;
  for (int i = 0; i < 3; ++i) {
    const double lambda = eigen.eigenvalues()(i);
    x(i) = lambda > PoseInformationTuning::kMinEigenvalueShare * eigen.eigenvalues()(2)
               ? x(i) / lambda
               : 0.0;
  }
  return eigen.eigenvectors() * x;
}

}  // namespace

Observed observed(const Matrix<3, 3>& information, const Vector<3>& gradient, double range) {
  Observed left{information, gradient, {1.0, 1.0, 1.0 / range}, {}};
  const Matrix<3, 3> scaled =
      left.per_scale.asDiagonal() * information * left.per_scale.asDiagonal();
  // The product of the larger two eigenvalues is at most a quarter of the squared trace.
  const double trace = scaled.trace();
  if (4.0 * scaled.determinant() > PoseInformationTuning::kWeakShare * trace * trace * trace) {
    return left;
  }
  const Solver3 eigen(scaled);
  for (int i = 0;
       i < 2 && eigen.eigenvalues()(i) < PoseInformationTuning::kWeakShare * eigen.eigenvalues()(2);
       ++i) {
    const Vector<3> v = eigen.eigenvectors().col(i);
    const Vector<3> row = v.cwiseQuotient(left.per_scale);
    left.information -= eigen.eigenvalues()(i) * row * row.transpose();
    left.gradient -= row * v.dot(left.per_scale.cwiseProduct(left.gradient));
    if (!left.weak) {
      left.weak = v.cwiseProduct(left.per_scale);
    }
  }
  return left;
}

Vector<3> newton_step(const Observed& scan, const Prior& prior, const Pose2& pose) {
  const Matrix<3, 3> information = scan.information + prior.information;
  const Vector<3> gradient = scan.gradient + prior.information * local(pose, prior.mean);
  const Matrix<3, 3> scaled =
      scan.per_scale.asDiagonal() * information * scan.per_scale.asDiagonal();
  return -solve(scaled, scan.per_scale.cwiseProduct(gradient), scan.weak.has_value());
}

std::optional<Matrix<3, 3>> covariance_of(const Matrix<3, 3>& information) {
  const double place = 1.0 / std::sqrt(std::max(information(0, 0) + information(1, 1),
                                                PoseInformationTuning::kMinScaleInformation));
  const double turn =
      1.0 / std::sqrt(std::max(information(2, 2), PoseInformationTuning::kMinScaleInformation));
  const Vector<3> scale(place, place, turn);
  const Matrix<3, 3> unit = scale.asDiagonal() * information * scale.asDiagonal();
  const Solver3 eigen(unit);
  if (eigen.eigenvalues()(0) <= PoseInformationTuning::kMinEigenvalueShare) {
    return {};
  }
  const Vector<3> inverse = eigen.eigenvalues().cwiseInverse();
  const Matrix<3, 3> P = scale.asDiagonal() * eigen.eigenvectors() * inverse.asDiagonal() *
                         eigen.eigenvectors().transpose() * scale.asDiagonal();
  return 0.5 * (P + P.transpose());
}

void require_covariance(const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  const bool symmetric = is_symmetric(covariance);
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  const auto refuse = [&](const char* what) {
    std::ostringstream text;
    text << "covariance " << what << ":\n" << covariance;
    throw std::invalid_argument(text.str());
  };
  if (!covariance.allFinite() || !symmetric || factor.info() != Eigen::Success) {
    refuse("is not a symmetric positive definite matrix");
  }
  const Eigen::MatrixXd information =
      factor.solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
  if (!information.allFinite() ||
      information.cwiseAbs().maxCoeff() > PoseInformationTuning::kMaxInformation) {
    refuse("is too small for its inverse to be finite");
  }
}

}  // namespace locfuse::internal
