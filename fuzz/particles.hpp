// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "checks.hpp"
#include "codec.hpp"
#include "health.hpp"
#include "locfuse/particles/mcl.hpp"

namespace locfuse::fuzz {

[[nodiscard]] inline Mcl::Config few_particles() {
  Mcl::Config config;
  config.min_particles = 40;
  config.max_particles = 150;
  config.scouts = 8;
  config.scout_draws = 200;
  config.beams = 20;
  return config;
}

/// Arbitrary settings, except that those that determine memory and time are small.
inline void code_settings(Reader& io, Mcl::Config& c) {
  for (int* count :
       {&c.min_particles, &c.max_particles, &c.beams, &c.scouts, &c.scout_draws, &c.bin_headings}) {
    code(io, *count);
  }
  code(io,
       {&c.kld_error, &c.effective_share, &c.outlier_share, &c.resample_below, &c.min_explained,
        &c.kidnapping_probability, &c.probability_ready, &c.field.random_share},
       0.0, 1.0);
  code(io,
       {&c.kld_quantile,
        &c.independent_beams,
        &c.independent_beams_searching,
        &c.spacing_m,
        &c.spacing_heading_rad,
        &c.most_drop,
        &c.most_gain,
        &c.hold_s,
        &c.sigma_lost_xy_per_sqrt_s,
        &c.sigma_lost_heading_per_sqrt_s,
        &c.sigma_xy_ready_m,
        &c.sigma_heading_ready_rad,
        &c.bin_m,
        &c.sigma_map_m,
        &c.sigma_map_rad,
        &c.sigma_widest_m,
        &c.field.sigma_hit_m,
        &c.field.clutter_per_m,
        &c.field.unknown_per_m,
        &c.beam_model.hit,
        &c.beam_model.shorter,
        &c.beam_model.maximum,
        &c.beam_model.random,
        &c.beam_model.sigma_hit_m,
        &c.beam_model.shorter_per_m,
        &c.odometry.sigma_xy_per_sqrt_s,
        &c.odometry.sigma_longitudinal_per_sqrt_m,
        &c.range.sigma_m},
       0.0, 3.0);
  code(io, c.field.max_range_m, 0.0, 30.0);
  code(io, c.beam_model.max_range_m, 0.0, 30.0);
  bool by_beams = false;
  code(io, by_beams);
  c.likelihood = by_beams ? Mcl::Likelihood::kBeams : Mcl::Likelihood::kField;
  std::uint8_t proposal = 0;
  code(io, proposal, 4);
  c.proposal = static_cast<Mcl::Proposal>(proposal);
  code(io, c.health);
}

/// Checks particles (finite, unit headings, weights sum to 1), the covariance of the estimates and
/// the probabilities of health.
inline void require_sound(const Reader& io, const Mcl& mcl) {
  const ParticleBelief& belief = mcl.belief();
  double total = 0.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(belief.size); ++k) {
    require(std::isfinite(belief.x[k]) && std::isfinite(belief.y[k]), "particles are finite");
    require(std::abs(std::hypot(belief.c[k], belief.s[k]) - 1.0F) < 1e-3F,
            "headings are unit vectors");
    require(belief.weight[k] >= 0.0F, "a weight is not negative");
    total += static_cast<double>(belief.weight[k]);
  }
  require(std::abs(total - 1.0) < 1e-3, "weights sum to 1");
  for (const PoseEstimate& estimate : {mcl.estimate(), mcl.overall_estimate()}) {
    require(estimate.pose.position().allFinite() && std::isfinite(estimate.pose.heading),
            "the estimate is finite");
    require_covariance(io, estimate.covariance);
  }
  require_sound(mcl.health());
  require_sound(mcl.sources());
}

}  // namespace locfuse::fuzz
