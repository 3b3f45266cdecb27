// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "locfuse/geometry/line2.hpp"
#include "locfuse/math/linearization.hpp"

namespace locfuse {

/// Line of a wall as a body sees it, in normal form.
///
/// h(x) = (r_j - x cos(alpha_j) - y sin(alpha_j), alpha_j - theta); docs/models/scans.md
/// eq. (2.5).
class LineModel {
 public:
  struct Config {
    /// Error of the map across a wall where a beam meets it, beside the noise of the scan [m].
    double sigma_wall_m = 0.03;
  };

  LineModel() : LineModel(Config{}) {}

  /// Throws std::invalid_argument unless the sigma is 0 to 1e3.
  explicit LineModel(const Config& config);

  /// Expected r [m], negative if the body is behind the wall, and alpha [rad] in body.
  [[nodiscard]] static Vector<2> predict(const Pose2& T_world_body, const Line2& wall) {
    return {wall.r - wall.normal().dot(T_world_body.position()),
            angle_difference(wall.alpha, T_world_body.heading)};
  }

  /// R of a line seen in body, whose (r, alpha) has the `covariance`, if it is that wall, by so
  /// many beams that meet errors of the map independent of each other: eq. (2.7). Of the two pieces
  /// the shorter one says how well the wall's direction is known.
  [[nodiscard]] Matrix<2, 2> noise(const Pose2& T_world_body, const Line2& wall, const Line2& seen,
                                   const Matrix<2, 2>& covariance, double independent_beams) const {
    const double covered = std::min(1.0, wall.half_length / seen.half_length);
    const double half = covered * seen.half_length;
    const double along = covered < 1.0 ? wall.direction().dot(wall.middle - T_world_body.position())
                                       : seen.direction().dot(seen.middle);
    const double across = variance_ / (covered * independent_beams);
    const double turn = 3.0 * across / (half * half);
    Matrix<2, 2> R = covariance;
    R(0, 0) += across + along * along * turn;
    R(0, 1) += along * turn;
    R(1, 0) += along * turn;
    R(1, 1) += turn;
    return R;
  }

  /// Linearization by a line seen in body, with R from `noise`. Jacobian with respect to (x, y,
  /// theta) of T_world_body, 2x3: eq. (2.6), the same from every pose.
  [[nodiscard]] static Linearization<2, 3> linearize(const Pose2& T_world_body, const Line2& wall,
                                                     const Line2& seen, const Matrix<2, 2>& R) {
    const Vector<2> expected = predict(T_world_body, wall);
    const Vector<2> normal = wall.normal();
    Linearization<2, 3> lin;
    lin.residual << seen.r - expected.x(), angle_difference(seen.alpha, expected.y());
    lin.jacobian << -normal.x(), -normal.y(), 0.0, 0.0, 0.0, -1.0;
    lin.noise = R;
    return lin;
  }

 private:
  double variance_;
};

}  // namespace locfuse
