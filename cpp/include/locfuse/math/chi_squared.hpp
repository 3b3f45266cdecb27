// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace locfuse {

/// Value that a chi-squared variable with `dof` degrees of freedom stays below with `probability`.
/// Infinity at probability 1. Throws std::invalid_argument unless dof is at least 1 and
/// `probability` in [0, 1].
[[nodiscard]] double chi_squared_quantile(int dof, double probability);

}  // namespace locfuse
