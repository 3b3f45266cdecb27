// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/estimators/scan_drive.hpp"
#include "locfuse/frontends/grid_drawing.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/smoothing/pose_graph.hpp"

namespace locfuse {

/// How a map is made of a drive; docs/map.md.
struct ScanMapperConfig {
  ScanDrive::Config drive;     ///< of the odometry by scans, and the noise of wheels
  PoseGraphConfig graph;       ///< of the loops that are closed
  double resolution_m = 0.05;  ///< of the map
  PoseEstimate start;  ///< T_world_body at the first scan; its covariance counts with `onto`
  /// A map that is continued: scans are placed on it, and what they show replaces it there.
  std::shared_ptr<const OccupancyGrid> onto = nullptr;
};

/// A place that was seen again, or with `onto` a scan that was placed on the old map.
struct ScanLoop {
  Stamp from = 0;  ///< of the earlier scan; not of an old map
  Stamp to = 0;
  Pose2 motion;            ///< T_from_to
  double explained = 0.0;  ///< share of the returns that lie on what was seen before
  double agreement = 0.0;  ///< of both surroundings: share of ends that do not contradict
  bool kept = false;       ///< whether it agrees with all others
  bool is_on_map = false;  ///< whether the old map was seen, and `motion` is T_world_to
};

/// What a drive shows.
struct ScanMapping {
  OccupancyGrid grid;
  /// At each scan, and each stamp of wheels between two, with the covariance in world.
  std::vector<PoseEstimate> poses;
  std::vector<ScanLoop> loops;
  std::size_t scans = 0;      ///< that were used
  std::size_t keys = 0;       ///< of those that the map is drawn of
  std::size_t unmatched = 0;  ///< of those that fitted nothing: there the wheels led
  /// Of all scans those that left a direction open, as in a corridor, where no wheels led.
  std::size_t weak = 0;
};

/// Receives the share of the work that is done, 0 to 1.
using ScanMapperProgress = std::function<void(double)>;

/// Makes a map of laser scans and, if there is any, odometry of wheels, in any order; other
/// messages are left alone. Each scan is fitted to the last ones, places that were seen before are
/// recognised, and all poses are found at once by both.
///
/// Throws std::invalid_argument on a setting out of bounds, a message that is not valid, and where
/// no scan has a return; NumericalError where the solver fails.
[[nodiscard]] ScanMapping map_scans(const ScanMapperConfig& config,
                                    const std::vector<Message>& messages,
                                    const ScanMapperProgress& progress = {});

}  // namespace locfuse
