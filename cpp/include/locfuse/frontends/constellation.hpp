// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/landmark_map.hpp"

namespace locfuse {

/// A landmark as the body sees it.
struct SeenLandmark {
  Vector<2> position = Vector<2>::Zero();          ///< in the body's frame [m]
  Matrix<2, 2> covariance = Matrix<2, 2>::Zero();  ///< [m^2]
  std::optional<Id> id;                            ///< if it was recognized
};

/// A pose from which two landmarks look as they were seen.
struct ConstellationMatch {
  Pose2 pose;               ///< T_world_body
  Matrix<3, 3> covariance;  ///< of (x, y, heading)
  double log_evidence;      ///< density of the two positions, the pose integrated out
};

/// Every pose from which two landmarks of the map look like `a` and `b`; the distance between them
/// must pass a gate of that probability. None if they are too close to one another to tell a
/// heading. O(n^2) for n landmarks. Derivation: docs/models/constellation.md.
///
/// Throws std::invalid_argument if the probability is not in [0, 1].
[[nodiscard]] std::vector<ConstellationMatch> match_constellation(const SeenLandmark& a,
                                                                  const SeenLandmark& b,
                                                                  const LandmarkMap& map,
                                                                  double probability);

}  // namespace locfuse
