// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Fixed object that a sensor detects: a pole, a trunk, a column.
struct Landmark {
  Id id = 0;
  Vector<2> position = Vector<2>::Zero();  ///< of its centre, in world [m]
  double radius = 0.0;                     ///< [m]
  double height = 0.0;                     ///< of the point that a flying body observes [m]
};

/// Landmarks by id. Immutable; share it by std::shared_ptr<const LandmarkMap>.
class LandmarkMap {
 public:
  LandmarkMap() = default;

  /// Throws std::invalid_argument on a duplicate id, a position or height that is not finite, or a
  /// radius that is not finite or negative.
  explicit LandmarkMap(std::vector<Landmark> landmarks);

  /// The landmark, or null if it is not in the map. O(1) if the ids are 0, 1, 2, ..., else
  /// O(log n).
  [[nodiscard]] const Landmark* find(Id id) const;

  /// All landmarks in order of id.
  [[nodiscard]] const std::vector<Landmark>& landmarks() const { return landmarks_; }

 private:
  std::vector<Landmark> landmarks_;
};

}  // namespace locfuse
