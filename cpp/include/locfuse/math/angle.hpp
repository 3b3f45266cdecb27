// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace locfuse {

inline constexpr double kPi = 3.14159265358979323846;

/// Angle wrapped to [-pi, pi) [rad]. NaN and infinity give NaN.
[[nodiscard]] inline double wrap_angle(double angle) {
  if (angle >= -kPi && angle < kPi) {
    return angle;
  }
  const double wrapped = std::remainder(angle, 2.0 * kPi);  // [-pi, pi]
  return wrapped >= kPi ? -kPi : wrapped;
}

/// Shortest turn from `from` to `to`, in [-pi, pi) [rad].
[[nodiscard]] inline double angle_difference(double to, double from) {
  return wrap_angle(to - from);
}

}  // namespace locfuse
