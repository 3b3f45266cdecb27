// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "frontends/circle_fit.hpp"

namespace locfuse::internal {

/// Beams that may end on a cylinder: docs/models/landmarks.md eq. (5.8).
struct Cone {
  double half_angle;  ///< from the bearing of the centre [rad]
  double min_range;   ///< [m]
  double max_range;   ///< where a beam touches the cylinder [m]

  [[nodiscard]] bool has(double range) const { return range >= min_range && range <= max_range; }
};

/// Cone of a centre at `distance`, which exceeds `radius` [m].
[[nodiscard]] Cone cone_of(double distance, double radius);

/// Mean squared error of (range, bearing) of a centre at `distance` [m] that is taken to lie
/// `radius` behind the end of the shortest of some beams: eq. (5.9). `offsets` are the bearings of
/// the beams from that of the centre [rad], at least one.
[[nodiscard]] Matrix<2, 2> closest_beam_error(double distance, double radius,
                                              const std::vector<double>& offsets,
                                              const BeamNoise& noise);

}  // namespace locfuse::internal
