// SPDX-License-Identifier: Apache-2.0
#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>

#include "frontends/kd_tree.hpp"

namespace locfuse::internal {
namespace {

pcl::PointXYZ to_pcl(const Vector<2>& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F};
}

}  // namespace

struct KdTree::Tree {
  pcl::KdTreeFLANN<pcl::PointXYZ> tree{false};
};

KdTree::KdTree(const std::vector<Vector<2>>& points) : tree_(std::make_unique<Tree>()) {
  if (points.empty()) {  // PCL builds no tree of an empty cloud
    return;
  }
  const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  cloud->reserve(points.size());
  for (const Vector<2>& point : points) {
    cloud->push_back(to_pcl(point));
  }
  tree_->tree.setInputCloud(cloud);
}

KdTree::~KdTree() = default;

void KdTree::nearest(const std::vector<Vector<2>>& places, std::vector<int>& found) const {
  std::vector<int> index(1);
  std::vector<float> squared(1);
  found.clear();
  for (const Vector<2>& place : places) {
    tree_->tree.nearestKSearch(to_pcl(place), 1, index, squared);
    found.push_back(index[0]);
  }
}

}  // namespace locfuse::internal
