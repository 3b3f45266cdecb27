// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/kalman.hpp"

#include <stdexcept>
#include <string>

namespace locfuse {

void internal::check_columns(const GaussianBelief& belief, Slots slots, Eigen::Index columns) {
  Eigen::Index size = 0;
  for (const Slot slot : slots) {
    size += dimension_of(belief.kind(slot));
  }
  if (size != columns) {
    throw std::invalid_argument("the Jacobian has " + std::to_string(columns) +
                                " columns, the slots hold " + std::to_string(size) + " variables");
  }
}

void internal::refuse_rows(Eigen::Index residual, Eigen::Index jacobian, Eigen::Index noise,
                           Eigen::Index noise_columns) {
  throw std::invalid_argument("a measurement has a residual of " + std::to_string(residual) +
                              " rows, a Jacobian of " + std::to_string(jacobian) +
                              " rows and noise of " + std::to_string(noise) + " x " +
                              std::to_string(noise_columns) +
                              ", expected one number of rows, at least 1");
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
  if (!std::isfinite(P_new.sum() + moved.sum())) {
    throw NumericalError("prediction is not finite");
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
