// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/types.hpp"

namespace locfuse {

/// Weight of A in the covariance intersection of A and B (Julier and Uhlmann, 1997): of all
/// (w A^-1 + (1 - w) B^-1)^-1, which bound the covariance of the fused mean however the two errors
/// are correlated, that of the smallest determinant; eq. (2) of
/// docs/models/covariance_intersection.md. From 0.001 to 0.999, so that neither is divided by 0.
/// Throws NumericalError unless both are positive definite.
[[nodiscard]] double intersection_weight(const Matrix<3, 3>& A, const Matrix<3, 3>& B);

}  // namespace locfuse
