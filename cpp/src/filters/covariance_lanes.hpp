// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

/// The update of a large covariance, four entries at once; compiled twice, as math/lanes.hpp says.
namespace locfuse::internal {

/// A symmetric matrix by columns, and n x M columns without gaps of eq. (1.10) of
/// docs/models/updates.md.
struct OuterUpdate {
  double* P;
  std::ptrdiff_t stride;  ///< of the columns of P
  std::ptrdiff_t size;    ///< n
  const double* Y;
};

/// Functions for one M with the same rounding: one predicts what another writes.
struct OuterKernel {
  /// Whether the diagonal of P+ will be positive.
  bool (*stays_positive)(OuterUpdate);
  /// Puts P+ in the place of P, the upper triangle as a copy of the lower.
  void (*write)(OuterUpdate);
};

namespace portable {
extern const OuterKernel kOuter1;
extern const OuterKernel kOuter2;
}  // namespace portable
#ifdef LOCFUSE_LANES_AVX2
namespace avx2 {
extern const OuterKernel kOuter1;
extern const OuterKernel kOuter2;
}  // namespace avx2
#endif

}  // namespace locfuse::internal
