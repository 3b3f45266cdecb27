// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "frontends/sweep.hpp"

namespace locfuse::internal {

struct BeamNoise {
  double range;    ///< [m]
  double bearing;  ///< [rad]
  double step;     ///< between two beams [rad]
};

struct Circle {
  Vector<2> centre;
  double radius;
};

struct CircleFit {
  Circle circle;
  Matrix<3, 3> covariance;  ///< of (x, y, radius); zero in row and column of a known radius
  double misfit;            ///< chi-square
  int dof;
  bool free_first;  ///< the beam before the arc passes the circle
  bool free_last;   ///< the beam after it does
};

/// z component of the cross product.
[[nodiscard]] inline double cross(const Vector<2>& a, const Vector<2>& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Circle through the ends of the beams, by algebra (Taubin's). None if they lie on a line.
[[nodiscard]] std::optional<Circle> algebraic_circle(const Sweep& sweep, const Run& run);

/// Circle of a known radius behind the chord of the run.
[[nodiscard]] Circle circle_behind(const Sweep& sweep, const Run& run, double radius);

/// Distance of the end of a beam from a circle, positive outside, and its variance.
/// docs/models/landmarks.md eq. (5.2) and (5.3).
struct Offset {
  double distance;
  double variance;
  Vector<2> outwards;  ///< unit vector from the centre
};
[[nodiscard]] Offset offset_of(const Ray& ray, const Circle& circle, const BeamNoise& noise);

/// Whether a beam ends behind the middle of a circle, or beside it.
[[nodiscard]] bool passes(const Ray& ray, const Circle& circle, double margin);

/// Least squares along the beams and at the ends of the arc, from `start`. None if it leaves the
/// valid circles or is not determined.
[[nodiscard]] std::optional<CircleFit> fit_circle(const Sweep& sweep, const Run& run,
                                                  const Circle& start, bool radius_known,
                                                  const BeamNoise& noise);

/// Circle of a known radius hit by a few beams: moments over all bearings consistent with the beams
/// that hit it. docs/models/landmarks.md eq. (5.6).
[[nodiscard]] std::optional<CircleFit> fit_few(const Sweep& sweep, const Run& run, double radius,
                                               const BeamNoise& noise);

/// Chi-square of the best straight line through a run.
[[nodiscard]] double line_misfit(const Sweep& sweep, const Run& run, const BeamNoise& noise);

/// Chi-squares of the best two lines that follow each other.
struct Corner {
  double right;  ///< at a right angle
  double any;    ///< at any angle
};
[[nodiscard]] Corner best_corner(const Sweep& sweep, const Run& run, const BeamNoise& noise);

}  // namespace locfuse::internal
