// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <nanoflann.hpp>
#include <utility>

#include "frontends/kd_tree.hpp"

namespace locfuse::internal {
namespace {

/// Points as nanoflann reads them.
struct Points {
  std::vector<Eigen::Vector2f> all;

  [[nodiscard]] std::size_t kdtree_get_point_count() const { return all.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t point, std::size_t axis) const {
    return all[point](static_cast<Eigen::Index>(axis));
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;  // nanoflann finds it
  }
};

using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>,
                                                  Points, 2, std::uint32_t>;

}  // namespace

struct KdTree::Tree {
  explicit Tree(Points given)
      : points(std::move(given)), index(2, points, nanoflann::KDTreeSingleIndexAdaptorParams(15)) {
#if NANOFLANN_VERSION < 0x142  // the constructor of later ones does
    index.buildIndex();
#endif
  }

  Points points;
  Index index;
};

KdTree::KdTree(const std::vector<Vector<2>>& points) {
  Points floats;
  floats.all.reserve(points.size());
  for (const Vector<2>& point : points) {
    floats.all.emplace_back(point.cast<float>());
  }
  tree_ = std::make_unique<Tree>(std::move(floats));
}

KdTree::~KdTree() = default;

void KdTree::nearest(const std::vector<Vector<2>>& places, std::vector<int>& found) const {
  found.clear();
  for (const Vector<2>& place : places) {
    const Eigen::Vector2f p = place.cast<float>();
    std::uint32_t index = 0;
    float squared = 0.0F;
    tree_->index.knnSearch(p.data(), 1, &index, &squared);
    found.push_back(static_cast<int>(index));
  }
}

}  // namespace locfuse::internal
