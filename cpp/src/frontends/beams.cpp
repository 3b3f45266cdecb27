// SPDX-License-Identifier: Apache-2.0
#include "frontends/beams.hpp"

#include <algorithm>
#include <cmath>

#include "math/processor.hpp"

namespace locfuse::internal {
namespace {

// Minimum distance between the end points of two beams [cells].
constexpr double kMinSpacing = 1e-6;

}  // namespace

Beams beams_of(const LaserScan& scan, double resolution) {
  validate(scan);
  const LaserGeometry& geometry = *scan.geometry;
  const Pose2& mount = geometry.pose_in_body;
  Beams beams{mount.position() / resolution,  {}, {}, {}, {}, std::abs(geometry.angle_increment),
              geometry.range_max / resolution};
  beams.x.reserve(scan.ranges.size());
  beams.y.reserve(scan.ranges.size());
  beams.range.reserve(scan.ranges.size());
  const double turn_c = std::cos(geometry.angle_increment);
  const double turn_s = std::sin(geometry.angle_increment);
  double c = 0.0;
  double s = 0.0;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (i % kExactDirections == 0) {
      const double angle =
          mount.heading + geometry.angle_min + static_cast<double>(i) * geometry.angle_increment;
      c = std::cos(angle);
      s = std::sin(angle);
    }
    const double range = scan.ranges[i];
    if (geometry.is_return(range)) {
      beams.x.push_back(beams.laser.x() + c * (range / resolution));
      beams.y.push_back(beams.laser.y() + s * (range / resolution));
      beams.range.push_back(range / resolution);
    } else {
      beams.silent.push_back(mount.heading + geometry.angle_min +
                             static_cast<double>(i) * geometry.angle_increment);
    }
    const double turned = c * turn_c - s * turn_s;
    s = s * turn_c + c * turn_s;
    c = turned;
  }
  return beams;
}

ScanLanes scan_lanes() {
#ifdef LOCFUSE_LANES_AVX2
  if (has_avx2()) {
    return avx2::scan_lanes();
  }
#endif
  return portable::scan_lanes();
}

BeamColumns columns_of(const Beams& beams, std::size_t stride) {
  constexpr std::size_t kGroup = kBeamGroup;
  const std::size_t count = (beams.x.size() + stride - 1) / stride;
  const std::size_t filled = (count + kGroup - 1) / kGroup * kGroup;
  BeamColumns columns;
  for (std::vector<float>* column : {&columns.x, &columns.y, &columns.used, &columns.per_spacing}) {
    column->resize(filled);
  }
  for (std::size_t i = 0; i < filled; ++i) {
    const std::size_t beam = stride * std::min(i, count - 1);
    columns.x[i] = static_cast<float>(beams.x[beam]);
    columns.y[i] = static_cast<float>(beams.y[beam]);
    columns.used[i] = i < count ? 1.0F : 0.0F;
    columns.per_spacing[i] =
        static_cast<float>(1.0 / std::max(beams.range[beam] * beams.step, kMinSpacing));
  }
  return columns;
}

Pose2 to_field(const Pose2& pose, const OccupancyGrid& grid, int margin_cells) {
  const Vector<2> p = grid.to_grid(pose.position()) + Vector<2>::Constant(margin_cells);
  return {p.x(), p.y(), wrap_angle(pose.heading - grid.origin().heading)};
}

Pose2 to_world(const Pose2& pose, const OccupancyGrid& grid, int margin_cells) {
  const Vector<2> p = grid.to_world(pose.position() - Vector<2>::Constant(margin_cells));
  return {p.x(), p.y(), wrap_angle(pose.heading + grid.origin().heading)};
}

}  // namespace locfuse::internal
