// SPDX-License-Identifier: Apache-2.0
#include "smoothing/submap.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "frontends/scan_lines.hpp"
#include "locfuse/frontends/grid_drawing.hpp"

namespace locfuse::internal {
namespace {

struct SubmapTuning {
  static constexpr double kReach = 5.0;  ///< along the path and in a straight line [m]
  static constexpr double kEvery = 0.5;  ///< between two of its key scans [m]
  static constexpr double kCell = 0.1;   ///< of its grid [m]
  static constexpr double kWall = 0.15;  ///< farthest from a wall at which an end agrees [m]
  static constexpr double kFar = 30.0;   ///< ends beyond say nothing here [m]
  static constexpr std::size_t kMaxEnds = 1500;
};

/// Without what is far away, where a scan is drawn.
LaserScan near_part(const LaserScan& scan) {
  LaserScan near = scan;
  for (double& range : near.ranges) {
    range = range > SubmapTuning::kFar ? std::numeric_limits<double>::quiet_NaN() : range;
  }
  return near;
}

std::vector<PlacedScan> scans_around(const ScanChain& chain, std::size_t node) {
  const ScanNode& center = chain.nodes[node];
  const Pose2 to_center = inverse(center.pose);
  std::vector<PlacedScan> found;
  const auto add = [&](std::size_t i, double& last) {
    const ScanNode& one = chain.nodes[i];
    const Pose2 at = to_center * one.pose;
    if (at.position().norm() > SubmapTuning::kReach ||
        (i != node && std::abs(one.path - last) < SubmapTuning::kEvery &&
         std::abs(at.heading) < 0.5)) {
      return;
    }
    last = one.path;
    for (const PlacedScan& placed : one.scans) {
      found.push_back({near_part(placed.scan), at * placed.pose});
    }
  };
  double last = center.path;
  add(node, last);
  for (std::size_t i = node; i-- > 0;) {
    if (center.path - chain.nodes[i].path > SubmapTuning::kReach) {
      break;
    }
    add(i, last);
  }
  last = center.path;
  for (std::size_t i = node + 1; i < chain.nodes.size(); ++i) {
    if (chain.nodes[i].path - center.path > SubmapTuning::kReach) {
      break;
    }
    add(i, last);
  }
  return found;
}

std::vector<Vector<2>> ends_of(const std::vector<PlacedScan>& scans, double sigma) {
  std::vector<Vector<2>> all;
  for (const PlacedScan& placed : scans) {
    for (const LinePoint& point : line_points(placed.scan, sigma)) {
      all.push_back(placed.pose.act(point.end));
    }
  }
  const std::size_t stride = all.size() / SubmapTuning::kMaxEnds + 1;
  std::vector<Vector<2>> found;
  for (std::size_t i = 0; i < all.size(); i += stride) {
    found.push_back(all[i]);
  }
  return found;
}

}  // namespace

Submap::Submap(const ScanChain& chain, std::size_t node, const LocalMapConfig& config)
    : local_({}, config) {
  const std::vector<PlacedScan> scans = scans_around(chain, node);
  local_ = LocalMap(scans, config);
  ends_ = ends_of(scans, config.sigma_range_m);
  if (ends_.empty()) {
    return;
  }
  grid_ = std::make_shared<const OccupancyGrid>(draw_grid(scans, SubmapTuning::kCell));
  const std::vector<Cell>& cells = grid_->cells();
  if (std::find(cells.begin(), cells.end(), Cell::kOccupied) != cells.end()) {
    field_ = std::make_unique<const DistanceField>(grid_, 0.0);
  }
}

Submap::Counts Submap::counts(const Submap& other, const Pose2& at) const {
  Counts found;
  if (!field_) {
    return found;
  }
  for (const Vector<2>& end : other.ends_) {
    const Vector<2> here = at.act(end);
    if (!grid_->contains(here)) {
      continue;
    }
    if (field_->distance(here) <= SubmapTuning::kWall) {
      found.agreed += 1.0;
    } else if (grid_->at(here) == Cell::kFree) {
      found.contradicted += 1.0;
    }
  }
  return found;
}

Submap::Agreement Submap::agreement(const Submap& other, const Pose2& at) const {
  const Counts theirs = counts(other, at);
  const Counts ours = other.counts(*this, inverse(at));
  const double agreed = theirs.agreed + ours.agreed;
  const double known = agreed + theirs.contradicted + ours.contradicted;
  const double all = static_cast<double>(ends_.size() + other.ends_.size());
  return {known > 0.0 ? agreed / known : 0.0, all > 0.0 ? known / all : 0.0};
}

}  // namespace locfuse::internal
