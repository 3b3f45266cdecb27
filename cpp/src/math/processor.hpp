// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

namespace locfuse::internal {

/// Whether kernels for AVX2 were compiled and may run on this processor. The environment variable
/// LOCFUSE_PORTABLE disables them, to measure and test the portable ones.
[[nodiscard]] inline bool has_avx2() {
#ifdef LOCFUSE_LANES_AVX2
  static const bool has = std::getenv("LOCFUSE_PORTABLE") == nullptr &&
                          __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return has;
#else
  return false;
#endif
}

}  // namespace locfuse::internal
