// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/maps/landmark_map.hpp"
#include "locfuse/messages/messages.hpp"

/// Landmarks from one beam each, by the methods of two papers, for comparison with
/// `CylinderDetector`; docs/models/landmarks.md, "Single beams".
namespace locfuse {

/// Beam that represents a landmark; -1, -1 and 0 if there is none.
struct BeamLandmark {
  int beam = -1;
  double range = -1.0;   ///< [m]
  double bearing = 0.0;  ///< in the laser's frame [rad]
};

/// Shortest of the beams `first` to `last`, with the radius added to its range: the centre, from
/// the laser (wells, equations 8 to 11). `first` above `last` goes across the end of the scan.
///
/// Throws std::invalid_argument if the scan is not valid, a beam is not in it, or `radius` is not
/// a finite number >= 0.
[[nodiscard]] BeamLandmark closest_beam(const LaserScan& scan, int first, int last, double radius);

/// For each landmark in order of id the shortest of the beams within its angle around its predicted
/// bearing and with a range that its surface can have (gadau2022 Fig. 3). The range is that to the
/// surface, as measured.
///
/// `predicted` is T_world_body. A landmark that surrounds the laser has no beam. Throws
/// std::invalid_argument if scan or pose are not valid.
[[nodiscard]] std::vector<BeamLandmark> recognize_landmarks(const LaserScan& scan,
                                                            const Pose2& predicted,
                                                            const LandmarkMap& landmarks);

}  // namespace locfuse
