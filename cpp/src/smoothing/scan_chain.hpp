// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "locfuse/smoothing/scan_mapper.hpp"

namespace locfuse::internal {

/// A key scan and those of other lasers that go with it, T_node_body.
struct ScanNode {
  Stamp stamp = 0;
  Pose2 pose;         ///< T_start_node by the odometry of scans alone
  double path = 0.0;  ///< driven until here [m]
  std::vector<PlacedScan> scans;
};

/// Where the body was at a scan, and by wheels on the way to it from the one before.
struct ScanFrame {
  Stamp stamp = 0;
  std::size_t node = 0;
  Pose2 in_node;                                   ///< T_node_body
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();  ///< of it
  std::vector<std::pair<Stamp, Pose2>> way;        ///< T_before_body, ends where this begins
};

/// A drive as key scans and motions between, by the odometry of scans.
struct ScanChain {
  std::vector<ScanNode> nodes;
  std::vector<PoseRelation> relations;  ///< from each node to the next
  std::vector<ScanFrame> frames;
  std::size_t unmatched = 0;  ///< nodes whose scan fitted nothing
  std::size_t weak = 0;       ///< frames whose scan left a direction open, without wheels
};

/// Throws std::invalid_argument as `map_scans`.
[[nodiscard]] ScanChain make_scan_chain(const ScanDrive::Config& config,
                                        const std::vector<Message>& messages,
                                        const std::function<void(double)>& progress);

}  // namespace locfuse::internal
