// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/local_map.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "frontends/local_map_fit.hpp"

namespace locfuse {
namespace {

using internal::LinePoint;
using internal::Prior;

constexpr double kFarthest = 1e6;       // or the kd-tree's float squares overflow [m]
constexpr double kCaptured = 0.3;       // how far off a guess may be for the fit [m]
constexpr double kCapturedTurn = 0.25;  // [rad]
constexpr double kFinestCell = 0.05;    // of the search [m]
constexpr double kMostCells = 400.0;    // of it along one side

[[noreturn]] void refuse(const char* what, double value, const char* expected) {
  std::ostringstream text;
  text << what << " is " << value << ", expected " << expected;
  throw std::invalid_argument(text.str());
}

void require_length(const char* what, double value, double most, const char* expected) {
  if (!(value >= 1e-6 && value <= most)) {
    refuse(what, value, expected);
  }
}

LocalMapConfig checked(const LocalMapConfig& config) {
  require_length("LocalMapConfig.sigma_range_m", config.sigma_range_m, 10.0, "1e-6 to 10");
  require_length("LocalMapConfig.max_distance_m", config.max_distance_m, kFarthest, "1e-6 to 1e6");
  if (!(config.trimmed_share >= 0.0 && config.trimmed_share < 1.0)) {
    refuse("LocalMapConfig.trimmed_share", config.trimmed_share, "at least 0 and less than 1");
  }
  if (!(config.min_explained >= 0.0 && config.min_explained <= 1.0)) {
    refuse("LocalMapConfig.min_explained", config.min_explained, "a number from 0 to 1");
  }
  if (config.max_iterations < 1 || config.max_iterations > 1000) {
    refuse("LocalMapConfig.max_iterations", config.max_iterations, "1 to 1000");
  }
  return config;
}

void require_pose(const char* what, const Pose2& pose) {
  for (const double value : {pose.x, pose.y, pose.heading}) {
    if (!(std::abs(value) < kFarthest)) {
      refuse(what, value, "numbers less than a million");
    }
  }
}

std::vector<LinePoint> lines_of(const LaserScan& scan, double sigma) {
  std::vector<LinePoint> lines = internal::line_points(scan, sigma);
  if (!(scan.geometry->range_max < kFarthest)) {
    refuse("range_max [m]", scan.geometry->range_max, "less than a million");
  }
  return lines;
}

std::vector<LinePoint> points_of(const std::vector<PlacedScan>& scans, double sigma) {
  std::vector<LinePoint> points;
  for (const PlacedScan& placed : scans) {
    require_pose("pose of a scan", placed.pose);
    for (const LinePoint& point : lines_of(placed.scan, sigma)) {
      points.push_back(internal::moved(point, placed.pose));
    }
  }
  return points;
}

/// The ends as the occupied cells of a map of which nothing else is known.
std::shared_ptr<const OccupancyGrid> raster_of(const std::vector<LinePoint>& points) {
  Vector<2> low = points.front().end;
  Vector<2> high = low;
  for (const LinePoint& point : points) {
    low = low.cwiseMin(point.end);
    high = high.cwiseMax(point.end);
  }
  const double cell = std::max(kFinestCell, (high - low).maxCoeff() / kMostCells);
  const Eigen::Vector2i size = ((high - low) / cell).array().floor().matrix().cast<int>();
  const int width = size.x() + 1;
  const int height = size.y() + 1;
  std::vector<Cell> cells(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                          Cell::kUnknown);
  for (const LinePoint& point : points) {
    const Eigen::Vector2i at = ((point.end - low) / cell).cast<int>();
    cells[static_cast<std::size_t>(at.y()) * static_cast<std::size_t>(width) +
          static_cast<std::size_t>(at.x())] = Cell::kOccupied;
  }
  return std::make_shared<const OccupancyGrid>(width, height, cell, Pose2{low.x(), low.y(), 0.0},
                                               std::move(cells));
}

/// Where a search finds the scan, likeliest by its cost and the prior's heading.
std::optional<Pose2> searched(const std::vector<LinePoint>& points, const LaserScan& scan,
                              const LocalMapConfig& config, const Pose2& guess,
                              const Matrix<3, 3>& covariance) {
  ScanMatcherConfig settings;
  settings.sigma_range_m = config.sigma_range_m;
  const ScanMatcher matcher(raster_of(points), settings);
  const ScanSearch found = matcher.search(scan, guess.position(), covariance.topLeftCorner<2, 2>());
  std::optional<Pose2> best;
  double least = std::numeric_limits<double>::infinity();
  for (const ScanHypothesis& hypothesis : found.hypotheses) {
    const double turned = angle_difference(hypothesis.match.pose.heading, guess.heading);
    const double cost = hypothesis.cost + 0.5 * turned * turned / covariance(2, 2);
    if (cost < least) {
      least = cost;
      best = hypothesis.match.pose;
    }
  }
  return best;
}

/// Whether three sigma of a guess are more than the fit comes back from.
bool is_poor(const Matrix<3, 3>& covariance) {
  const Vector<3> off = 3.0 * covariance.diagonal().cwiseSqrt();
  return off.x() > kCaptured || off.y() > kCaptured || off.z() > kCapturedTurn;
}

}  // namespace

LocalMap::LocalMap(const std::vector<PlacedScan>& scans, const LocalMapConfig& config)
    : config_(checked(config)),
      cloud_(std::make_shared<const internal::LineCloud>(points_of(scans, config.sigma_range_m))) {}

ScanMatch LocalMap::match(const LaserScan& scan, const Pose2& guess,
                          const std::optional<Matrix<3, 3>>& covariance) const {
  require_pose("guess", guess);
  Prior prior{guess};
  if (covariance) {
    internal::require_covariance(*covariance);
    prior.information = covariance->llt().solve(Matrix<3, 3>::Identity());
  }
  const std::vector<LinePoint> beams = lines_of(scan, config_.sigma_range_m);
  ScanMatch match;
  match.pose = guess;
  match.reason = beams.empty() ? ScanMatch::Reason::kNoReturns : ScanMatch::Reason::kTooFewMatches;
  if (beams.empty() || cloud_->points().empty()) {
    return match;
  }
  match = internal::fit_lines(*cloud_, config_, beams, guess, prior);
  if (!covariance || (match.explained >= config_.min_explained && !is_poor(*covariance))) {
    return match;
  }
  if (const std::optional<Pose2> start =
          searched(cloud_->points(), scan, config_, guess, *covariance)) {
    ScanMatch other = internal::fit_lines(*cloud_, config_, beams, *start, prior);
    if (other.converged && other.explained > match.explained) {
      return other;
    }
  }
  return match;
}

}  // namespace locfuse
