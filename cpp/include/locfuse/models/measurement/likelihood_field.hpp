// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "locfuse/maps/distance_field.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// End points of a scan in body, in cells of a map.
struct EndPoints {
  std::vector<float> x, y;

  /// End points in the frame of the map, for a pose in cells.
  [[nodiscard]] EndPoints seen_from(const Pose2& pose) const;
};

/// Likelihood of the end point of a beam by its distance to the nearest wall (Thrun, Burgard and
/// Fox, Probabilistic Robotics, section 6.4); docs/models/scans.md.
///
/// One byte per cell: the cost of 0 to 255 units of `unit()` nats.
class LikelihoodField {
 public:
  struct Config {
    double sigma_hit_m = 0.1;    ///< of an end point about its wall, including map errors [m]
    double random_share = 0.05;  ///< share of beams that end anywhere
    double max_range_m = 30.0;   ///< longer returns are not used [m]
    double clutter_per_m =
        0.1;  ///< density of ends in free space, at people and other objects [1/m]
    double unknown_per_m = 0.002;  ///< density of ends in unknown space, mostly behind walls [1/m]

    /// The defaults with another sigma_hit_m.
    [[nodiscard]] static Config with_sigma(double sigma_hit_m) {
      Config config;
      config.sigma_hit_m = sigma_hit_m;
      return config;
    }
  };

  /// Throws std::invalid_argument on settings out of range, without a map, on one without occupied
  /// or free cells, or one with more than 2^28 cells including a rim of `max_range_m`.
  LikelihoodField(const Config& config, const std::shared_ptr<const OccupancyGrid>& grid);

  /// Fields of one map with sigmas that double from one to the next, below 1.5 times `widest_m`
  /// [m]. Throws as the constructor does.
  [[nodiscard]] static std::vector<LikelihoodField> doubling(
      Config config, const std::shared_ptr<const OccupancyGrid>& grid, double widest_m);

  [[nodiscard]] const OccupancyGrid& grid() const { return *grid_; }
  [[nodiscard]] const Config& config() const { return config_; }

  /// Up to `max_points` of the returns, evenly among them. Ranges outside range_min to range_max or
  /// longer than max_range_m are no returns.
  [[nodiscard]] EndPoints end_points(const LaserScan& scan, int max_points) const;

  /// Log density of one end point [nats], at a point in cells of the map; eq. (3.1).
  [[nodiscard]] double log_density(double x, double y) const;

  /// Sums of costs over the end points for poses `begin` to `end` [cells], whole groups of eight,
  /// in units of -unit() below the maximum likelihood. Poses off the map cost more than any on it.
  void costs(const EndPoints& points, const float* x, const float* y, const float* c,
             const float* s, int begin, int end, std::int32_t* sums) const;

  [[nodiscard]] double unit() const { return unit_; }
  /// Log density of an end point on a wall: cost 0.
  [[nodiscard]] double best() const { return best_; }
  /// Whether a wall within 1.25 sigma explains an end point in cells of the map.
  [[nodiscard]] bool explains(double x, double y) const { return cost(x, y) <= hit_cost_; }
  /// Share of end points in cells of the map that a wall explains.
  [[nodiscard]] double explained(const EndPoints& seen) const;

 private:
  LikelihoodField(const Config& config, std::shared_ptr<const OccupancyGrid> grid,
                  const DistanceField& distances);
  [[nodiscard]] std::uint8_t cost(double x, double y) const;

  Config config_;
  std::shared_ptr<const OccupancyGrid> grid_;
  int rim_;
  int width_;
  int height_;
  double best_;
  double unit_;
  int hit_cost_;  // of an end point that a wall explains
  std::vector<std::uint8_t> costs_;
};

}  // namespace locfuse
