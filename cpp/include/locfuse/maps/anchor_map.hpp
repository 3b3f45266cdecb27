// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Fixed radio; ranges to it are z = scale * distance + offset.
struct Anchor {
  Id id = 0;
  Vector<3> position = Vector<3>::Zero();  ///< in world [m]
  double offset = 0.0;                     ///< constant range error [m]
  double scale = 1.0;                      ///< proportional range error
};

/// Anchors by id. Immutable; share it by std::shared_ptr<const AnchorMap>.
class AnchorMap {
 public:
  AnchorMap() = default;

  /// Throws std::invalid_argument on a duplicate id, a position or offset that is not finite, or a
  /// scale that is not positive.
  explicit AnchorMap(std::vector<Anchor> anchors);

  /// The anchor, or null if it is not in the map. O(1) if the ids are 0, 1, 2, ..., else O(log n).
  [[nodiscard]] const Anchor* find(Id id) const {
    const auto index = static_cast<std::size_t>(id);
    if (index < anchors_.size() && anchors_[index].id == id) {
      return &anchors_[index];
    }
    return search(id);
  }

  /// All anchors in order of id.
  [[nodiscard]] const std::vector<Anchor>& anchors() const { return anchors_; }

 private:
  [[nodiscard]] const Anchor* search(Id id) const;

  std::vector<Anchor> anchors_;
};

}  // namespace locfuse
