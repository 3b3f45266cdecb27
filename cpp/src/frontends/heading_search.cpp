// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/heading_search.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "frontends/beams.hpp"

namespace locfuse {
namespace {

using internal::Beams;
using internal::DistanceTable;
using internal::LaneBeams;
using internal::LanePose;

double heading_of(int step) { return wrap_angle(step * (2.0 * kPi / HeadingSearch::kSteps)); }

/// Searches the heading of the smallest `sum_at`, in world.
template <class Sum>
HeadingSearch search(const ScanMap& map, const Beams& beams, const Vector<2>& position,
                     const Sum& sum_at) {
  if (!position.allFinite()) {
    throw std::invalid_argument("position is (" + std::to_string(position.x()) + ", " +
                                std::to_string(position.y()) + ") m, expected finite numbers");
  }
  HeadingSearch found;
  if (!map.grid().contains(position)) {
    found.reason = HeadingSearch::Reason::kOutsideMap;
  } else if (beams.x.empty()) {
    found.reason = HeadingSearch::Reason::kNoReturns;
  } else {
    found.returns = static_cast<int>(beams.x.size());
    const double squares =
        std::inner_product(beams.range.begin(), beams.range.end(), beams.range.begin(), 0.0);
    found.rms_range = map.grid().resolution() * std::sqrt(squares / found.returns);
    for (int step = 0; step < HeadingSearch::kSteps; ++step) {
      found.sums[static_cast<std::size_t>(step)] = sum_at(heading_of(step));
    }
    const auto smallest = std::min_element(found.sums.begin(), found.sums.end());
    found.heading = heading_of(static_cast<int>(smallest - found.sums.begin()));
  }
  return found;
}

/// Sum of the looked-up distances of the end points seen from a pose of the field, in cells.
double looked_up(const DistanceField& field, const Beams& beams, const LaneBeams& columns,
                 const Pose2& pose) {
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  const DistanceTable table{field.distances().data(), field.width(),
                            field.height(),           field.far_width(),
                            field.far_height(),       static_cast<float>(DistanceField::kFarCells)};
  const LanePose lane_pose{static_cast<float>(c), static_cast<float>(s), static_cast<float>(pose.x),
                           static_cast<float>(pose.y)};
  double sum = internal::scan_lanes().sum_distances(table, columns, lane_pose);
  if (sum < 0.0) {  // an end point beyond the surroundings of the field
    sum = 0.0;
    for (std::size_t i = 0; i < beams.x.size(); ++i) {
      sum += field
                 .nearest_in_field(pose.x + c * beams.x[i] - s * beams.y[i],
                                   pose.y + s * beams.x[i] + c * beams.y[i])
                 .distance;
    }
  }
  return sum;
}

}  // namespace

HeadingSearch heading_search(const ScanMap& map, const LaserScan& scan, const Vector<2>& position) {
  const double resolution = map.grid().resolution();
  const Beams beams = internal::beams_of(scan, resolution);
  return search(map, beams, position, [&](double heading) {
    const Pose2 body{position.x(), position.y(), heading};
    double sum = 0.0;
    for (std::size_t i = 0; i < beams.x.size(); ++i) {
      sum += map.nearest_by_kdtree(body.act(resolution * Vector<2>(beams.x[i], beams.y[i])));
    }
    return sum;
  });
}

HeadingSearch heading_search_by_lookup(const ScanMap& map, const LaserScan& scan,
                                       const Vector<2>& position) {
  const double resolution = map.grid().resolution();
  const Beams beams = internal::beams_of(scan, resolution);
  const internal::BeamColumns columns =
      beams.x.empty() ? internal::BeamColumns{} : internal::columns_of(beams);
  const DistanceField& field = map.occupied();
  return search(map, beams, position, [&](double heading) {
    const Pose2 body{position.x(), position.y(), heading};
    const Pose2 pose = internal::to_field(body, map.grid(), field.margin_cells());
    return resolution * looked_up(field, beams, columns.view(), pose);
  });
}

}  // namespace locfuse
