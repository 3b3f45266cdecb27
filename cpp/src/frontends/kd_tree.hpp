// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "locfuse/math/linearization.hpp"

namespace locfuse::internal {

/// Finds the nearest of points in the plane, in single precision: by PCL's kd-tree, or by
/// nanoflann's where locfuse is built without PCL.
class KdTree {
 public:
  explicit KdTree(const std::vector<Vector<2>>& points);
  ~KdTree();
  KdTree(const KdTree&) = delete;
  KdTree& operator=(const KdTree&) = delete;

  /// Index of the nearest point to each place; there must be a point.
  void nearest(const std::vector<Vector<2>>& places, std::vector<int>& found) const;

 private:
  struct Tree;

  std::unique_ptr<Tree> tree_;
};

}  // namespace locfuse::internal
