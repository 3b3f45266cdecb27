// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/types.hpp"

namespace locfuse::internal {

/// Probability that a zero-mean Gaussian position stays within `radius` [m], eq. (7) of
/// docs/health.md.
[[nodiscard]] double probability_within(double radius, const Matrix<2, 2>& covariance);

/// The same of a Gaussian position about `mean`.
[[nodiscard]] double probability_within(double radius, const Vector<2>& mean,
                                        const Matrix<2, 2>& covariance);

/// Probability that a Gaussian of that mean and variance stays within `limit` to either side.
[[nodiscard]] double probability_within(double limit, double mean, double variance);

}  // namespace locfuse::internal
