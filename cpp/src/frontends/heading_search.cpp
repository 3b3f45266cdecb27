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

/// Single precision is exact to a hundredth of a cell on the largest maps, and twice as fast.
struct Points {
  std::vector<float> x, y;
};

/// Sum of the looked-up distances of the end points turned by `heading` about `p`, in cells.
double looked_up(const DistanceField& field, const Points& points, const Pose2& pose) {
  constexpr std::size_t kBlock = 8;  // loops of known length become vector instructions
  const auto c = static_cast<float>(std::cos(pose.heading));
  const auto s = static_cast<float>(std::sin(pose.heading));
  const auto x0 = static_cast<float>(pose.x);
  const auto y0 = static_cast<float>(pose.y);
  const auto right = static_cast<float>(field.width());
  const auto top = static_cast<float>(field.height());
  const float* const distances = field.distances().data();
  double sum = 0.0;
  for (std::size_t i = 0; i + kBlock <= points.x.size(); i += kBlock) {
    float x[kBlock];
    float y[kBlock];
    for (std::size_t k = 0; k < kBlock; ++k) {
      x[k] = x0 + c * points.x[i + k] - s * points.y[i + k];
      y[k] = y0 + s * points.x[i + k] + c * points.y[i + k];
    }
    float part = 0.0F;
    for (std::size_t k = 0; k < kBlock; ++k) {
      if (x[k] >= 0.0F && x[k] < right && y[k] >= 0.0F && y[k] < top) {
        part += distances[static_cast<int>(y[k]) * field.width() + static_cast<int>(x[k])];
      } else {
        part += static_cast<float>(field.nearest_in_field(x[k], y[k]).distance);
      }
    }
    sum += static_cast<double>(part);
  }
  for (std::size_t i = points.x.size() / kBlock * kBlock; i < points.x.size(); ++i) {
    const float x = x0 + c * points.x[i] - s * points.y[i];
    const float y = y0 + s * points.x[i] + c * points.y[i];
    if (x >= 0.0F && x < right && y >= 0.0F && y < top) {
      sum +=
          static_cast<double>(distances[static_cast<int>(y) * field.width() + static_cast<int>(x)]);
    } else {
      sum += field.nearest_in_field(static_cast<double>(x), static_cast<double>(y)).distance;
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
  const Points points{{beams.x.begin(), beams.x.end()}, {beams.y.begin(), beams.y.end()}};
  const DistanceField& field = map.occupied();
  return search(map, beams, position, [&](double heading) {
    const Pose2 body{position.x(), position.y(), heading};
    const Pose2 pose = internal::to_field(body, map.grid(), field.margin_cells());
    return resolution * looked_up(field, points, pose);
  });
}

}  // namespace locfuse
