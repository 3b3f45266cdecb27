// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace locfuse {

/// The compiler of the library, such as "GCC 12.2.0".
[[nodiscard]] std::string compiler();

/// The kernels in use: "avx2", with fused multiply-add, or "portable". Their results differ in the
/// last bits only.
[[nodiscard]] std::string kernels();

}  // namespace locfuse
