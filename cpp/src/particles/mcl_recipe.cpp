// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/mcl_recipe.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace locfuse::internal {
namespace {

void in_range(const char* name, double value, double low, double high) {
  if (!(value >= low && value <= high)) {
    throw std::invalid_argument("Mcl." + std::string(name) + " is " + std::to_string(value) +
                                ", expected " + std::to_string(low) + " to " +
                                std::to_string(high));
  }
}

const MclConfig& checked(const MclConfig& config) {
  in_range("min_particles", config.min_particles, 1, ParticleBelief::kMost);
  in_range("max_particles", config.max_particles, config.min_particles, ParticleBelief::kMost);
  in_range("kld_error", config.kld_error, 1e-6, 1.0);
  in_range("kld_quantile", config.kld_quantile, 0.0, 10.0);
  in_range("beams", config.beams, 1, 100000);
  in_range("independent_beams", config.independent_beams, 1e-3, 1e6);
  in_range("independent_beams_searching", config.independent_beams_searching, 1e-3, 1e6);
  in_range("sigma_map_m", config.sigma_map_m, 0.0, 1e3);
  in_range("sigma_map_rad", config.sigma_map_rad, 0.0, 10.0);
  in_range("effective_share", config.effective_share, 0.0, 1.0);
  in_range("outlier_share", config.outlier_share, 0.0, 0.999);
  in_range("resample_below", config.resample_below, 0.0, 1.0);
  in_range("spacing_m", config.spacing_m, 0.0, 1e6);
  in_range("spacing_heading_rad", config.spacing_heading_rad, 0.0, 1e6);
  in_range("most_gain", config.most_gain, 0.1, 1e6);
  in_range("most_drop", config.most_drop, 0.0, 1e6);
  in_range("min_explained", config.min_explained, 0.0, 1.0);
  in_range("scouts", config.scouts, 0, 100000);
  in_range("scout_draws", config.scout_draws, config.scouts, ParticleBelief::kMost);
  in_range("kidnapping_probability", config.kidnapping_probability, 0.0, 0.5);
  in_range("hold_s", config.hold_s, 1e-9, 1e9);
  in_range("sigma_lost_xy_per_sqrt_s", config.sigma_lost_xy_per_sqrt_s, 0.0, 1e6);
  in_range("sigma_lost_heading_per_sqrt_s", config.sigma_lost_heading_per_sqrt_s, 0.0, 1e6);
  in_range("probability_ready", config.probability_ready, 0.5, 1.0);
  in_range("sigma_xy_ready_m", config.sigma_xy_ready_m, 0.0, 1e6);
  in_range("sigma_heading_ready_rad", config.sigma_heading_ready_rad, 0.0, 10.0);
  in_range("sigma_widest_m", config.sigma_widest_m, config.field.sigma_hit_m, 1e3);
  in_range("bin_m", config.bin_m, 1e-3, 1e6);
  in_range("bin_headings", config.bin_headings, 1, 3600);
  BeamModel::checked(config.beam_model);
  validate(config.limits);
  return config;
}

OdometryMotion lost_motion(const MclConfig& config) {
  OdometryMotion::Config lost = config.odometry;
  lost.sigma_xy_per_sqrt_s = config.sigma_lost_xy_per_sqrt_s;
  lost.sigma_heading_per_sqrt_s = config.sigma_lost_heading_per_sqrt_s;
  return OdometryMotion(lost);
}

std::vector<std::int32_t> free_cells(const OccupancyGrid& grid) {
  std::vector<std::int32_t> free;
  for (std::size_t cell = 0; cell < grid.cells().size(); ++cell) {
    if (grid.cells()[cell] == Cell::kFree) {
      free.push_back(static_cast<std::int32_t>(cell));
    }
  }
  return free;
}

}  // namespace

std::shared_ptr<const MclRecipe> make_mcl_recipe(const MclConfig& config, const World& world) {
  const MclConfig& c = checked(config);
  const std::shared_ptr<const OccupancyGrid>& grid = world.grid;
  if (!grid) {
    throw std::invalid_argument("no map: an Mcl needs the grid of its world");
  }
  std::vector<LikelihoodField> fields = LikelihoodField::doubling(c.field, grid, c.sigma_widest_m);
  std::vector<std::int32_t> free = free_cells(*grid);
  std::optional<BeamModel> beams;
  if (c.likelihood == MclConfig::Likelihood::kBeams) {
    beams.emplace(c.beam_model, grid);
  }
  std::optional<RangeModel> range;
  if (world.anchors) {
    range.emplace(c.range, world.anchors, world.tags);
  }
  using Proposal = MclConfig::Proposal;
  const bool by_lines = c.proposal == Proposal::kLineEkf || c.proposal == Proposal::kLineEkfPaper;
  return std::make_shared<const MclRecipe>(MclRecipe{
      c, OdometryMotion(c.odometry), lost_motion(c), std::move(fields), std::move(beams),
      std::move(range), PositionModel(c.position, world.tags), PoseModel(c.pose),
      RangeBearingModel(c.landmark, world.landmarks.T_body_sensor), world.landmarks.map,
      static_cast<Stamp>(c.hold_s * kNanosecondsPerSecond), std::move(free),
      std::make_shared<Workers>(c.threads),
      c.proposal == Proposal::kScanMatch ? std::make_shared<const ScanMatcher>(grid) : nullptr,
      by_lines ? map_line_features(*grid) : std::vector<LineFeature>{}});
}

Pose2 MclRecipe::to_world(const Pose2& cells) const {
  const Vector<2> p = grid().to_world(cells.position());
  return {p.x(), p.y(), wrap_angle(cells.heading + grid().origin().heading)};
}

Pose2 MclRecipe::to_cells(const Pose2& world) const {
  const Vector<2> p = grid().to_grid(world.position());
  return {p.x(), p.y(), wrap_angle(world.heading - grid().origin().heading)};
}

Matrix<3, 3> MclRecipe::world_per_cell() const {
  const double c = grid().resolution() * std::cos(grid().origin().heading);
  const double s = grid().resolution() * std::sin(grid().origin().heading);
  Matrix<3, 3> scale = Matrix<3, 3>::Identity();
  scale.topLeftCorner<2, 2>() << c, -s, s, c;
  return scale;
}

Vector<2> MclRecipe::free_cell(double uniform) const {
  const std::int32_t cell =
      free[static_cast<std::size_t>(uniform * static_cast<double>(free.size()))];
  const std::int32_t column = cell % grid().width();
  const std::int32_t row = cell / grid().width();
  return {static_cast<double>(column), static_cast<double>(row)};
}

void MclRecipe::draw_free(ParticleBelief& belief, int k, std::uint64_t key) const {
  const std::uint64_t n = 4 * static_cast<std::uint64_t>(k);
  const Vector<2> corner = free_cell(random_uniform(key, n));
  belief.put(static_cast<std::size_t>(k),
             {corner.x() + random_uniform(key, n + 1), corner.y() + random_uniform(key, n + 2),
              2.0 * kPi * random_uniform(key, n + 3)});
}

ParticleBins MclRecipe::bins() const {
  return {config.bin_m / grid().resolution(), static_cast<double>(config.bin_headings)};
}

}  // namespace locfuse::internal
