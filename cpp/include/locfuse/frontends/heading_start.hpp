// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/frontends/multilateration.hpp"
#include "locfuse/frontends/scan_matcher.hpp"

/// The start of ekim2020, section 2.2: a position by SR-LS, then the heading from one scan.
/// Derivation: docs/start.md, eq. (4) to (8).
namespace locfuse {

/// Position of a tag in world from one range per anchor, by SR-LS.
///
/// kUnique where the ranges determine it: three of them, of anchors well off a line (kAmbiguous)
/// and not in one place (kUnderdetermined). If they disagree more than `sigma` says, the covariance
/// is larger by as much, eq. (4). Throws std::invalid_argument if `validate` does, or if a range is
/// not a length.
[[nodiscard]] RangePosition<2> locate_by_squares(const AnchorTable& anchors,
                                                 const RangesView& ranges, const RangesView& sigma);

/// Where the scan was turned about, and how well that is known.
struct Pivot {
  Vector<2> position = Vector<2>::Zero();  ///< in world [m]
  double sigma = 0.0;                      ///< along the least certain direction [m]
  Vector<2> in_body = Vector<2>::Zero();   ///< of the same point, when the scan was taken [m]
};

/// Headings at which a scan fits the map.
struct HeadingStart {
  HeadingSearch search;
  std::vector<double> headings;  ///< of the body in world, the best first [rad]
  double sigma = 0.0;            ///< of each, eq. (7) [rad]
  double distance = 0.0;  ///< mean distance of end points from walls at the best, eq. (5) [m]
  double limit = 0.0;     ///< above which it does not fit, eq. (8) [m]
};

/// Turns a scan by ten degrees 36 times about `pivot`. No heading fits if no beam returned, the
/// pivot is off the map, or `distance` is above `limit`; several do where their distances differ by
/// less than the pivot's sigma makes, eq. (6).
///
/// Throws std::invalid_argument if the scan is not valid or the pivot not finite.
[[nodiscard]] HeadingStart start_by_headings(const ScanMatcher& matcher, const LaserScan& scan,
                                             const Pivot& pivot);

}  // namespace locfuse
