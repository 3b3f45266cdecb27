// SPDX-License-Identifier: Apache-2.0
#include "locfuse/build_info.hpp"

#include "locfuse/math/alignment.hpp"
#include "math/processor.hpp"

namespace locfuse {

namespace internal {

template <int heap_align_bytes, int max_static_align_bytes, int storage_order,
          bool checked_containers, typename Index>
const char ThisCodeAndLocfuseAreCompiledWithDifferentEigenAlignmentSeeDocsInstall<
    heap_align_bytes, max_static_align_bytes, storage_order, checked_containers, Index>::expected =
    0;

template struct ThisCodeAndLocfuseAreCompiledWithDifferentEigenAlignmentSeeDocsInstall<
    EIGEN_DEFAULT_ALIGN_BYTES, EIGEN_MAX_STATIC_ALIGN_BYTES,
    EIGEN_DEFAULT_MATRIX_STORAGE_ORDER_OPTION, kCheckedContainers, Eigen::Index>;

}  // namespace internal

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
