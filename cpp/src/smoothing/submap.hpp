// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "locfuse/frontends/local_map.hpp"
#include "locfuse/maps/distance_field.hpp"
#include "smoothing/scan_chain.hpp"

namespace locfuse::internal {

/// What was seen around a node, in its frame, by the odometry of scans alone.
class Submap {
 public:
  Submap(const ScanChain& chain, std::size_t node, const LocalMapConfig& config);

  /// For the fit of a scan.
  [[nodiscard]] const LocalMap& local() const { return local_; }
  [[nodiscard]] const std::shared_ptr<const OccupancyGrid>& grid() const { return grid_; }

  struct Agreement {
    double share = 0.0;    ///< of the ends in sight of the other that do not contradict it
    double overlap = 0.0;  ///< share of all ends that are in sight of the other
  };
  /// Of what both show, if the other lies at T_this_other.
  [[nodiscard]] Agreement agreement(const Submap& other, const Pose2& at) const;

 private:
  struct Counts {
    double agreed = 0.0;
    double contradicted = 0.0;
  };
  [[nodiscard]] Counts counts(const Submap& other, const Pose2& at) const;

  LocalMap local_;
  std::shared_ptr<const OccupancyGrid> grid_;
  std::unique_ptr<const DistanceField> field_;  // empty if the grid has no wall
  std::vector<Vector<2>> ends_;
};

}  // namespace locfuse::internal
