// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "locfuse/messages/limits.hpp"
#include "locfuse/models/measurement/beam_model.hpp"
#include "locfuse/models/measurement/likelihood_field.hpp"
#include "locfuse/models/measurement/pose.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/odometry.hpp"
#include "locfuse/recovery/health.hpp"

namespace locfuse {

/// Settings of an Mcl; docs/models/particles.md.
struct MclConfig {
  /// How a scan weighs particles.
  enum class Likelihood : std::uint8_t {
    kField,  ///< likelihood field: distance of each end point to the nearest wall
    kBeams,  ///< beam model: expected against measured range
  };

  /// What particles of a robot that is tracked are drawn from before a scan weighs them;
  /// docs/models/particles.md, "Drawing where the scan says".
  enum class Proposal : std::uint8_t {
    kOdometry,      ///< motion model alone
    kScanMatch,     ///< motion model and a match of the scan, shared by all particles
    kLineEkf,       ///< motion model, corrected in each particle by the lines of scan and map
    kLineEkfPaper,  ///< the same, without what it was drawn from in the weight (zhang)
  };

  /// @name Number of particles (KLD sampling, Fox 2003)
  int min_particles = 500;
  int max_particles = 5000;
  double kld_error = 0.05;     ///< maximum Kullback-Leibler divergence of the particles
  double kld_quantile = 2.33;  ///< normal quantile of the probability of keeping it: 99 %

  /// @name Weights
  int beams = 60;  ///< per scan, evenly spaced among its returns
  /// Independent beams that a scan counts for: neighbouring beams share the map's errors.
  double independent_beams = 10.0;
  /// The same during global localization: smaller, so that no place is discarded early.
  double independent_beams_searching = 2.0;
  double effective_share = 0.2;  ///< minimum share of effective particles after a measurement
  double outlier_share = 0.01;   ///< of ranges, positions and poses
  double resample_below = 0.5;   ///< share of effective particles
  Proposal proposal = Proposal::kOdometry;

  /// @name When a scan is used
  double spacing_m = 0.1;             ///< minimum travel since the last scan used [m]
  double spacing_heading_rad = 0.05;  ///< or minimum rotation [rad]

  /// @name Kidnapping
  /// Tracking is declared lost when the mean beam log-likelihood drops this far below its running
  /// average [nats].
  double most_drop = 1.5;
  /// Tracking is declared lost when the share of returns that a wall explains, averaged over ten
  /// scans, drops below this.
  double min_explained = 0.75;
  int scouts = 64;          ///< recovery particles: candidate poses elsewhere while it is lost
  int scout_draws = 20000;  ///< poses in free space from which new candidates are chosen
  double most_gain = 2.0;   ///< maximum evidence for or against a candidate per scan [nats]
  double kidnapping_probability = 1e-4;  ///< prior that a candidate's evidence must exceed

  /// @name Odometry timeout
  double hold_s = 1.0;  ///< how long the last motion is extrapolated without odometry [s]
  double sigma_lost_xy_per_sqrt_s = 0.5;       ///< process noise after the timeout [m / sqrt(s)]
  double sigma_lost_heading_per_sqrt_s = 0.5;  ///< [rad / sqrt(s)]

  /// @name Convergence
  double probability_ready = 0.999;       ///< minimum probability of the likeliest cluster
  double sigma_xy_ready_m = 0.5;          ///< maximum sigma of its position [m]
  double sigma_heading_ready_rad = 0.17;  ///< maximum sigma of its heading [rad]

  /// @name Clusters
  double bin_m = 0.5;     ///< side of the bins that group particles [m]
  int bin_headings = 24;  ///< bins per turn

  /// @name Map
  double sigma_map_m = 0.03;     ///< map position error, which scans cannot observe [m]
  double sigma_map_rad = 0.005;  ///< map heading error [rad]

  std::uint64_t seed = 1;
  int threads = 1;
  OdometryMotion::Config odometry;
  LikelihoodField::Config field{0.05};  ///< its sigma_hit_m is the smallest one tried
  double sigma_widest_m = 0.4;          ///< largest sigma_hit tried; the first scan uses it [m]
  Likelihood likelihood = Likelihood::kField;
  BeamModel::Config beam_model;  ///< used with Likelihood::kBeams
  RangeModel::Config range;
  PositionModel::Config position;
  PoseModel::Config pose;
  RangeBearingModel::Config landmark;
  Limits limits;
  Health::Config health;
  /// Whether poses are of a localizer that a PoseWatch judges; they do not weigh particles then.
  bool watch_poses = false;
};

}  // namespace locfuse
