// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "locfuse/particles/mcl_recipe.hpp"

namespace locfuse::internal {

/// Chooses the likelihood field whose sigma_hit fits the map, and watches how well scans fit;
/// eq. (2.2) of docs/models/particles.md.
class MapSharpness {
 public:
  explicit MapSharpness(std::shared_ptr<const MclRecipe> recipe) : recipe_(std::move(recipe)) {}

  /// Forgets all scans; the widest field comes first.
  void reset();
  /// Goes back to the widest field.
  void widen() { level_ = recipe_->fields.size() - 1; }
  /// Evaluates a scan at the estimate and moves a field towards the one that fits best, but none
  /// narrower than the estimate or `particle_spacing` [m]. Returns whether the field in use is as
  /// narrow as the likeliest one, and the estimate narrower.
  bool update(const EndPoints& points, const PoseEstimate& here, double particle_spacing);

  /// Index of the field in use.
  [[nodiscard]] std::size_t level() const { return level_; }
  [[nodiscard]] const LikelihoodField& field() const { return recipe_->fields[level_]; }
  [[nodiscard]] double sigma_hit() const { return field().config().sigma_hit_m; }
  /// Whether scans fit at the estimate as well as usual (config.most_drop, config.min_explained).
  [[nodiscard]] bool fit_is_nominal() const;
  /// Share of the last scan's end points that a wall explains.
  [[nodiscard]] double explained() const { return explained_; }

 private:
  void average_evidence(const EndPoints& seen, std::size_t count);

  std::shared_ptr<const MclRecipe> recipe_;
  std::vector<double> evidence_;  // mean log density of an end point, per field, averaged [nats]
  std::size_t level_ = 0;
  double explained_ = 0.0;
  double mean_explained_ = 1.0;
  double usual_evidence_ = 0.0;  // of the field that fits best, slowly averaged [nats]
};

}  // namespace locfuse::internal
