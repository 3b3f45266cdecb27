// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "locfuse/math/linearization.hpp"

namespace locfuse {

/// Velocities in world of points on a rigid body from wheel odometry: celan2017 eq. (5) to (10),
/// differentiated; docs/models/poses.md.
///
/// The heading is assumed to be known.
class VelocityModel {
 public:
  /// Errors of the twist are shared by all points; those of a point are independent.
  struct Config {
    double sigma_forward_mps = 0.02;      ///< [m/s]
    double sigma_lateral_mps = 0.01;      ///< lateral slip [m/s]
    double sigma_turn_rate_radps = 0.02;  ///< [rad/s]
    double sigma_point_mps = 0.01;        ///< each point, each axis [m/s]
    double gate = 0.999;                  ///< probability that a good one passes; 1: no gate
  };

  VelocityModel() : VelocityModel(Config{}) {}

  /// Throws std::invalid_argument on a sigma that is negative or not finite, or if the last is 0.
  explicit VelocityModel(const Config& config);

  /// Velocity in world of a point on the body [m/s]: eq. (5.2). `twist` is (forward [m/s], left
  /// [m/s], turn rate [rad/s]).
  [[nodiscard]] static Vector<2> predict(double heading, const Vector<3>& twist,
                                         const Vector<2>& point_in_body) {
    const double c = std::cos(heading);
    const double s = std::sin(heading);
    const double forward = twist.x() - twist.z() * point_in_body.y();
    const double left = twist.y() + twist.z() * point_in_body.x();
    return {c * forward - s * left, s * forward + c * left};
  }

  /// Linearization with respect to the velocities of the points, one per column of
  /// `points_in_body`: the Jacobian is the identity, R is eq. (5.4).
  template <int Size>
  [[nodiscard]] Linearization<Size, Size> linearize(
      const Vector<Size>& velocities, double heading, const Vector<3>& twist,
      const Matrix<2, Size / 2>& points_in_body) const {
    Linearization<Size, Size> lin;
    lin.jacobian.setIdentity();
    Matrix<Size, 3> errors;  // of the velocities by those of the twist: eq. (5.3)
    for (int i = 0; i < Size / 2; ++i) {
      const Vector<2> point = points_in_body.col(i);
      lin.residual.template segment<2>(2 * i) =
          predict(heading, twist, point) - velocities.template segment<2>(2 * i);
      for (int k = 0; k < 3; ++k) {
        errors.template block<2, 1>(2 * i, k) = predict(heading, Vector<3>::Unit(k), point);
      }
    }
    lin.noise.noalias() = errors * twist_variances_.asDiagonal() * errors.transpose();
    lin.noise.diagonal().array() += point_variance_;
    return lin;
  }

 private:
  Vector<3> twist_variances_;
  double point_variance_;
};

}  // namespace locfuse
