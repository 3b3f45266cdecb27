// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/measurement/range.hpp"

#include <stdexcept>
#include <string>
#include <utility>

namespace locfuse {

RangeModel::RangeModel(const Config& config, std::shared_ptr<const AnchorMap> anchors,
                       std::vector<Tag> tags)
    : variance_(config.sigma_m * config.sigma_m),
      relative_variance_(config.sigma_relative * config.sigma_relative),
      anchors_(std::move(anchors)),
      tags_(std::move(tags)) {
  const bool sigmas_ok = std::isfinite(config.sigma_m) && config.sigma_m >= 0.0 &&
                         std::isfinite(config.sigma_relative) && config.sigma_relative >= 0.0 &&
                         variance_ + relative_variance_ > 0.0;
  if (!sigmas_ok) {
    throw std::invalid_argument(
        "range.sigma_m is " + std::to_string(config.sigma_m) + " and range.sigma_relative is " +
        std::to_string(config.sigma_relative) + ", expected finite numbers >= 0, not both 0");
  }
  if (!anchors_) {
    throw std::invalid_argument("RangeModel needs an AnchorMap, got none");
  }
  for (std::size_t i = 0; i < tags_.size(); ++i) {
    if (!tags_[i].position.allFinite()) {
      throw std::invalid_argument("tag " + std::to_string(tags_[i].id) +
                                  " has a position that is not finite");
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (tags_[i].id == tags_[j].id) {
        throw std::invalid_argument("tag " + std::to_string(tags_[i].id) + " is given twice");
      }
    }
  }
}

std::optional<double> RangeModel::predict(const Pose2& T_world_body, double height,
                                          const Range& z) const {
  const Anchor* anchor = anchors_->find(z.anchor);
  const Tag* tag = find_tag(z.tag);
  if (anchor == nullptr || tag == nullptr) {
    return std::nullopt;
  }
  Vector<3> tag_in_world;
  tag_in_world << T_world_body.act(tag->position.head<2>()), tag->position.z() + height;
  return anchor->scale * (tag_in_world - anchor->position).norm() + anchor->offset;
}

}  // namespace locfuse
