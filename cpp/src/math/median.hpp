// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace locfuse::internal {

/// Standard deviation of a normal variable over the median of its magnitude.
inline constexpr double kSigmaPerMedian = 1.4826;

}  // namespace locfuse::internal
