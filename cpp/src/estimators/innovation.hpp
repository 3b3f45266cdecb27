// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

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

}  // namespace locfuse::internal
