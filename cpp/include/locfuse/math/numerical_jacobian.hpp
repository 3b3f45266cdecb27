// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/types.hpp"

namespace locfuse {

/// Jacobian of `f` at zero by central differences, to test own models.
///
/// `f` takes an error-state vector (N) and returns a difference of outputs (M), angle rows wrapped:
/// for a measurement `[&](delta) { return residual(x) - residual(retract(x, delta)); }`.
template <int M, int N, class F>
[[nodiscard]] Matrix<M, N> numerical_jacobian(const F& f, double step = 1e-6) {
  Matrix<M, N> jacobian;
  for (int i = 0; i < N; ++i) {
    const Vector<N> delta = step * Vector<N>::Unit(i);
    jacobian.col(i) = (f(delta) - f(-delta)) / (2.0 * step);
  }
  return jacobian;
}

}  // namespace locfuse
