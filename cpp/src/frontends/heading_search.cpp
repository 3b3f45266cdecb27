// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/heading_search.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "frontends/beams.hpp"

namespace locfuse {
namespace {

using internal::Beams;

double heading_of(int step) { return wrap_angle(step * (2.0 * kPi / HeadingSearch::kSteps)); }

/// Asks `sum_at` for the sum of each heading of the body in world.
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
    for (int step = 0; step < HeadingSearch::kSteps; ++step) {
      found.sums[static_cast<std::size_t>(step)] = sum_at(heading_of(step));
    }
    const auto least = std::min_element(found.sums.begin(), found.sums.end());
    found.heading = heading_of(static_cast<int>(least - found.sums.begin()));
  }
  return found;
}

constexpr int kLanes = 4;
using Lanes = Eigen::Array<float, kLanes, 1>;
using Indices = Eigen::Array<int, kLanes, 1>;

/// Four end points in body, in single precision: right to 1e-3 cells on the largest maps.
struct Points4 {
  Lanes x, y;
};

/// The end points by fours; the last four may be filled up by `spare` points at the body.
struct Points {
  std::vector<Points4> fours;
  int spare;
};

Points points_of(const Beams& beams) {
  const std::size_t count = beams.x.size();
  Points points{std::vector<Points4>((count + kLanes - 1) / kLanes), 0};
  for (Points4& four : points.fours) {
    four.x.setZero();
    four.y.setZero();
  }
  points.spare = static_cast<int>(kLanes * points.fours.size() - count);
  for (std::size_t i = 0; i < count; ++i) {
    points.fours[i / kLanes].x(static_cast<int>(i % kLanes)) = static_cast<float>(beams.x[i]);
    points.fours[i / kLanes].y(static_cast<int>(i % kLanes)) = static_cast<float>(beams.y[i]);
  }
  return points;
}

double look_up(const DistanceField& field, double x, double y) {
  const bool inside = x >= 0.0 && x < field.width() && y >= 0.0 && y < field.height();
  return inside
             ? static_cast<double>(field.distances()[static_cast<std::size_t>(static_cast<int>(y)) *
                                                         static_cast<std::size_t>(field.width()) +
                                                     static_cast<std::size_t>(x)])
             : field.distance_beyond(x, y);
}

/// Sum of the looked-up distances of the end points seen from a pose of the field, in cells.
double looked_up(const DistanceField& field, const Points& points, const Pose2& pose) {
  const auto c = static_cast<float>(std::cos(pose.heading));
  const auto s = static_cast<float>(std::sin(pose.heading));
  const Lanes right = Lanes::Constant(static_cast<float>(field.width()) - 1.0F);
  const Lanes top = Lanes::Constant(static_cast<float>(field.height()) - 1.0F);
  const Lanes zero = Lanes::Zero();
  const float* const distances = field.distances().data();
  double beyond = 0.0;
  Lanes sum = Lanes::Zero();
  for (const Points4& four : points.fours) {
    const Lanes x = c * four.x - s * four.y + static_cast<float>(pose.x);
    const Lanes y = s * four.x + c * four.y + static_cast<float>(pose.y);
    const Lanes column = x.max(zero).min(right);
    const Lanes row = y.max(zero).min(top);
    if (((x - column).abs() + (y - row).abs()).maxCoeff() > 0.0F) {
      for (int k = 0; k < kLanes; ++k) {
        beyond += look_up(field, static_cast<double>(x(k)), static_cast<double>(y(k)));
      }
      continue;
    }
    const Indices columns = column.cast<int>();
    const Indices rows = row.cast<int>();
    Lanes found;
    for (int k = 0; k < kLanes; ++k) {
      found(k) = distances[rows(k) * field.width() + columns(k)];
    }
    sum += found;
  }
  return beyond + static_cast<double>(sum.sum()) - points.spare * look_up(field, pose.x, pose.y);
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
  const Points points = points_of(beams);
  const DistanceField& field = map.occupied();
  return search(map, beams, position, [&](double heading) {
    const Pose2 body{position.x(), position.y(), heading};
    const Pose2 pose = internal::to_field(body, map.grid(), field.margin_cells());
    return resolution * looked_up(field, points, pose);
  });
}

}  // namespace locfuse
