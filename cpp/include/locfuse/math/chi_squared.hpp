// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace locfuse {

/// Quantile of the chi-square distribution with `dof` degrees of freedom.
/// Infinity at probability 1. Throws std::invalid_argument unless dof is at least 1 and
/// `probability` in [0, 1].
[[nodiscard]] double chi_squared_quantile(int dof, double probability);

}  // namespace locfuse
