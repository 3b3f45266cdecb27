// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "locfuse/math/types.hpp"

namespace locfuse {

/// The matrix [v]x whose product with w is the cross product of v and w.
[[nodiscard]] Matrix<3, 3> cross_matrix(const Vector<3>& v);

/// The rotation by |v| about v [rad]: Rodrigues' formula.
[[nodiscard]] Matrix<3, 3> rotation_by(const Vector<3>& v);

/// The inverse of `rotation_by`, of length at most pi [rad].
[[nodiscard]] Vector<3> rotation_vector(const Matrix<3, 3>& rotation);

/// The nearest rotation to a matrix that rounding has moved off one.
[[nodiscard]] Matrix<3, 3> orthonormal(const Matrix<3, 3>& rotation);

/// The rotation by roll about x, then by pitch about y, then by yaw about z [rad].
[[nodiscard]] Matrix<3, 3> rotation_of(double roll, double pitch, double yaw);

/// Heading of the body's x axis in the plane, counter-clockwise [rad]; arbitrary where that is
/// vertical.
[[nodiscard]] double yaw_of(const Matrix<3, 3>& rotation);

/// The least rotation that turns a direction upwards. Throws std::invalid_argument unless its
/// length is finite and > 0.
[[nodiscard]] Matrix<3, 3> rotation_up(const Vector<3>& direction);

/// The same as a unit quaternion (w, x, y, z), w >= 0, and back.
[[nodiscard]] Vector<4> quaternion_of(const Matrix<3, 3>& rotation);
[[nodiscard]] Matrix<3, 3> rotation_of(const Vector<4>& quaternion);

}  // namespace locfuse
