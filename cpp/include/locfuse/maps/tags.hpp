// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Radio on the robot.
struct Tag {
  Id id = 0;
  Vector<3> position = Vector<3>::Zero();  ///< in body: forward, left, up [m]
};

/// Radios of a robot and their positions on its body.
class Tags {
 public:
  Tags() = default;

  /// Throws std::invalid_argument if an id is given twice or a position is not finite.
  explicit Tags(std::vector<Tag> tags);

  /// The tag of that id, or null.
  [[nodiscard]] const Tag* find(Id id) const {
    for (const Tag& tag : tags_) {
      if (tag.id == id) {
        return &tag;
      }
    }
    return nullptr;
  }
  [[nodiscard]] const std::vector<Tag>& all() const { return tags_; }

 private:
  std::vector<Tag> tags_;
};

}  // namespace locfuse
