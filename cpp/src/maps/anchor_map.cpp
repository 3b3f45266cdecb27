// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/anchor_map.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "maps/max_length.hpp"

namespace locfuse {
namespace {

using internal::kMaxLength;
constexpr double kMinScale = 1e-6;  // of ranges
constexpr double kMaxScale = 1e6;

}  // namespace

AnchorMap::AnchorMap(std::vector<Anchor> anchors) : anchors_(std::move(anchors)) {
  std::sort(anchors_.begin(), anchors_.end(),
            [](const Anchor& a, const Anchor& b) { return a.id < b.id; });
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const Anchor& anchor = anchors_[i];
    const std::string name = "anchor " + std::to_string(anchor.id);
    if (i > 0 && anchors_[i - 1].id == anchor.id) {
      throw std::invalid_argument(name + " is given twice");
    }
    if (!((anchor.position.array().abs() <= kMaxLength).all() &&
          std::abs(anchor.offset) <= kMaxLength)) {
      throw std::invalid_argument(
          name + " has a position or an offset that is not finite, or over 1e12 m");
    }
    if (!(anchor.scale >= kMinScale && anchor.scale <= kMaxScale)) {
      throw std::invalid_argument(name + " has scale " + std::to_string(anchor.scale) +
                                  ", expected a number from 1e-6 to 1e6");
    }
  }
}

const Anchor* AnchorMap::search(Id id) const {
  const auto it = std::lower_bound(anchors_.begin(), anchors_.end(), id,
                                   [](const Anchor& a, Id wanted) { return a.id < wanted; });
  return it != anchors_.end() && it->id == id ? &*it : nullptr;
}

}  // namespace locfuse
