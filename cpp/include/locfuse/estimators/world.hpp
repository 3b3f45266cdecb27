// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/anchor_map.hpp"
#include "locfuse/maps/landmark_map.hpp"
#include "locfuse/maps/tags.hpp"

namespace locfuse {

class OccupancyGrid;
class ScanMatcher;

/// The known landmarks, and where the sensor that observes them sits on the body.
struct LandmarkSensor {
  std::shared_ptr<const LandmarkMap> map;  ///< or null
  Pose2 T_body_sensor;                     ///< pose of the sensor on the body
};

/// What does not change while a robot drives: the maps, and where its sensors sit on the body.
///
/// Every estimator is made from a config, a world and, where it has one, a start. What a world
/// does not have is null or empty, and an estimator takes of it what it can use. Cheap to copy.
struct World {
  std::shared_ptr<const AnchorMap> anchors = {};    ///< to which ranges are measured, or null
  std::vector<Tag> tags = {};                       ///< on the body
  LandmarkSensor landmarks = {};                    ///< and the sensor that observes them
  std::shared_ptr<const OccupancyGrid> grid = {};   ///< of walls, or null
  std::shared_ptr<const ScanMatcher> matcher = {};  ///< of scans on a map, or null
};

}  // namespace locfuse
