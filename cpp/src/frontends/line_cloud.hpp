// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "frontends/scan_lines.hpp"

namespace locfuse::internal {

/// Ends of beams in the frame of a local map, with PCL's kd-tree over their feet.
class LineCloud {
 public:
  explicit LineCloud(std::vector<LinePoint> points);
  ~LineCloud();
  LineCloud(const LineCloud&) = delete;
  LineCloud& operator=(const LineCloud&) = delete;

  [[nodiscard]] const std::vector<LinePoint>& points() const { return points_; }

  /// Index of the nearest foot to each place; there must be a point.
  void nearest(const std::vector<Vector<2>>& places, std::vector<int>& found) const;

 private:
  struct Tree;

  std::vector<LinePoint> points_;
  std::unique_ptr<Tree> tree_;
};

}  // namespace locfuse::internal
