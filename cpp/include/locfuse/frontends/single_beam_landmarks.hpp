// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/maps/landmark_map.hpp"
#include "locfuse/messages/messages.hpp"

/// Landmarks from one beam each, as two papers find them: to compare `CylinderDetector` with.
/// docs/models/cylinders.md, "Single beams".
namespace locfuse {

/// What the beam that stands for a landmark says; -1, -1 and 0 where no beam does.
struct BeamLandmark {
  int beam = -1;
  double range = -1.0;   ///< [m]
  double bearing = 0.0;  ///< in the laser's frame [rad]
};

/// wells, equations 8 to 11: of the beams `first` to `last` the one with the least range, and the
/// radius added to that: the centre, from the laser. `first` above `last` goes across the end of
/// the scan.
///
/// Throws std::invalid_argument if the scan is not valid, a beam is not in it, or `radius` is not
/// a finite number >= 0.
[[nodiscard]] BeamLandmark closest_beam(const LaserScan& scan, int first, int last, double radius);

/// gadau2022 Fig. 3: for each landmark in order of id, of the beams within its largest angle around
/// where it is predicted, with a range that its surface can have there, the one with the least. The
/// range is that to the surface, as the beam says it.
///
/// `predicted` is T_world_body. A landmark that surrounds the laser is not seen. Throws
/// std::invalid_argument if scan or pose are not valid.
[[nodiscard]] std::vector<BeamLandmark> recognize_landmarks(const LaserScan& scan,
                                                            const Pose2& predicted,
                                                            const LandmarkMap& landmarks);

}  // namespace locfuse
