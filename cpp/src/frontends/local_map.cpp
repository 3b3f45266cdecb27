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
#include "math/refuse.hpp"

namespace locfuse {
namespace {

using internal::LinePoint;
using internal::Prior;
using internal::refuse;

/// Constants of LocalMap; docs/models/scans.md, "Without a map".
struct LocalMapTuning {
  /// Bound of lengths and coordinates [m]; squares of larger ones overflow the kd-tree's floats.
  static constexpr double kMaxLength = 1e6;
  /// Minimum of a configured length [m].
  static constexpr double kMinLength = 1e-6;
  /// Error of a guess from which the fit converges [m], [rad].
  static constexpr double kCaptureDistance = 0.3;
  static constexpr double kCaptureTurn = 0.25;
  /// Uncertainty of a guess that must be below these [standard deviations].
  static constexpr double kGuessSigmas = 3.0;
  /// Minimum cell of the search [m], and maximum number of cells along one side.
  static constexpr double kMinCell = 0.05;
  static constexpr double kMaxCells = 400.0;
};

void require_length(const char* what, double value, double max, const char* expected) {
  if (!(value >= LocalMapTuning::kMinLength && value <= max)) {
    refuse(what, value, expected);
  }
}

LocalMapConfig checked(const LocalMapConfig& config) {
  require_length("LocalMapConfig.sigma_range_m", config.sigma_range_m, 10.0, "1e-6 to 10");
  require_length("LocalMapConfig.max_distance_m", config.max_distance_m, LocalMapTuning::kMaxLength,
                 "1e-6 to 1e6");
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
    if (!(std::abs(value) < LocalMapTuning::kMaxLength)) {
      refuse(what, value, "numbers less than a million");
    }
  }
}

std::vector<LinePoint> lines_of(const LaserScan& scan, double sigma) {
  std::vector<LinePoint> lines = internal::line_points(scan, sigma);
  if (!(scan.geometry->range_max < LocalMapTuning::kMaxLength)) {
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

/// Map whose occupied cells are the ends, unknown elsewhere.
std::shared_ptr<const OccupancyGrid> raster_of(const std::vector<LinePoint>& points) {
  Vector<2> low = points.front().end;
  Vector<2> high = low;
  for (const LinePoint& point : points) {
    low = low.cwiseMin(point.end);
    high = high.cwiseMax(point.end);
  }
  const double cell =
      std::max(LocalMapTuning::kMinCell, (high - low).maxCoeff() / LocalMapTuning::kMaxCells);
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

/// Likeliest pose of a search, by its cost and the prior's heading.
std::optional<Pose2> searched(const std::vector<LinePoint>& points, const LaserScan& scan,
                              const LocalMapConfig& config, const Pose2& guess,
                              const Matrix<3, 3>& covariance) {
  ScanMatcherConfig settings;
  settings.sigma_range_m = config.sigma_range_m;
  const ScanMatcher matcher(raster_of(points), settings);
  const ScanSearch found = matcher.search(scan, guess.position(), covariance.topLeftCorner<2, 2>());
  std::optional<Pose2> best;
  double min_cost = std::numeric_limits<double>::infinity();
  for (const ScanHypothesis& hypothesis : found.hypotheses) {
    const double turned = angle_difference(hypothesis.match.pose.heading, guess.heading);
    const double cost = hypothesis.cost + 0.5 * turned * turned / covariance(2, 2);
    if (cost < min_cost) {
      min_cost = cost;
      best = hypothesis.match.pose;
    }
  }
  return best;
}

/// Whether the uncertainty of a guess exceeds the errors from which the fit converges.
bool is_poor(const Matrix<3, 3>& covariance) {
  const Vector<3> off = LocalMapTuning::kGuessSigmas * covariance.diagonal().cwiseSqrt();
  return off.x() > LocalMapTuning::kCaptureDistance || off.y() > LocalMapTuning::kCaptureDistance ||
         off.z() > LocalMapTuning::kCaptureTurn;
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
