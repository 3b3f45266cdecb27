// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

/// The update of a large covariance, four entries at once. The file is compiled twice, as that of
/// math/lanes.hpp; both versions give the same bits, for neither fuses products with sums.
namespace locfuse::internal {

/// A symmetric matrix by columns, and n x M columns without gaps of eq. (10) of
/// docs/models/kalman.md.
struct JosephUpdate {
  double* P;
  std::ptrdiff_t stride;  ///< of the columns of P
  std::ptrdiff_t size;    ///< n
  const double* K;
  const double* PHt;
  const double* rest;
};

/// Writes P+ in place, what is above the diagonal as a copy of what is below.
using WriteJoseph = void (*)(const JosephUpdate&);

namespace portable {
void write_joseph_1(const JosephUpdate& update);
void write_joseph_2(const JosephUpdate& update);
}  // namespace portable
#ifdef LOCFUSE_LANES_AVX2
namespace avx2 {
void write_joseph_1(const JosephUpdate& update);
void write_joseph_2(const JosephUpdate& update);
}  // namespace avx2
#endif

}  // namespace locfuse::internal
