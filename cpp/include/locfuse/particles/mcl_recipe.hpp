// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/estimators/pose_estimate.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/filters/gate.hpp"
#include "locfuse/filters/particle_bins.hpp"
#include "locfuse/filters/particles.hpp"
#include "locfuse/filters/workers.hpp"
#include "locfuse/frontends/line_features.hpp"
#include "locfuse/frontends/scan_matcher.hpp"
#include "locfuse/maps/landmark_map.hpp"
#include "locfuse/maps/occupancy_grid.hpp"
#include "locfuse/math/counter_random.hpp"
#include "locfuse/particles/mcl_config.hpp"

namespace locfuse::internal {

/// Keys of a counter-based random generator, one per use, reproducible from the seed.
class RandomKeys {
 public:
  explicit RandomKeys(std::uint64_t seed) : seed_(seed) {}
  std::uint64_t next() { return random_bits(seed_, step_++); }
  void skip() { ++step_; }

 private:
  std::uint64_t seed_;
  std::uint64_t step_ = 0;
};

/// The constant parts of an Mcl: settings, models and map. All copies of an Mcl share it.
struct MclRecipe {
  MclConfig config;
  OdometryMotion motion;
  OdometryMotion lost;                  ///< after the odometry timeout
  std::vector<LikelihoodField> fields;  ///< sigma_hit doubles from one to the next
  std::optional<BeamModel> beams;
  std::optional<RangeModel> range;
  PositionModel position;
  PoseModel pose;
  RangeBearingModel landmark;
  std::shared_ptr<const LandmarkMap> landmarks;  ///< or null
  Stamp hold;                                    ///< odometry timeout [ns]
  std::vector<std::int32_t> free;                ///< free cells, row by row
  std::shared_ptr<Workers> workers;
  std::shared_ptr<const ScanMatcher> matcher;  ///< null unless it is the proposal
  std::vector<LineFeature> walls;  ///< of the map, in world; empty unless lines are the proposal

  [[nodiscard]] const OccupancyGrid& grid() const { return fields.front().grid(); }
  /// Poses in cells, row by row from the corner of the map, and in world.
  [[nodiscard]] Pose2 to_world(const Pose2& cells) const;
  [[nodiscard]] Pose2 to_cells(const Pose2& world) const;
  /// Jacobian of to_world, 3x3.
  [[nodiscard]] Matrix<3, 3> world_per_cell() const;
  /// Lower corner of one of the free cells [cells], for `uniform` in [0, 1).
  [[nodiscard]] Vector<2> free_cell(double uniform) const;
  /// A pose uniform over free space and headings becomes particle k.
  void draw_free(ParticleBelief& belief, int k, std::uint64_t key) const;
  [[nodiscard]] ParticleBins bins() const;
};

/// Throws std::invalid_argument on a config out of range, and without a grid or with one that a
/// likelihood field cannot use.
[[nodiscard]] std::shared_ptr<const MclRecipe> make_mcl_recipe(const MclConfig& config,
                                                               const World& world);

}  // namespace locfuse::internal
