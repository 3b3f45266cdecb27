// SPDX-License-Identifier: Apache-2.0
#include "filters/covariance_lanes.hpp"

#ifndef LOCFUSE_LANES
#define LOCFUSE_LANES portable
#endif

namespace locfuse::internal::LOCFUSE_LANES {

namespace {

using Index = std::ptrdiff_t;

#ifdef __AVX2__
constexpr Index kLanes = 4;
#else
constexpr Index kLanes = 2;
#endif
constexpr Index kWide = 2 * kLanes;  // columns that are written together

using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

inline void load(Lanes& lanes, const double* from) { __builtin_memcpy(&lanes, from, sizeof lanes); }
inline void load(double& one, const double* from) { one = *from; }

inline void store(const Lanes& lanes, double* to) { __builtin_memcpy(to, &lanes, sizeof lanes); }

/// What one row, or as many as there are lanes, have of the columns of Y.
template <int M, class Value>
struct Rows {
  Value Y[2];

  Rows(const OuterUpdate& u, Index row) {
    load(Y[0], u.Y + row);
    load(Y[1], u.Y + (M == 1 ? row : row + u.size));
  }

  /// P+ from P in a column.
  void shorten(Value& p, const OuterUpdate& u, Index column) const {
    p = p - Y[0] * u.Y[column];
    if constexpr (M == 2) {
      p = p - Y[1] * u.Y[column + u.size];
    }
  }
};

// By value: what is behind a reference would be read again after every store.
template <int M>
inline void write_one(const OuterUpdate u, Index row, Index column) {
  double p = u.P[row + column * u.stride];
  Rows<M, double>(u, row).shorten(p, u, column);
  u.P[row + column * u.stride] = p;
  u.P[column + row * u.stride] = p;
}

/// As many rows as columns, and the same across the diagonal.
template <int M>
inline void write_square(const OuterUpdate u, const Rows<M, Lanes> rows, Index row, Index column) {
  double* const below = u.P + row + column * u.stride;
  double* const above = u.P + column + row * u.stride;
  const auto write = [&](Lanes& p, Index i) {
    load(p, below + i * u.stride);
    rows.shorten(p, u, column + i);
    store(p, below + i * u.stride);
  };
  Lanes a;
  Lanes b;
  write(a, 0);
  write(b, 1);
#ifdef __AVX2__
  Lanes c;
  Lanes d;
  write(c, 2);
  write(d, 3);
  const Lanes ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6);
  const Lanes ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Lanes cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6);
  const Lanes cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  store(__builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5), above);
  store(__builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5), above + u.stride);
  store(__builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7), above + 2 * u.stride);
  store(__builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7), above + 3 * u.stride);
#else
  store(__builtin_shufflevector(a, b, 0, 2), above);
  store(__builtin_shufflevector(a, b, 1, 3), above + u.stride);
#endif
}

template <int M>
inline void write_outer(const OuterUpdate u) {
  for (Index column = 0; column < u.size; column += kWide) {
    const Index end = column + kWide < u.size ? column + kWide : u.size;
    for (Index c = column; c < end; ++c) {  // the tile on the diagonal
      for (Index row = c; row < end; ++row) {
        write_one<M>(u, row, c);
      }
    }
    Index row = end;
    for (; row + kLanes <= u.size; row += kLanes) {
      const Rows<M, Lanes> rows(u, row);
      write_square<M>(u, rows, row, column);
      write_square<M>(u, rows, row, column + kLanes);
    }
    for (; row < u.size; ++row) {
      for (Index c = column; c < end; ++c) {
        write_one<M>(u, row, c);
      }
    }
  }
}

template <int M>
inline bool stays_positive(const OuterUpdate u) {
  for (Index row = 0; row < u.size; ++row) {
    double p = u.P[row + row * u.stride];
    Rows<M, double>(u, row).shorten(p, u, row);
    if (!(p > 0.0)) {
      return false;
    }
  }
  return true;
}

}  // namespace

const OuterKernel kOuter1 = {stays_positive<1>, write_outer<1>};
const OuterKernel kOuter2 = {stays_positive<2>, write_outer<2>};

}  // namespace locfuse::internal::LOCFUSE_LANES
