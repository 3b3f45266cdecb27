// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "locfuse/maps/ray_caster.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Beams of a scan, and from where on the body they leave.
struct Beams {
  Pose2 laser_in_body;
  std::vector<double> angle;  ///< from the laser's x [rad]
  std::vector<double> range;  ///< [m], infinite without return
};

/// How likely a beam's reading is, by how far it can go on the map (Thrun, Burgard and Fox,
/// Probabilistic Robotics, section 6.3); docs/models/beam_model.md.
///
/// Costs a ray per beam and pose, some fifty times what a likelihood field does, but knows that
/// beams do not pass walls.
class BeamModel {
 public:
  /// The first four are weights of a mixture; what they sum to does not matter.
  struct Config {
    double hit = 0.8;            ///< readings about what the map says
    double shorter = 0.1;        ///< readings at what is not on the map
    double maximum = 0.05;       ///< beams without return
    double random = 0.05;        ///< readings anywhere
    double sigma_hit_m = 0.1;    ///< of a reading about what the map says [m]
    double shorter_per_m = 0.5;  ///< how soon a beam meets what is not on the map [1/m]
    double max_range_m = 30.0;   ///< longer readings are no returns [m]
  };

  /// The mixture of zhang: a Gaussian, and beams without return.
  [[nodiscard]] static Config zhang() { return {0.95, 0.0, 0.05, 0.0, 0.2, 0.5, 30.0}; }

  /// Throws std::invalid_argument on settings out of range or weights that are all 0.
  static const Config& checked(const Config& config);

  /// Throws as `checked` does, and if there is no map.
  BeamModel(const Config& config, const std::shared_ptr<const OccupancyGrid>& grid);

  /// Up to `most` beams, evenly among all; readings outside the scanner's bounds are no returns,
  /// those below range_min are left out.
  [[nodiscard]] Beams beams_of(const LaserScan& scan, int most) const;

  /// Log density of a reading where the map says `expected` [m, infinite if nothing]; eq. (1).
  [[nodiscard]] double log_density(double range, double expected) const;

  /// Sum over the beams, seen from a pose of the body in world; eq. (2).
  [[nodiscard]] double log_likelihood(const Pose2& T_world_body, const Beams& beams) const;

 private:
  Config config_;
  RayCaster caster_;
};

}  // namespace locfuse
