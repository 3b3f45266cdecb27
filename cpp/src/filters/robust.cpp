// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/robust.hpp"

#include <stdexcept>
#include <string>
#include <vector>

namespace locfuse {
namespace {

template <int M>
Outcome update_robust_rows(GaussianBelief& belief,
                           const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin, Slots slots,
                           const Gate& gate, const NoiseShape& shape) {
  const std::vector<int> rows = belief.rows(slots);
  internal::check_columns(rows.size(), lin.jacobian.cols());
  const Eigen::Matrix<double, Eigen::Dynamic, M> PHt =
      belief.P(Eigen::all, rows) * lin.jacobian.transpose();
  const Eigen::Matrix<double, M, M> C = lin.jacobian * PHt(rows, Eigen::all);
  return internal::fuse_moment_matched(belief, lin, slots, gate, shape, PHt, C);
}

}  // namespace

Outcome internal::update_robust_part(GaussianBelief& belief,
                                     const Linearization<Eigen::Dynamic, Eigen::Dynamic>& lin,
                                     Slots slots, const Gate& gate, const NoiseShape& shape) {
  return lin.residual.size() == 1
             ? update_robust_rows<1>(belief, lin, slots, gate, shape)
             : update_robust_rows<Eigen::Dynamic>(belief, lin, slots, gate, shape);
}

void internal::check_sides(const NoiseShape& shape, Eigen::Index rows) {
  if (shape.is_one_sided() && rows != 1) {
    throw std::invalid_argument(
        "a measurement of " + std::to_string(rows) +
        " rows has no long side: one-sided noise is of one row, as a range");
  }
}

}  // namespace locfuse
