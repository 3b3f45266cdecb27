// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/tags.hpp"

#include <stdexcept>
#include <string>
#include <utility>

namespace locfuse {
namespace {

constexpr double kMaxLever = 1e6;  // magnitude of a coordinate in body [m]

}  // namespace

Tags::Tags(std::vector<Tag> tags) : tags_(std::move(tags)) {
  for (const Tag& tag : tags_) {
    if (!(tag.position.array().abs() <= kMaxLever).all()) {
      throw std::invalid_argument("tag " + std::to_string(tag.id) +
                                  " has a position that is not finite, or over 1e6 m");
    }
    if (find(tag.id) != &tag) {
      throw std::invalid_argument("tag " + std::to_string(tag.id) + " is given twice");
    }
  }
}

}  // namespace locfuse
