// SPDX-License-Identifier: Apache-2.0
#include "frontends/range_lanes.hpp"

// Compiled twice; LOCFUSE_LANES names the namespace and thereby what the compiler may use.
#ifndef LOCFUSE_LANES
#define LOCFUSE_LANES portable
#endif

namespace locfuse::internal {

namespace {

#ifdef __AVX2__
constexpr int kLanes = 4;
#else
constexpr int kLanes = 2;
#endif

/// Constants of the solver in lanes; epochs that it does not finish are left to the scalar code.
struct RangeLanesTuning {
  static constexpr int kSecularSteps = 3;
  static constexpr int kNewtonSteps = 3;
  /// Decrease of the cost below which the fit has converged, as in range_fit.cpp.
  static constexpr double kConvergedDecrease = 1e-8;
  /// Minimum pivot of the information beside its diagonal.
  static constexpr double kMinPivot = 1e-9;
  /// Storage for the ranges of an epoch, as kMaxRanges of range_layout.hpp.
  static constexpr int kCapacity = 64;
};

using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

inline void square_root(const Lanes& x, Lanes& root) {
  for (int l = 0; l < kLanes; ++l) {
    root[l] = __builtin_sqrt(x[l]);
  }
}

/// Lower triangle of a symmetric matrix.
constexpr int at(int row, int column) { return row * (row + 1) / 2 + column; }

/// Inverse of a symmetric A = L D L', with a positive diagonal if `min_pivot` is positive: the
/// smallest entry of D as a share of that of A.
template <int N>
inline void invert_positive(const Lanes (&A)[6], Lanes (&inverse)[6], Lanes& min_pivot) {
  const Lanes d0 = 1.0 / A[0];
  const Lanes l10 = A[1] * d0;
  const Lanes pivot1 = A[2] - l10 * A[1];
  const Lanes d1 = 1.0 / pivot1;
  min_pivot = pivot1 / A[2];
  if constexpr (N == 2) {
    inverse[0] = d0 + l10 * l10 * d1;
    inverse[1] = -l10 * d1;
    inverse[2] = d1;
  } else {
    const Lanes rest = A[4] - A[3] * l10;
    const Lanes l20 = A[3] * d0;
    const Lanes l21 = rest * d1;
    const Lanes pivot2 = A[5] - l20 * A[3] - l21 * rest;
    const Lanes d2 = 1.0 / pivot2;
    const Lanes share2 = pivot2 / A[5];
    min_pivot = share2 < min_pivot ? share2 : min_pivot;
    const Lanes m20 = l21 * l10 - l20;  // of L^-1
    inverse[0] = d0 + l10 * l10 * d1 + m20 * m20 * d2;
    inverse[1] = -l10 * d1 - m20 * l21 * d2;
    inverse[2] = d1 + l21 * l21 * d2;
    inverse[3] = m20 * d2;
    inverse[4] = -l21 * d2;
    inverse[5] = d2;
  }
}

/// inverse = A^-1 and the determinant of the symmetric A.
template <int N>
inline void invert(const Lanes (&A)[6], Lanes (&inverse)[6], Lanes& determinant) {
  if constexpr (N == 2) {
    determinant = A[0] * A[2] - A[1] * A[1];
    const Lanes share = 1.0 / determinant;
    inverse[0] = A[2] * share;
    inverse[1] = -A[1] * share;
    inverse[2] = A[0] * share;
  } else {
    const Lanes c0 = A[2] * A[5] - A[4] * A[4];
    const Lanes c1 = A[3] * A[4] - A[1] * A[5];
    const Lanes c2 = A[1] * A[4] - A[3] * A[2];
    determinant = A[0] * c0 + A[1] * c1 + A[3] * c2;
    const Lanes share = 1.0 / determinant;
    inverse[0] = c0 * share;
    inverse[1] = c1 * share;
    inverse[2] = (A[0] * A[5] - A[3] * A[3]) * share;
    inverse[3] = c2 * share;
    inverse[4] = (A[1] * A[3] - A[0] * A[4]) * share;
    inverse[5] = (A[0] * A[2] - A[1] * A[1]) * share;
  }
}

/// SR-LS, eq. (2.7) and (2.8) of docs/models/ranges.md; not exact, as it is only a start.
/// `inside` is positive where the root is in the interval of eq. (2.9): beyond it lies the wrong
/// side.
template <int N>
inline void start(const LaneLayout& layout, const Lanes* range, Lanes (&x)[3], Lanes& inside) {
  Lanes moment[3] = {};
  Lanes sum = {};
  for (int i = 0; i < layout.size; ++i) {
    double reach = layout.height_squared[i];
    for (int k = 0; k < N; ++k) {
      reach += layout.anchor[k][i] * layout.anchor[k][i];
    }
    const Lanes b = range[i] * range[i] - reach;
    sum += b;
    for (int k = 0; k < N; ++k) {
      moment[k] += b * layout.anchor[k][i];
    }
  }
  Lanes g[3] = {};
  for (int k = 0; k < N; ++k) {
    for (int l = 0; l < N; ++l) {
      g[k] -= 2.0 * layout.axes[l][k] * moment[l];
    }
  }
  const double slope = 0.5 / layout.size;
  const Lanes level = sum / static_cast<double>(layout.size);
  Lanes alpha = {};
  Lanes y[3] = {};
  for (int step = 0; step <= RangeLanesTuning::kSecularSteps; ++step) {
    Lanes gap = -level - slope * alpha;
    Lanes fall = {};
    for (int k = 0; k < N; ++k) {
      const Lanes inverse = 1.0 / (layout.stiffness[k] + alpha);
      y[k] = g[k] * inverse;
      gap += y[k] * y[k];
      fall += y[k] * y[k] * inverse;
    }
    alpha += gap / (2.0 * fall + slope);
  }
  inside = layout.stiffness[0] + alpha;
  for (int k = 0; k < N; ++k) {
    x[k] = Lanes{};
    for (int l = 0; l < N; ++l) {
      x[k] += layout.axes[k][l] * y[l];
    }
  }
}

/// One Newton step, eq. (2.16). `decrease` is that of the cost; `positive` is positive in
/// lanes where the Hessian is positive definite.
template <int N>
inline void newton(const LaneLayout& layout, const Lanes* range, Lanes (&x)[3],
                   Lanes (&jacobian)[6], Lanes& cost, Lanes& decrease, Lanes& positive) {
  Lanes gradient[3] = {};
  Lanes hessian[6] = {};
  Lanes isotropic = {};
  cost = Lanes{};
  for (int k = 0; k < 6; ++k) {
    jacobian[k] = Lanes{};
  }
  for (int i = 0; i < layout.size; ++i) {
    Lanes d[3];
    Lanes squared = Lanes{} + layout.height_squared[i];
    for (int k = 0; k < N; ++k) {
      d[k] = x[k] - layout.anchor[k][i];
      squared += d[k] * d[k];
    }
    Lanes h;
    square_root(squared, h);
    const Lanes inverse = 1.0 / h;
    const Lanes error = h - range[i];
    const Lanes weighted = layout.information[i] * error;
    const Lanes curl = weighted * inverse;
    cost += weighted * error;
    isotropic += curl;
    for (int k = 0; k < N; ++k) {
      const Lanes u = d[k] * inverse;
      gradient[k] += weighted * u;
      for (int l = 0; l <= k; ++l) {
        const Lanes uu = u * (d[l] * inverse);
        jacobian[at(k, l)] += layout.information[i] * uu;
        hessian[at(k, l)] -= curl * uu;
      }
    }
  }
  for (int k = 0; k < N; ++k) {
    for (int l = 0; l <= k; ++l) {
      hessian[at(k, l)] += jacobian[at(k, l)];
    }
    hessian[at(k, k)] += isotropic;
  }
  Lanes inverse[6] = {};
  Lanes determinant;
  invert<N>(hessian, inverse, determinant);
  decrease = Lanes{};
  for (int k = 0; k < N; ++k) {
    Lanes step = {};
    for (int l = 0; l < N; ++l) {
      step += inverse[l <= k ? at(k, l) : at(l, k)] * gradient[l];
    }
    decrease += step * gradient[k];
    x[k] -= step;
  }
  // Positive definite if all leading minors are.
  positive = hessian[0] > 0.0 ? determinant : -1.0 + 0.0 * determinant;
  if constexpr (N == 3) {
    positive = hessian[0] * hessian[2] > hessian[1] * hessian[1] ? positive : -1.0 + 0.0 * positive;
  }
}

template <int N>
void solve(const LaneLayout& layout, const double* ranges, LaneResult& result) {
  Lanes range[RangeLanesTuning::kCapacity];
  Lanes shortest = Lanes{} + 1.0;
  for (int i = 0; i < layout.size; ++i) {
    for (int l = 0; l < kLanes; ++l) {
      range[i][l] = ranges[l * layout.size + i];
    }
    shortest = range[i] < shortest ? range[i] : shortest;
  }
  Lanes x[3];
  Lanes inside;
  start<N>(layout, range, x, inside);
  Lanes jacobian[6];
  Lanes cost;
  Lanes decrease;
  Lanes positive;
  for (int step = 0; step < RangeLanesTuning::kNewtonSteps; ++step) {
    newton<N>(layout, range, x, jacobian, cost, decrease, positive);
  }
  Lanes covariance[6] = {};
  Lanes pivot;
  invert_positive<N>(jacobian, covariance, pivot);
  for (int l = 0; l < kLanes; ++l) {
    // False where a number is NaN, too.
    result.solved[l] = shortest[l] > 0.0 && inside[l] > 0.0 && positive[l] > 0.0 &&
                       decrease[l] >= 0.0 && decrease[l] <= RangeLanesTuning::kConvergedDecrease &&
                       cost[l] < layout.strong_below && pivot[l] > RangeLanesTuning::kMinPivot;
    result.cost[l] = cost[l] > decrease[l] ? cost[l] - decrease[l] : 0.0;
    for (int k = 0; k < N; ++k) {
      result.position[k][l] = x[k][l];
    }
    for (int k = 0; k < N * (N + 1) / 2; ++k) {
      result.covariance[k][l] = covariance[k][l];
    }
  }
}

}  // namespace

LaneSolver LOCFUSE_LANES::range_lanes() { return {kLanes, solve<2>, solve<3>}; }

}  // namespace locfuse::internal
