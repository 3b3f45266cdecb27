// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/likelihood_field.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "maps/given.hpp"
#include "math/processor.hpp"
#include "models/measurement/field_lanes.hpp"

namespace locfuse {
namespace {

/// Constants of LikelihoodField; docs/models/scans.md.
struct LikelihoodFieldTuning {
  /// Maximum number of cells, of one byte each: a quarter of a gigabyte.
  static constexpr double kMaxCells = 1 << 28;
  /// Cost of the least likely end point: largest number of a byte.
  static constexpr double kMaxCost = 255.0;
  /// Cost per end point of a pose off the map, more than any on it.
  static constexpr int kOffMapCost = 256;
  /// Distance within which a wall explains an end point [sigmas].
  static constexpr double kExplainedSigmas = 1.25;
  /// Sigma of the widest field, at most, over the one asked for.
  static constexpr double kMaxOverWidest = 1.5;
  /// Bytes behind the table, as look-ups read four.
  static constexpr std::size_t kPadding = 3;
};

internal::SumCosts summer() {
#ifdef LOCFUSE_LANES_AVX2
  if (internal::has_avx2()) {
    return internal::avx2::sum_costs;
  }
#endif
  return internal::portable::sum_costs;
}

double within(const char* name, double value, double low, double high) {
  if (!(value > low && value < high)) {
    throw std::invalid_argument("LikelihoodField." + std::string(name) + " is " +
                                std::to_string(value) + ", expected > " + std::to_string(low) +
                                " and < " + std::to_string(high));
  }
  return value;
}

void check_density(const char* name, double value) {
  if (!(value >= 0.0 && value <= 1e6)) {
    throw std::invalid_argument("LikelihoodField." + std::string(name) + " is " +
                                std::to_string(value) + ", expected >= 0 and <= 1e6");
  }
}

DistanceField distances_on(const std::shared_ptr<const OccupancyGrid>& grid) {
  const std::vector<Cell>& cells = internal::given(grid, "LikelihoodField")->cells();
  if (std::find(cells.begin(), cells.end(), Cell::kFree) == cells.end()) {
    throw std::invalid_argument("the map has 0 free cells, expected at least 1");
  }
  return DistanceField(grid, 0.0);
}

}  // namespace

EndPoints EndPoints::seen_from(const Pose2& pose) const {
  const auto c = static_cast<float>(std::cos(pose.heading));
  const auto s = static_cast<float>(std::sin(pose.heading));
  const auto x0 = static_cast<float>(pose.x);
  const auto y0 = static_cast<float>(pose.y);
  EndPoints seen = *this;
  for (std::size_t k = 0; k < x.size(); ++k) {
    seen.x[k] = x0 + c * x[k] - s * y[k];
    seen.y[k] = y0 + s * x[k] + c * y[k];
  }
  return seen;
}

LikelihoodField::LikelihoodField(const Config& config,
                                 const std::shared_ptr<const OccupancyGrid>& grid)
    : LikelihoodField(config, grid, distances_on(grid)) {}

std::vector<LikelihoodField> LikelihoodField::doubling(
    Config config, const std::shared_ptr<const OccupancyGrid>& grid, double widest_m) {
  const DistanceField distances = distances_on(grid);
  std::vector<LikelihoodField> fields;
  do {
    fields.push_back(LikelihoodField(config, grid, distances));
    config.sigma_hit_m *= 2.0;
  } while (config.sigma_hit_m < LikelihoodFieldTuning::kMaxOverWidest * widest_m);
  return fields;
}

LikelihoodField::LikelihoodField(const Config& config, std::shared_ptr<const OccupancyGrid> grid,
                                 const DistanceField& distances)
    : config_(config), grid_(std::move(grid)) {
  const OccupancyGrid& map = *grid_;
  within("sigma_hit_m", config.sigma_hit_m, 1e-6, 1e3);
  within("random_share", config.random_share, 1e-9, 1.0);
  within("max_range_m", config.max_range_m, 1e-3, 1e4);
  check_density("clutter_per_m", config.clutter_per_m);
  check_density("unknown_per_m", config.unknown_per_m);
  const double resolution = map.resolution();
  const double rim = std::floor(config.max_range_m / resolution) + 2.0;
  if (!((map.width() + 2.0 * rim) * (map.height() + 2.0 * rim) <=
        LikelihoodFieldTuning::kMaxCells)) {
    throw std::invalid_argument("max_range_m is " + std::to_string(config.max_range_m) + " m, or " +
                                std::to_string(rim) +
                                " cells, expected a field of at most 2^28 cells");
  }
  rim_ = static_cast<int>(rim);
  width_ = map.width() + 2 * rim_;
  height_ = map.height() + 2 * rim_;

  const double sigma = config.sigma_hit_m / resolution;
  const double hit = (1.0 - config.random_share) / (config.sigma_hit_m * std::sqrt(2.0 * kPi));
  const double random = config.random_share / config.max_range_m;
  const auto density = [&](double cells) {
    return hit * std::exp(-0.5 * cells * cells / (sigma * sigma)) + random;
  };
  best_ = std::log(density(0.0));
  unit_ = (best_ - std::log(random)) / LikelihoodFieldTuning::kMaxCost;
  const auto cost_of = [&](double value) {
    return static_cast<std::uint8_t>(std::lround(
        std::clamp((best_ - std::log(value)) / unit_, 0.0, LikelihoodFieldTuning::kMaxCost)));
  };
  hit_cost_ =
      cost_of(density(LikelihoodFieldTuning::kExplainedSigmas * sigma) + config.clutter_per_m);
  const std::uint8_t unknown = cost_of(config.unknown_per_m);
  costs_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) +
                    LikelihoodFieldTuning::kPadding,
                unknown);
  for (int row = 0; row < map.height(); ++row) {
    const std::size_t from = static_cast<std::size_t>(row + distances.margin_cells()) *
                                 static_cast<std::size_t>(distances.width()) +
                             static_cast<std::size_t>(distances.margin_cells());
    std::uint8_t* const to =
        &costs_[static_cast<std::size_t>(row + rim_) * static_cast<std::size_t>(width_) +
                static_cast<std::size_t>(rim_)];
    for (int column = 0; column < map.width(); ++column) {
      const auto distance =
          static_cast<double>(distances.distances()[from + static_cast<std::size_t>(column)]);
      const Cell cell = map.at(column, row);
      const double clutter = cell == Cell::kFree ? config.clutter_per_m : 0.0;
      const std::uint8_t cost = cost_of(density(distance) + clutter);
      to[column] = cell == Cell::kUnknown ? std::min(cost, unknown) : cost;
    }
  }
}

