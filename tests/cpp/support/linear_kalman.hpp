// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/LU>
#include <cmath>

#include "locfuse/filters/belief.hpp"
#include "locfuse/math/linearization.hpp"

namespace locfuse::testing {

using MatrixXl = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using VectorXl = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

/// Textbook Kalman update, in long double and with inverses.
struct LinearKalman {
  Eigen::VectorXd x;
  Eigen::MatrixXd P;
  double nis;
  double log_likelihood;
};

[[nodiscard]] inline LinearKalman linear_kalman(const Eigen::VectorXd& x, const Eigen::MatrixXd& P,
                                                const Eigen::VectorXd& r, const Eigen::MatrixXd& H,
                                                const Eigen::MatrixXd& R) {
  const MatrixXl Pl = P.cast<long double>();
  const MatrixXl Hl = H.cast<long double>();
  const VectorXl rl = r.cast<long double>();
  const MatrixXl S = Hl * Pl * Hl.transpose() + R.cast<long double>();
  const MatrixXl S_inverse = S.inverse();
  const MatrixXl K = Pl * Hl.transpose() * S_inverse;
  const VectorXl x_new = x.cast<long double>() + K * rl;
  const MatrixXl P_new = Pl - K * S * K.transpose();
  const long double nis = rl.dot(S_inverse * rl);
  const long double two_pi = 2.0L * 3.14159265358979323846264338327950288L;
  const long double log_det =
      std::log(S.determinant()) + static_cast<long double>(r.size()) * std::log(two_pi);
  return {x_new.cast<double>(), P_new.cast<double>(), static_cast<double>(nis),
          static_cast<double>(-0.5L * (nis + log_det))};
}

/// A local Jacobian with its columns at the places of its variables in the whole belief.
[[nodiscard]] inline Eigen::MatrixXd spread(const Eigen::MatrixXd& H, const std::vector<int>& rows,
                                            Eigen::Index dimension) {
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(H.rows(), dimension);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    whole.col(rows[i]) += H.col(static_cast<Eigen::Index>(i));
  }
  return whole;
}

}  // namespace locfuse::testing
