// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/landmark_map.hpp"

namespace locfuse {

/// Landmark observed from the body.
struct SeenLandmark {
  Vector<2> position = Vector<2>::Zero();          ///< in the body's frame [m]
  Matrix<2, 2> covariance = Matrix<2, 2>::Zero();  ///< [m^2]
  std::optional<Id> id;                            ///< if it was identified
};

/// Pose that explains the observed positions of two landmarks.
struct ConstellationMatch {
  Pose2 pose;               ///< T_world_body
  Matrix<3, 3> covariance;  ///< of (x, y, heading)
  double log_evidence;      ///< density of the two positions, the pose integrated out
};

/// Poses from which two landmarks of the map are observed at `a` and `b`. Their distance must pass
/// a gate of that probability. None if they are too close to each other to give a heading. O(n^2)
/// for n landmarks. Derivation: docs/models/landmarks.md.
///
/// Throws std::invalid_argument if the probability is not in [0, 1].
[[nodiscard]] std::vector<ConstellationMatch> match_constellation(const SeenLandmark& a,
                                                                  const SeenLandmark& b,
                                                                  const LandmarkMap& map,
                                                                  double probability);

}  // namespace locfuse