EndPoints LikelihoodField::end_points(const LaserScan& scan, int max_points) const {
  validate(scan);
  const LaserGeometry& geometry = *scan.geometry;
  const double longest = std::min(geometry.range_max, config_.max_range_m);
  std::vector<std::size_t> returns;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (scan.ranges[i] > geometry.range_min && scan.ranges[i] < longest) {  // false for NaN
      returns.push_back(i);
    }
  }
  const std::size_t count =
      std::min(returns.size(), static_cast<std::size_t>(std::max(max_points, 0)));
  EndPoints points;
  points.x.reserve(count);
  points.y.reserve(count);
  // End points of a laser mounted far off the body may exceed the rim.
  const double max_distance = (static_cast<double>(rim_) - 1.0) * grid_->resolution();
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = returns[(2 * k + 1) * returns.size() / (2 * count)];
    const double angle = geometry.angle_min + static_cast<double>(i) * geometry.angle_increment;
    const Vector<2> p = geometry.pose_in_body.act(
        {scan.ranges[i] * std::cos(angle), scan.ranges[i] * std::sin(angle)});
    if (p.norm() < max_distance) {
      points.x.push_back(static_cast<float>(p.x() / grid_->resolution()));
      points.y.push_back(static_cast<float>(p.y() / grid_->resolution()));
    }
  }
  return points;
}

std::uint8_t LikelihoodField::cost(double x, double y) const {
  if (!(x >= -rim_ && y >= -rim_ && x < width_ - rim_ && y < height_ - rim_)) {
    return costs_.front();  // unknown, as the rim; the point may exceed integers
  }
  const int column = static_cast<int>(std::floor(x)) + rim_;
  const int row = static_cast<int>(std::floor(y)) + rim_;
  return costs_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                static_cast<std::size_t>(column)];
}

double LikelihoodField::log_density(double x, double y) const { return best_ - unit_ * cost(x, y); }

double LikelihoodField::explained(const EndPoints& seen) const {
  int count = 0;
  for (std::size_t k = 0; k < seen.x.size(); ++k) {
    count += static_cast<int>(explains(seen.x[k], seen.y[k]));
  }
  return seen.x.empty() ? 0.0 : static_cast<double>(count) / static_cast<double>(seen.x.size());
}

void LikelihoodField::costs(const EndPoints& points, const float* x, const float* y, const float* c,
                            const float* s, int begin, int end, std::int32_t* sums) const {
  const internal::CostTable table{costs_.data(), width_, height_, rim_};
  const auto count = static_cast<int>(points.x.size());
  summer()(table, points.x.data(), points.y.data(), count, {x, y, c, s}, begin, end,
           LikelihoodFieldTuning::kOffMapCost * count, sums);
}

}  // namespace locfuse
