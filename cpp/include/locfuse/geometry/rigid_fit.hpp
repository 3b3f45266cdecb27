// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/types.hpp"

namespace locfuse {

/// Outcome of a rigid fit.
enum class RigidFitStatus : std::uint8_t {
  kFitted,
  kMirrored,      ///< a reflection fits better; `pose` is the rotation that fits best
  kNoDirection,   ///< the points in world determine no heading: they coincide, or are a reflection
  kNotConverged,  ///< no weighted optimum, or none with a covariance
};

/// Pose of a rigid body from points measured in world.
struct RigidFit {
  RigidFitStatus status = RigidFitStatus::kNoDirection;
  Pose2 pose{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN(),
             std::numeric_limits<double>::quiet_NaN()};   ///< T_world_body
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();         ///< of (x, y, heading)
  double nis = std::numeric_limits<double>::quiet_NaN();  ///< squared misfit r' C^-1 r
  int dof = 0;                                            ///< of nis: 2 n - 3
};

namespace internal {
/// Rows of n points in the plane.
constexpr int twice(int n) { return n == Eigen::Dynamic ? int(Eigen::Dynamic) : 2 * n; }
}  // namespace internal

/// Pose that maps points known in body to their measured positions in world, by least squares
/// weighted with the covariance of (x0, y0, x1, y1, ...) in world [m^2]; docs/models/poses.md.
/// Starts from the closed form without weights, then Gauss-Newton. A reflection is never returned
/// as a rotation. Compiled for three points, and for a number known at run time, Eigen::Dynamic.
///
/// Throws std::invalid_argument on fewer than two points, points that all coincide in body, numbers
/// that are not finite or a covariance that is not symmetric positive definite.
template <int N>
[[nodiscard]] RigidFit rigid_fit(const Matrix<2, N>& body, const Matrix<2, N>& world,
                                 const Matrix<internal::twice(N), internal::twice(N)>& covariance);

/// Rigid fit of points with independent covariances [m^2].
[[nodiscard]] RigidFit rigid_fit(const Matrix<2, Eigen::Dynamic>& body,
                                 const Matrix<2, Eigen::Dynamic>& world,
                                 const std::vector<Matrix<2, 2>>& covariances);

}  // namespace locfuse
