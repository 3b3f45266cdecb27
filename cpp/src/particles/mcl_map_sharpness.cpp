// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/mcl_map_sharpness.hpp"

#include <algorithm>
#include <cmath>

#include "particles/mcl_tuning.hpp"

namespace locfuse::internal {

void MapSharpness::reset() {
  evidence_.clear();
  explained_ = 0.0;
  mean_explained_ = 1.0;
  widen();
}

bool MapSharpness::update(const EndPoints& points, const PoseEstimate& here,
                          double particle_spacing) {
  const EndPoints seen = points.seen_from(recipe_->to_cells(here.pose));
  average_evidence(seen, points.x.size());
  const auto likeliest = static_cast<std::size_t>(
      std::max_element(evidence_.begin(), evidence_.end()) - evidence_.begin());
  std::size_t fitting = likeliest;
  // Under a field narrower than the estimate, or than particles are apart, chance decides: no
  // particle is at the true pose.
  const Matrix<3, 3>& P = here.covariance;
  const double spread = std::max(std::sqrt(std::max(P(0, 0), P(1, 1))), particle_spacing);
  while (fitting + 1 < recipe_->fields.size() &&
         recipe_->fields[fitting].config().sigma_hit_m < spread) {
    ++fitting;
  }
  level_ = fitting < level_ ? level_ - 1 : fitting;
  explained_ = recipe_->fields.back().explained(seen);
  mean_explained_ += MapSharpnessTuning::kExplainedWeight * (explained_ - mean_explained_);
  return level_ <= likeliest && spread < MapSharpnessTuning::kSettledSigma * sigma_hit();
}

/// Averages the mean log density of end points under each field.
void MapSharpness::average_evidence(const EndPoints& seen, std::size_t count) {
  const bool first = evidence_.empty();
  std::vector<double> sums(recipe_->fields.size(), 0.0);
  evidence_.resize(sums.size(), 0.0);
  for (std::size_t k = 0; k < seen.x.size(); ++k) {
    for (std::size_t l = 0; l < sums.size(); ++l) {
      sums[l] += recipe_->fields[l].log_density(seen.x[k], seen.y[k]);
    }
  }
  for (std::size_t l = 0; l < evidence_.size(); ++l) {
    const double now = sums[l] / static_cast<double>(count);
    evidence_[l] =
        first ? now : evidence_[l] + MapSharpnessTuning::kEvidenceWeight * (now - evidence_[l]);
  }
  const double now = *std::max_element(evidence_.begin(), evidence_.end());
  usual_evidence_ =
      first ? now
            : usual_evidence_ + MapSharpnessTuning::kUsualEvidenceWeight * (now - usual_evidence_);
}

bool MapSharpness::fit_is_nominal() const {
  return evidence_.empty() || (mean_explained_ >= recipe_->config.min_explained &&
                               *std::max_element(evidence_.begin(), evidence_.end()) >=
                                   usual_evidence_ - recipe_->config.most_drop);
}

}  // namespace locfuse::internal
