// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/kalman.hpp"

#include <stdexcept>
#include <string>

namespace locfuse {

Outcome internal::update_part(GaussianBelief& belief,
                              const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin, Slots slots,
                              const Gate& gate) {
  const std::vector<int> rows = belief.rows(slots);
  if (static_cast<Eigen::Index>(rows.size()) != lin.jacobian.cols()) {
    throw std::invalid_argument("the Jacobian has " + std::to_string(lin.jacobian.cols()) +
                                " columns, the slots hold " + std::to_string(rows.size()) +
                                " variables");
  }
  const Eigen::MatrixXd PHt = belief.P(Eigen::all, rows) * lin.jacobian.transpose();
  const Eigen::MatrixXd S = lin.jacobian * PHt(rows, Eigen::all) + lin.noise;
  return fuse(belief.x, belief.P, lin, PHt, S, gate, belief.angle_rows(),
              [&](const Eigen::MatrixXd& A) {
                return Eigen::MatrixXd(A(Eigen::all, rows) * lin.jacobian.transpose());
              });
}

void internal::refuse_rows(Eigen::Index residual, Eigen::Index jacobian, Eigen::Index noise,
                           Eigen::Index noise_columns) {
  throw std::invalid_argument(
      "a measurement has a residual of " + std::to_string(residual) + " rows, a Jacobian of " +
      std::to_string(jacobian) + " rows and noise of " + std::to_string(noise) + " x " +
      std::to_string(noise_columns) + ", expected one number of rows, at least 1");
}

void predict(GaussianBelief& belief, const Propagation<Pose2, 3>& step, Slot slot) {
  const Vector<3> moved(step.moved.x, step.moved.y, wrap_angle(step.moved.heading));
  (void)belief.pose(slot);  // throws unless it is one
  const int row = belief.offset(slot);
  const bool whole = belief.dimension() == 3;
  Eigen::Map<Matrix<3, 3>, 0, Eigen::OuterStride<>> P(&belief.P(row, row),
                                                      Eigen::OuterStride<>(belief.dimension()));
  const Matrix<3, 3> FP = step.jacobian * P;
  Matrix<3, 3> P_new = step.noise;
  P_new.noalias() += FP * step.jacobian.transpose();
  if (!std::isfinite(P_new.sum() + moved.sum()) || !(P_new.diagonal().minCoeff() > 0.0)) {
    throw NumericalError("prediction would leave a belief that is not finite and positive");
  }
  if (!whole) {
    const Matrix<3, Eigen::Dynamic> cross = step.jacobian * belief.P.middleRows<3>(row);
    belief.P.middleRows<3>(row) = cross;
    belief.P.middleCols<3>(row) = cross.transpose();
  }
  P = 0.5 * (P_new + P_new.transpose());
  belief.x.segment<3>(row) = moved;
}

}  // namespace locfuse
