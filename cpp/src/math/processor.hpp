// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#ifdef LOCFUSE_LANES_AVX2
#include <cpuid.h>
#endif

namespace locfuse::internal {

#ifdef LOCFUSE_LANES_AVX2
/// Whether processor and operating system support AVX2 and FMA. Asked here, as not every compiler's
/// runtime answers __builtin_cpu_supports.
[[nodiscard]] inline bool processor_has_avx2() {
  constexpr unsigned kFma = 1U << 12U;
  constexpr unsigned kXgetbv = 1U << 27U;
  constexpr unsigned kAvx = 1U << 28U;
  constexpr unsigned kAvx2 = 1U << 5U;
  constexpr unsigned kWideRegistersAreKept = 6;
  unsigned a = 0;
  unsigned b = 0;
  unsigned c = 0;
  unsigned d = 0;
  constexpr unsigned kAll = kFma | kXgetbv | kAvx;
  if (__get_cpuid(1, &a, &b, &c, &d) == 0 || (c & kAll) != kAll) {
    return false;
  }
  unsigned kept = 0;
  __asm__("xgetbv" : "=a"(kept), "=d"(d) : "c"(0));
  return (kept & kWideRegistersAreKept) == kWideRegistersAreKept &&
         __get_cpuid_count(7, 0, &a, &b, &c, &d) != 0 && (b & kAvx2) != 0;
}
#endif

/// Whether kernels for AVX2 were compiled and may run on this processor. The environment variable
/// LOCFUSE_PORTABLE disables them, to measure and test the portable ones.
[[nodiscard]] inline bool has_avx2() {
#ifdef LOCFUSE_LANES_AVX2
  static const bool has = std::getenv("LOCFUSE_PORTABLE") == nullptr && processor_has_avx2();
  return has;
#else
  return false;
#endif
}

}  // namespace locfuse::internal
