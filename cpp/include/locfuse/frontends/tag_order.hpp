// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "locfuse/maps/tags.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Whether fixes of three tags fit the triangle that the tags make on the body.
enum class TagOrderVerdict : std::uint8_t {
  kFits,       ///< with the ids they bear
  kSwapped,    ///< only with other ids, and only these: some were swapped
  kAmbiguous,  ///< only with other ids, several of them
  kNoFit,      ///< with no ids: a wrong fix, or not these tags
};

/// Which tag is which: docs/models/rigid_fit.md eq. (8).
struct TagOrder {
  TagOrderVerdict verdict = TagOrderVerdict::kNoFit;
  std::array<Id, 3> given{};  ///< the ids of the fixes
  std::array<Id, 3> ids{};    ///< those that fit best, in the order of the fixes
  double nis = 0.0;           ///< of the ids given, 3 degrees of freedom
  double limit = 0.0;         ///< what that may be
  double best = 0.0;          ///< nis of `ids`
};

/// Tries the fixes of three tags of one epoch on the triangle in every order. `probability` is
/// that of a right order to pass.
///
/// Throws std::invalid_argument unless there are three tags, and one fix of each with one stamp.
[[nodiscard]] TagOrder tag_order(const std::vector<Tag>& tags,
                                 const std::vector<PositionFix>& fixes, double probability = 0.999);

/// What is wrong, in words: names the ids that would fit.
[[nodiscard]] std::string to_string(const TagOrder& order);

}  // namespace locfuse
