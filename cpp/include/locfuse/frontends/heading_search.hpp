// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "locfuse/frontends/scan_map.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Result of the heading search of ekim2020, Table 1.
struct HeadingSearch {
  static constexpr int kSteps = 36;

  enum class Reason {
    kFound,
    kNoReturns,   ///< no beam of the scan returned
    kOutsideMap,  ///< the position is not on the map
  };

  /// Of the body in world, a multiple of ten degrees in [-pi, pi). Empty unless found.
  std::optional<double> heading;

  /// Sums of the distances [m] from the end points to the nearest occupied cells, for headings of
  /// 0, 10, ..., 350 degrees. Zero unless found.
  std::array<double, kSteps> sums{};

  int returns = 0;         ///< beams that each sum is of
  double rms_range = 0.0;  ///< of them, from the laser [m]

  Reason reason = Reason::kFound;
};

/// Heading, of 36 in steps of ten degrees about `position` (of the body in world, [m]), with the
/// smallest sum of nearest distances; the first of equal ones. Nearest cells are exact, by PCL's
/// kd-tree.
///
/// Throws std::invalid_argument if the scan is not valid or the position not finite.
[[nodiscard]] HeadingSearch heading_search(const ScanMap& map, const LaserScan& scan,
                                           const Vector<2>& position);

/// The same with distances looked up in the field: accurate to half a cell's diagonal, and to three
/// cells more than a metre off the map.
[[nodiscard]] HeadingSearch heading_search_by_lookup(const ScanMap& map, const LaserScan& scan,
                                                     const Vector<2>& position);

}  // namespace locfuse
