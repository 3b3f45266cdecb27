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

/// One entry, or those of one column: p - sum a b.
template <int M, class Value>
inline void shorten(Value& p, const Value (&a)[2], const double* b_column, Index size) {
  p = p - a[0] * b_column[0];
  if constexpr (M == 2) {
    p = p - a[1] * b_column[size];
  }
}

/// What one row, or as many as there are lanes, have of the columns.
template <int M, class Value>
struct Rows {
  Value Y[2];
  Value K[2];
  Value W[2];

  Rows(const JosephUpdate& u, Index row) {
    const Index second = M == 1 ? row : row + u.size;
    load(Y[0], u.Y + row);
    load(Y[1], u.Y + second);
    load(K[0], u.K + row);
    load(K[1], u.K + second);
    load(W[0], u.rest + row);
    load(W[1], u.rest + second);
  }

  /// P+ from P in a column.
  void write(Value& p, const JosephUpdate& u, Index column) const {
    shorten<M>(p, Y, u.Y + column, u.size);
    shorten<M>(p, W, u.K + column, u.size);
    shorten<M>(p, K, u.rest + column, u.size);
  }
};

// By value: what is behind a reference would be read again after every store.
template <int M>
inline void write_one(const JosephUpdate u, Index row, Index column) {
  double p = u.P[row + column * u.stride];
  Rows<M, double>(u, row).write(p, u, column);
  u.P[row + column * u.stride] = p;
  u.P[column + row * u.stride] = p;
}

/// As many rows as columns, and the same across the diagonal.
template <int M>
inline void write_square(const JosephUpdate u, const Rows<M, Lanes> rows, Index row, Index column) {
  double* const below = u.P + row + column * u.stride;
  double* const above = u.P + column + row * u.stride;
  const auto write = [&](Lanes& p, Index i) {
    load(p, below + i * u.stride);
    rows.write(p, u, column + i);
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
inline void write_joseph(const JosephUpdate u) {
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
inline void short_column(const JosephUpdate u, Index column, double* a) {
  const double* const p = u.P + column * u.stride;
  Index row = 0;
  for (; row + kLanes <= u.size; row += kLanes) {
    Lanes value;
    Lanes Y[2];
    load(value, p + row);
    load(Y[0], u.Y + row);
    load(Y[1], u.Y + (M == 1 ? row : row + u.size));
    shorten<M>(value, Y, u.Y + column, u.size);
    store(value, a + row);
  }
  for (; row < u.size; ++row) {
    const double Y[2] = {u.Y[row], u.Y[M == 1 ? row : row + u.size]};
    a[row] = p[row];
    shorten<M>(a[row], Y, u.Y + column, u.size);
  }
}

template <int M>
inline bool stays_positive(const JosephUpdate u) {
  for (Index row = 0; row < u.size; ++row) {
    double p = u.P[row + row * u.stride];
    Rows<M, double>(u, row).write(p, u, row);
    if (!(p > 0.0)) {
      return false;
    }
  }
  return true;
}

}  // namespace

const JosephKernel kJoseph1 = {short_column<1>, stays_positive<1>, write_joseph<1>};
const JosephKernel kJoseph2 = {short_column<2>, stays_positive<2>, write_joseph<2>};

}  // namespace locfuse::internal::LOCFUSE_LANES
