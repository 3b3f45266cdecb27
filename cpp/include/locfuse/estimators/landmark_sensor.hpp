// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/maps/landmark_map.hpp"

namespace locfuse {

/// The known landmarks, and where the sensor that observes them sits on the body.
struct LandmarkSensor {
  std::shared_ptr<const LandmarkMap> map;  ///< or null
  Pose2 T_body_sensor;                     ///< pose of the sensor on the body
};

}  // namespace locfuse
