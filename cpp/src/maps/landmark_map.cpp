// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/landmark_map.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "maps/max_length.hpp"

namespace locfuse {
namespace {

using internal::kMaxLength;

}  // namespace

LandmarkMap::LandmarkMap(std::vector<Landmark> landmarks) : landmarks_(std::move(landmarks)) {
  std::sort(landmarks_.begin(), landmarks_.end(),
            [](const Landmark& a, const Landmark& b) { return a.id < b.id; });
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    const Landmark& landmark = landmarks_[i];
    const std::string name = "landmark " + std::to_string(landmark.id);
    if (i > 0 && landmarks_[i - 1].id == landmark.id) {
      throw std::invalid_argument(name + " is given twice");
    }
    if (!((landmark.position.array().abs() <= kMaxLength).all() &&
          std::abs(landmark.height) <= kMaxLength)) {
      throw std::invalid_argument(name + " has a position that is not finite, or over 1e12 m");
    }
    if (!(landmark.radius >= 0.0 && landmark.radius <= kMaxLength)) {
      throw std::invalid_argument(name + " has radius " + std::to_string(landmark.radius) +
                                  " m, expected a finite number >= 0");
    }
  }
}

const Landmark* LandmarkMap::find(Id id) const {
  const auto index = static_cast<std::size_t>(id);
  if (index < landmarks_.size() && landmarks_[index].id == id) {
    return &landmarks_[index];
  }
  const auto it = std::lower_bound(landmarks_.begin(), landmarks_.end(), id,
                                   [](const Landmark& a, Id wanted) { return a.id < wanted; });
  return it != landmarks_.end() && it->id == id ? &*it : nullptr;
}

}  // namespace locfuse
