// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace locfuse::internal {

inline constexpr double kMaxLength = 1e12;  // magnitude of coordinates and lengths [m]

}  // namespace locfuse::internal
