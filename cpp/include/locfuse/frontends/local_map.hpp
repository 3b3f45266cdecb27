// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "locfuse/frontends/scan_matcher.hpp"

namespace locfuse {

namespace internal {
class LineCloud;
}

struct LocalMapConfig {
  double sigma_range_m = 0.01;  ///< noise of one beam
  double max_distance_m = 1.0;  ///< from the end of a beam to what it is matched with
  double trimmed_share = 0.1;   ///< of the matches, the worst, left out if they are off 3 sigma
  double min_explained = 0.5;   ///< share of the returns; below it the fit is searched anew
  int max_iterations = 30;      ///< of one fit
};

/// A scan and where it was taken, T_map_body.
struct PlacedScan {
  LaserScan scan;
  Pose2 pose;
};

/// The ends of the beams of one scan or a few, to fit another scan to: scan to scan, scan to local
/// map. docs/models/scan_matching.md eq. (10) to (13). Immutable, cheap to copy.
class LocalMap {
 public:
  /// Throws std::invalid_argument on a setting out of bounds, or a scan or pose that is not valid.
  explicit LocalMap(const std::vector<PlacedScan>& scans, const LocalMapConfig& config = {});

  [[nodiscard]] const LocalMapConfig& config() const { return config_; }

  /// Fits a scan next to `guess` (T_map_body): to the line through the nearest end and its
  /// neighbours, or, where these are on no line, to that end itself. Neighbours are exact, by PCL's
  /// kd-tree.
  ///
  /// It finds poses within 20 cm and 5 degrees. With a `covariance` of the guess (3x3, positive
  /// definite) the guess is a prior, too; and if it may be further off, or the fit explains too
  /// little, a search over three sigma of the position and all headings gives another start. An
  /// empty map matches nothing: kTooFewMatches. Throws std::invalid_argument if scan, guess or
  /// covariance are not valid.
  [[nodiscard]] ScanMatch match(const LaserScan& scan, const Pose2& guess,
                                const std::optional<Matrix<3, 3>>& covariance = {}) const;

 private:
  LocalMapConfig config_;
  std::shared_ptr<const internal::LineCloud> cloud_;
};

}  // namespace locfuse
