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

inline void store(const Lanes& lanes, double* to) { __builtin_memcpy(to, &lanes, sizeof lanes); }

/// One entry of A, or those of one column: p - sum K C.
template <int M, class Value>
inline void shorten(Value& p, const Value (&K)[2], const double* C_column, Index size) {
  p = p - K[0] * C_column[0];
  if constexpr (M == 2) {
    p = p - K[1] * C_column[size];
  }
}

// By value: what is behind a reference would be read again after every store.
template <int M>
inline void write_one(const JosephUpdate u, Index row, Index column) {
  const Index second = M == 1 ? row : row + u.size;
  const double K[2] = {u.K[row], u.K[second]};
  const double W[2] = {u.rest[row], u.rest[second]};
  double& p = u.P[row + column * u.stride];
  shorten<M, double>(p, K, u.PHt + column, u.size);
  shorten<M, double>(p, W, u.K + column, u.size);
  u.P[column + row * u.stride] = p;
}

/// As many rows as columns, and the same across the diagonal.
template <int M>
inline void write_square(const JosephUpdate u, const Lanes (&K)[2], const Lanes (&W)[2], Index row,
                         Index column) {
  double* const below = u.P + row + column * u.stride;
  double* const above = u.P + column + row * u.stride;
  const auto write = [&](Lanes& p, Index i) {
    load(p, below + i * u.stride);
    shorten<M, Lanes>(p, K, u.PHt + column + i, u.size);
    shorten<M, Lanes>(p, W, u.K + column + i, u.size);
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
      const Index second = M == 1 ? row : row + u.size;
      Lanes K[2];
      Lanes W[2];
      load(K[0], u.K + row);
      load(K[1], u.K + second);
      load(W[0], u.rest + row);
      load(W[1], u.rest + second);
      write_square<M>(u, K, W, row, column);
      write_square<M>(u, K, W, row, column + kLanes);
    }
    for (; row < u.size; ++row) {
      for (Index c = column; c < end; ++c) {
        write_one<M>(u, row, c);
      }
    }
  }
}

/// Rows `begin` to `end` of a column of A, by columns of one factor and a row of the other.
template <int M>
inline void shorten_rows(const double* columns, const double* row, const JosephUpdate u,
                         const double* p, Index begin, Index end, double* a) {
  Index i = begin;
  for (; i + kLanes <= end; i += kLanes) {
    Lanes value;
    Lanes factor[2];
    load(value, p + i);
    load(factor[0], columns + i);
    load(factor[1], columns + (M == 1 ? i : i + u.size));
    shorten<M, Lanes>(value, factor, row, u.size);
    store(value, a + i);
  }
  for (; i < end; ++i) {
    const double factor[2] = {columns[i], columns[M == 1 ? i : i + u.size]};
    a[i] = p[i];
    shorten<M, double>(a[i], factor, row, u.size);
  }
}

template <int M>
inline void short_column(const JosephUpdate u, Index column, double* a) {
  // An entry below the diagonal stands for that above it.
  const double* const p = u.P + column * u.stride;
  shorten_rows<M>(u.PHt, u.K + column, u, p, 0, column, a);
  shorten_rows<M>(u.K, u.PHt + column, u, p, column, u.size, a);
}

template <int M>
inline bool stays_positive(const JosephUpdate u) {
  for (Index row = 0; row < u.size; ++row) {
    const Index second = M == 1 ? row : row + u.size;
    const double K[2] = {u.K[row], u.K[second]};
    const double W[2] = {u.rest[row], u.rest[second]};
    double p = u.P[row + row * u.stride];
    shorten<M, double>(p, K, u.PHt + row, u.size);
    shorten<M, double>(p, W, u.K + row, u.size);
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
