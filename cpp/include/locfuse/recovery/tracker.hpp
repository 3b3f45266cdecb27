// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>

#include "locfuse/estimators/air_ekf.hpp"
#include "locfuse/estimators/landmark_ekf.hpp"
#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/estimators/tag_triangle_ekf.hpp"

namespace locfuse {

/// The Gaussian estimators that a run feeds with every message, each with `current` and `estimate`.
using Tracker = std::variant<PoseEkf, LandmarkEkf, TagTriangleEkf, AirEkf>;

}  // namespace locfuse
