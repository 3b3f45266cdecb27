// SPDX-License-Identifier: Apache-2.0
#include "locfuse/build_info.hpp"

#include "locfuse/math/alignment.hpp"
#include "math/processor.hpp"

namespace locfuse {

template <>
const char internal::EigenOptions::expected = 0;

std::string compiler() {
#if defined(__clang__)
  return "Clang " + std::to_string(__clang_major__) + "." + std::to_string(__clang_minor__) + "." +
         std::to_string(__clang_patchlevel__);
#elif defined(__GNUC__)
  return "GCC " __VERSION__;
#else
  return "unknown";
#endif
}

std::string kernels() { return internal::has_avx2() ? "avx2" : "portable"; }

}  // namespace locfuse
