// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace locfuse::internal {

#ifdef _GLIBCXX_DEBUG
constexpr bool kCheckedContainers = true;
#else
constexpr bool kCheckedContainers = false;
#endif

/// What decides where members of public types lie and who frees their memory. The library defines
/// this for the options that it was compiled with; code with others, such as -march=native, does
/// not link: compile both alike.
template <int heap_align_bytes, int max_static_align_bytes, int storage_order,
          bool checked_containers, typename Index>
struct ThisCodeAndLocfuseAreCompiledWithDifferentEigenAlignmentSeeDocsInstall {
  static const char expected;
};

using EigenOptions = ThisCodeAndLocfuseAreCompiledWithDifferentEigenAlignmentSeeDocsInstall<
    EIGEN_DEFAULT_ALIGN_BYTES, EIGEN_MAX_STATIC_ALIGN_BYTES,
    EIGEN_DEFAULT_MATRIX_STORAGE_ORDER_OPTION, kCheckedContainers, Eigen::Index>;

namespace {
[[gnu::used]] const char* const eigen_options = &EigenOptions::expected;
}  // namespace

}  // namespace locfuse::internal
