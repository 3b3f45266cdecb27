// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "frontends/kd_tree.hpp"
#include "frontends/scan_lines.hpp"

namespace locfuse::internal {

/// Ends of beams in the frame of a local map, with a kd-tree over their feet.
class LineCloud {
 public:
  explicit LineCloud(std::vector<LinePoint> points)
      : points_(std::move(points)), tree_(feet_of(points_)) {}

  [[nodiscard]] const std::vector<LinePoint>& points() const { return points_; }

  /// Index of the nearest foot to each place; there must be a point.
  void nearest(const std::vector<Vector<2>>& places, std::vector<int>& found) const {
    tree_.nearest(places, found);
  }

 private:
  [[nodiscard]] static std::vector<Vector<2>> feet_of(const std::vector<LinePoint>& points) {
    std::vector<Vector<2>> feet;
    feet.reserve(points.size());
    for (const LinePoint& point : points) {
      feet.push_back(point.foot);
    }
    return feet;
  }

  std::vector<LinePoint> points_;
  KdTree tree_;
};

}  // namespace locfuse::internal
