// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

namespace locfuse::internal {

/// Whether what was compiled for AVX2, if anything was, may run here. It may not if the environment
/// has LOCFUSE_PORTABLE, which is for measuring and testing what runs on other processors.
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
