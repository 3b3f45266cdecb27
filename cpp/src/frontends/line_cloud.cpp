// SPDX-License-Identifier: Apache-2.0
#include "frontends/line_cloud.hpp"

#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>

#include <utility>

namespace locfuse::internal {
namespace {

pcl::PointXYZ to_pcl(const Vector<2>& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F};
}

}  // namespace

struct LineCloud::Tree {
  pcl::KdTreeFLANN<pcl::PointXYZ> tree{false};
};

LineCloud::LineCloud(std::vector<LinePoint> points)
    : points_(std::move(points)), tree_(std::make_unique<Tree>()) {
  if (points_.empty()) {  // PCL builds no tree of an empty cloud
    return;
  }
  const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  cloud->reserve(points_.size());
  for (const LinePoint& point : points_) {
    cloud->push_back(to_pcl(point.foot));
  }
  tree_->tree.setInputCloud(cloud);
}

LineCloud::~LineCloud() = default;

void LineCloud::nearest(const std::vector<Vector<2>>& places, std::vector<int>& found) const {
  std::vector<int> index(1);
  std::vector<float> squared(1);
  found.clear();
  for (const Vector<2>& place : places) {
    tree_->tree.nearestKSearch(to_pcl(place), 1, index, squared);
    found.push_back(index[0]);
  }
}

}  // namespace locfuse::internal
