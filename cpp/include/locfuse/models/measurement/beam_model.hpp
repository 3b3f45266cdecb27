// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "locfuse/maps/ray_caster.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Beams of a scan and the pose of the laser on the body.
struct Beams {
  Pose2 laser_in_body;
  std::vector<double> angle;  ///< from the laser's x [rad]
  std::vector<double> range;  ///< [m], infinite without return
};

/// Likelihood of a beam's range, given the distance to the first wall on the map (Thrun, Burgard
/// and Fox, Probabilistic Robotics, section 6.3); docs/models/scans.md.
///
/// Casts a ray per beam and pose, some fifty times the cost of a likelihood field, but models that
/// beams do not pass walls.
class BeamModel {
 public:
  /// The first four are weights of a mixture, which are normalized.
  struct Config {
    double hit = 0.8;            ///< ranges near the distance on the map
    double shorter = 0.1;        ///< ranges to objects that are not on the map
    double maximum = 0.05;       ///< beams without return
    double random = 0.05;        ///< ranges anywhere
    double sigma_hit_m = 0.1;    ///< of a range about the distance on the map [m]
    double shorter_per_m = 0.5;  ///< rate of objects that are not on the map along a beam [1/m]
    double max_range_m = 30.0;   ///< longer ranges count as no return [m]
  };

  /// Mixture of a Gaussian about the distance on the map and beams without return: zhang equation 7
  /// and (8).
  [[nodiscard]] static Config gaussian_and_no_return() {
    Config config;
    config.hit = 0.95;
    config.shorter = 0.0;
    config.maximum = 0.05;
    config.random = 0.0;
    config.sigma_hit_m = 0.2;
    return config;
  }

  /// Throws std::invalid_argument on settings out of range or weights that are all 0.
  static const Config& checked(const Config& config);

  /// Throws as `checked` does, and if there is no map.
  BeamModel(const Config& config, const std::shared_ptr<const OccupancyGrid>& grid);

  /// Up to `max_beams` beams, evenly among all. Ranges beyond the maximum are no returns, those
  /// below range_min are left out.
  [[nodiscard]] Beams beams_of(const LaserScan& scan, int max_beams) const;

  /// Log density of a range where the distance on the map is `expected` [m], infinite without a
  /// wall; eq. (4.1).
  [[nodiscard]] double log_density(double range, double expected) const;

  /// Sum over the beams, seen from a pose of the body in world; eq. (4.2).
  [[nodiscard]] double log_likelihood(const Pose2& T_world_body, const Beams& beams) const;

 private:
  Config config_;
  RayCaster caster_;
};

}  // namespace locfuse
