// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace locfuse {

/// The compiler that made the library, such as "GCC 12.2.0".
[[nodiscard]] std::string compiler();

/// Which kernels run here: "avx2", with fused products and sums, or "portable". Both do the same,
/// but for the last bits.
[[nodiscard]] std::string kernels();

}  // namespace locfuse
