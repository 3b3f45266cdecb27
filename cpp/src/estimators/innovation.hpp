// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/LU>
#include <cmath>
#include <type_traits>

#include "locfuse/error.hpp"
#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/math/types.hpp"

/// Innovations of sizes known at run time, compiled once.
namespace locfuse::internal {

/// r' S^-1 r of up to two rows, S = J P J' + R. Throws NumericalError unless S is positive
/// definite.
[[nodiscard]] double nis_of(const Linearization<Eigen::Dynamic, 3, 2>& lin, const Matrix<3, 3>& P);
[[nodiscard]] double nis_of(const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin,
                            const Eigen::MatrixXd& P);

/// Determinant of noise of up to PoseEkf::kMaxJoint rows; allocates nothing.
[[nodiscard]] double determinant_of(const Eigen::Ref<const Eigen::MatrixXd>& noise);

/// How a linearized measurement fits a pose of covariance P.
template <class Lin>
[[nodiscard]] Outcome compare(const Lin& lin, const Matrix<3, 3>& P) {
  using Noise = decltype(Lin::noise);
  const Noise S = lin.jacobian * P * lin.jacobian.transpose() + lin.noise;
  const auto rows = static_cast<int>(lin.residual.size());
  Outcome outcome{Verdict::kFused,
                  Reason::kNone,
                  rows,
                  squared_mahalanobis(lin.residual, S),
                  lin.residual(0),
                  std::pow(S.determinant(), 1.0 / rows)};
  if (!(outcome.nis >= 0.0 && outcome.scale > 0.0 && std::isfinite(outcome.scale))) {
    throw NumericalError("the innovation covariance is not positive definite");
  }
  return outcome;
}

/// How a measurement fits an estimate; dof 0 where the model has no direction.
template <class Model, class Message>
[[nodiscard]] Outcome compare(const Model& model, const PoseEstimate& here, const Message& z) {
  const auto lin = model.linearize(here.pose, z);
  return lin ? compare(*lin, here.covariance) : Outcome{Verdict::kFused};
}

}  // namespace locfuse::internal
