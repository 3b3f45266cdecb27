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
  kFits,       ///< with the ids they have
  kSwapped,    ///< only with one other order of ids: some were swapped
  kAmbiguous,  ///< only with other ids, in several orders
  kNoFit,      ///< in no order: a wrong fix, or other tags
};

/// Assignment of fixes to tags: docs/models/poses.md eq. (4.8).
struct TagOrder {
  TagOrderVerdict verdict = TagOrderVerdict::kNoFit;
  std::array<Id, 3> given{};  ///< ids of the fixes
  std::array<Id, 3> ids{};    ///< ids that fit best, in the order of the fixes
  double nis = 0.0;           ///< of the given ids, 3 degrees of freedom
  double limit = 0.0;         ///< maximum nis
  double best = 0.0;          ///< nis of `ids`
};

/// Fits the fixes of three tags of one epoch to the triangle in every order. `probability` is the
/// one with which the correct order passes.
///
/// Throws std::invalid_argument unless there are three tags, and one fix of each with one stamp.
[[nodiscard]] TagOrder tag_order(const std::vector<Tag>& tags,
                                 const std::vector<PositionFix>& fixes, double probability = 0.999);

/// Text of the verdict, with the ids that would fit.
[[nodiscard]] std::string to_string(const TagOrder& order);

}  // namespace locfuse
