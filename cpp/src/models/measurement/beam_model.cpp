// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/beam_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "maps/given.hpp"

namespace locfuse {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMinDensity = 1e-12;  // of a range that the mixture excludes
constexpr double kMaxSigmas = 38.0;    // beyond, the density of a normal variable underflows
constexpr double kMinDistance = 1e-9;  // [m]

void in_range(const char* name, double value, double low, double high) {
  if (!(value >= low && value <= high)) {
    throw std::invalid_argument("BeamModel." + std::string(name) + " is " + std::to_string(value) +
                                ", expected " + std::to_string(low) + " to " +
                                std::to_string(high));
  }
}

double sum_of(const BeamModel::Config& config) {
  return config.hit + config.shorter + config.maximum + config.random;
}

BeamModel::Config normalized(BeamModel::Config config) {
  const double sum = sum_of(config);
  config.hit /= sum;
  config.shorter /= sum;
  config.maximum /= sum;
  config.random /= sum;
  return config;
}

}  // namespace

const BeamModel::Config& BeamModel::checked(const Config& config) {
  in_range("hit", config.hit, 0.0, 1.0);
  in_range("shorter", config.shorter, 0.0, 1.0);
  in_range("maximum", config.maximum, 0.0, 1.0);
  in_range("random", config.random, 0.0, 1.0);
  in_range("sigma_hit_m", config.sigma_hit_m, 1e-6, 1e3);
  in_range("shorter_per_m", config.shorter_per_m, 1e-6, 1e6);
  in_range("max_range_m", config.max_range_m, 1e-3, 1e4);
  if (!(sum_of(config) > 0.0)) {
    throw std::invalid_argument("weights of the BeamModel are all 0, expected one > 0");
  }
  return config;
}

BeamModel::BeamModel(const Config& config, const std::shared_ptr<const OccupancyGrid>& grid)
    : config_(normalized(checked(config))), caster_(internal::given(grid, "BeamModel")) {}

Beams BeamModel::beams_of(const LaserScan& scan, int max_beams) const {
  validate(scan);
  const LaserGeometry& geometry = *scan.geometry;
  const std::size_t count =
      std::min(scan.ranges.size(), static_cast<std::size_t>(std::max(max_beams, 0)));
  const double longest = std::min(geometry.range_max, config_.max_range_m);
  Beams beams{geometry.pose_in_body, {}, {}};
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = (2 * k + 1) * scan.ranges.size() / (2 * count);
    const double range = scan.ranges[i];
    if (range <= geometry.range_min) {
      continue;
    }
    beams.angle.push_back(geometry.angle_min + static_cast<double>(i) * geometry.angle_increment);
    beams.range.push_back(range < longest ? range : kInfinity);  // NaN also becomes infinite
  }
  return beams;
}

double BeamModel::log_density(double range, double expected) const {
  const Config& c = config_;
  if (!(range >= 0.0 && range < c.max_range_m)) {
    return std::log(std::max(c.maximum + (expected < c.max_range_m ? 0.0 : c.hit), kMinDensity));
  }
  const double off = (range - expected) / c.sigma_hit_m;
  double density = c.random / c.max_range_m;
  if (std::abs(off) < kMaxSigmas) {  // infinite without a wall
    density += c.hit * std::exp(-0.5 * off * off) / (c.sigma_hit_m * std::sqrt(2.0 * kPi));
  }
  if (range < expected) {
    const double before = std::clamp(expected, kMinDistance, c.max_range_m);
    density += c.shorter * c.shorter_per_m * std::exp(-c.shorter_per_m * range) /
               -std::expm1(-c.shorter_per_m * before);
  }
  return std::log(std::max(density, kMinDensity));
}

double BeamModel::log_likelihood(const Pose2& T_world_body, const Beams& beams) const {
  const Pose2 laser = T_world_body * beams.laser_in_body;
  const bool is_near = caster_.reaches(laser.position());
  double sum = 0.0;
  for (std::size_t k = 0; k < beams.angle.size(); ++k) {
    const double expected = is_near ? caster_.cast(laser.position(), laser.heading + beams.angle[k],
                                                   config_.max_range_m)
                                    : kInfinity;
    sum += log_density(beams.range[k], expected);
  }
  return sum;
}

}  // namespace locfuse
