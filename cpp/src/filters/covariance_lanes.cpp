// SPDX-License-Identifier: Apache-2.0
#include "filters/covariance_lanes.hpp"

#ifndef LOCFUSE_LANES
#define LOCFUSE_LANES portable
#endif

namespace locfuse::internal::LOCFUSE_LANES {

namespace {

using Index = std::ptrdiff_t;
using Four = double __attribute__((vector_size(4 * sizeof(double))));

constexpr Index kHigh = 4;  // rows of a tile
constexpr Index kWide = 8;  // columns: one line of cache, transposed

inline void load(Four& four, const double* from) { __builtin_memcpy(&four, from, sizeof four); }

inline void store(const Four& four, double* to) { __builtin_memcpy(to, &four, sizeof four); }

/// One entry, or four of a column, to (p - sum K C) - sum W K.
template <int M, class Value>
inline void change(Value& p, const Value (&K)[2], const Value (&W)[2], const double* C_column,
                   const double* K_column, Index size) {
  if constexpr (M == 1) {
    p = (p - K[0] * C_column[0]) - W[0] * K_column[0];
  } else {
    p = (p - (K[0] * C_column[0] + K[1] * C_column[size])) -
        (W[0] * K_column[0] + W[1] * K_column[size]);
  }
}

template <int M>
inline void write_one(const JosephUpdate& u, Index row, Index column) {
  const Index second = M == 1 ? row : row + u.size;
  const double K[2] = {u.K[row], u.K[second]};
  const double W[2] = {u.rest[row], u.rest[second]};
  double& p = u.P[row + column * u.stride];
  change<M, double>(p, K, W, u.PHt + column, u.K + column, u.size);
  u.P[column + row * u.stride] = p;
}

/// Four rows of four columns, and the same across the diagonal.
template <int M>
inline void write_square(const JosephUpdate& u, const Four (&K)[2], const Four (&W)[2], Index row,
                         Index column) {
  double* const below = u.P + row + column * u.stride;
  double* const above = u.P + column + row * u.stride;
  Four a;
  Four b;
  Four c;
  Four d;
  const auto write = [&](Four& p, Index i) {
    load(p, below + i * u.stride);
    change<M, Four>(p, K, W, u.PHt + column + i, u.K + column + i, u.size);
    store(p, below + i * u.stride);
  };
  write(a, 0);
  write(b, 1);
  write(c, 2);
  write(d, 3);
  const Four ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6);
  const Four ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Four cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6);
  const Four cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  store(__builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5), above);
  store(__builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5), above + u.stride);
  store(__builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7), above + 2 * u.stride);
  store(__builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7), above + 3 * u.stride);
}

template <int M>
inline void write_joseph(const JosephUpdate& u) {
  for (Index column = 0; column < u.size; column += kWide) {
    const Index end = column + kWide < u.size ? column + kWide : u.size;
    for (Index c = column; c < end; ++c) {  // the tile on the diagonal
      for (Index row = c; row < end; ++row) {
        write_one<M>(u, row, c);
      }
    }
    Index row = end;
    for (; row + kHigh <= u.size; row += kHigh) {
      const Index second = M == 1 ? row : row + u.size;
      Four K[2];
      Four W[2];
      load(K[0], u.K + row);
      load(K[1], u.K + second);
      load(W[0], u.rest + row);
      load(W[1], u.rest + second);
      write_square<M>(u, K, W, row, column);
      write_square<M>(u, K, W, row, column + kHigh);
    }
    for (; row < u.size; ++row) {
      for (Index c = column; c < end; ++c) {
        write_one<M>(u, row, c);
      }
    }
  }
}

}  // namespace

void write_joseph_1(const JosephUpdate& update) { write_joseph<1>(update); }
void write_joseph_2(const JosephUpdate& update) { write_joseph<2>(update); }

}  // namespace locfuse::internal::LOCFUSE_LANES
