// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "locfuse/math/angle.hpp"
#include "locfuse/math/types.hpp"

namespace locfuse {

/// Pose in the plane, or the transform that it represents: T_world_body maps body to world.
/// Also used for motions: dx, dy, dheading in the previous body frame.
struct Pose2 {
  double x = 0.0;        ///< [m]
  double y = 0.0;        ///< [m]
  double heading = 0.0;  ///< [rad], wrapped to [-pi, pi) by every function below

  [[nodiscard]] Vector<2> position() const { return {x, y}; }

  /// Point in the target frame: p_world = T_world_body.act(p_body).
  [[nodiscard]] Vector<2> act(const Vector<2>& p) const {
    const double c = std::cos(heading);
    const double s = std::sin(heading);
    return {x + c * p.x() - s * p.y(), y + s * p.x() + c * p.y()};
  }
};

/// T_a_c = T_a_b * T_b_c.
[[nodiscard]] inline Pose2 operator*(const Pose2& a_b, const Pose2& b_c) {
  const Vector<2> p = a_b.act(b_c.position());
  return {p.x(), p.y(), wrap_angle(a_b.heading + b_c.heading)};
}

/// T_b_a from T_a_b.
[[nodiscard]] inline Pose2 inverse(const Pose2& a_b) {
  const Vector<2> p = Pose2{0.0, 0.0, -a_b.heading}.act(a_b.position());
  return {-p.x(), -p.y(), wrap_angle(-a_b.heading)};
}

/// Pose plus an error state (dx, dy in world, dheading).
[[nodiscard]] inline Pose2 retract(const Pose2& pose, const Vector<3>& delta) {
  return {pose.x + delta.x(), pose.y + delta.y(), wrap_angle(pose.heading + delta.z())};
}

/// Error state that leads from `from` to `to`: retract(from, local(to, from)) == to.
[[nodiscard]] inline Vector<3> local(const Pose2& to, const Pose2& from) {
  return {to.x - from.x, to.y - from.y, angle_difference(to.heading, from.heading)};
}

/// Covariance of (x, y, heading) of `pose * motion`: F P F' + G Q G', with P of `pose` and Q of
/// `motion` in the frame of `pose`.
[[nodiscard]] Matrix<3, 3> covariance_after(const Pose2& pose, const Matrix<3, 3>& P,
                                            const Pose2& motion, const Matrix<3, 3>& Q);

namespace internal {
/// sin(a)/a and (1-cos(a))/a, exact to rounding through a = 0.
struct ArcTerms {
  double sine;
  double versine;
};
[[nodiscard]] inline ArcTerms arc_terms(double a) {
  if (std::abs(a) < 1e-4) {  // next series terms are below 1e-17
    return {1.0 - a * a / 6.0, a / 2.0 - a * a * a / 24.0};
  }
  const double half = std::sin(0.5 * a);
  return {std::sin(a) / a, 2.0 * half * half / a};
}
}  // namespace internal

/// Motion along the circular arc with constant body twist: SE(2) exponential of
/// (forward [m], left [m], turn [rad]). Straight at zero turn.
[[nodiscard]] inline Pose2 arc(double forward, double left, double turn) {
  const internal::ArcTerms t = internal::arc_terms(turn);
  return {t.sine * forward - t.versine * left, t.versine * forward + t.sine * left,
          wrap_angle(turn)};
}

/// Twist (forward, left, turn) whose arc is `motion`: SE(2) logarithm, with the shortest turn.
[[nodiscard]] inline Vector<3> arc_twist(const Pose2& motion) {
  const double turn = wrap_angle(motion.heading);
  const internal::ArcTerms t = internal::arc_terms(turn);
  const double scale = 1.0 / (t.sine * t.sine + t.versine * t.versine);
  return {scale * (t.sine * motion.x + t.versine * motion.y),
          scale * (t.sine * motion.y - t.versine * motion.x), turn};
}

/// The first `share` (0 to 1, or beyond to extrapolate) of a motion driven on its arc.
[[nodiscard]] inline Pose2 arc_share(const Pose2& motion, double share) {
  const Vector<3> twist = share * arc_twist(motion);
  return arc(twist.x(), twist.y(), twist.z());
}

}  // namespace locfuse
