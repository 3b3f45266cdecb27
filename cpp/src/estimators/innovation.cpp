// SPDX-License-Identifier: Apache-2.0
#include "estimators/innovation.hpp"

#include <Eigen/LU>

#include "locfuse/estimators/pose_ekf.hpp"

namespace locfuse::internal {
namespace {

template <class Lin>
double nis(const Lin& lin, const Matrix<Lin::kVariables, Lin::kVariables>& P) {
  using Noise = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 2, 2>;
  const Noise S = lin.jacobian * P * lin.jacobian.transpose() + lin.noise;
  return squared_mahalanobis(lin.residual, S);
}

}  // namespace

double nis_of(const Linearization<Eigen::Dynamic, 3, 2>& lin, const Matrix<3, 3>& P) {
  return nis(lin, P);
}

double nis_of(const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin, const Eigen::MatrixXd& P) {
  return nis(lin, P);
}

double determinant_of(const Eigen::Ref<const Eigen::MatrixXd>& noise) {
  constexpr int kMaxRows = PoseEkf::kMaxJoint;
  return Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxRows, kMaxRows>(
             noise)
      .determinant();
}

}  // namespace locfuse::internal
