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
  double max_distance_m = 1.0;  ///< from the end of a beam to its match
  double trimmed_share = 0.1;   ///< share of the worst matches, left out if they are off by 3 sigma
  double min_explained = 0.5;   ///< share of the returns; below it a search gives another start
  int max_iterations = 30;      ///< of one fit
};

/// A scan and its pose T_map_body.
struct PlacedScan {
  LaserScan scan;
  Pose2 pose;
};

/// End points of one or several scans, for matching another one: scan to scan, scan to local map.
/// docs/models/scans.md eq. (1.10) to (1.13). Immutable, cheap to copy.
class LocalMap {
 public:
  /// Throws std::invalid_argument on a setting out of bounds, or a scan or pose that is not valid.
  explicit LocalMap(const std::vector<PlacedScan>& scans, const LocalMapConfig& config = {});

  [[nodiscard]] const LocalMapConfig& config() const { return config_; }

  /// Matches a scan near `guess` (T_map_body): each end point to the line through the nearest one
  /// and its neighbours, or, where these are not on a line, to the nearest one itself. Nearest
  /// neighbours are exact, by PCL's kd-tree.
  ///
  /// Converges from errors of up to 20 cm and 5 degrees. With a `covariance` (3x3, positive
  /// definite) the guess is also a prior; if its uncertainty is larger, or the fit explains too
  /// little, a search over three sigma of the position and all headings gives another start. With
  /// an empty map the reason is kTooFewMatches. Throws std::invalid_argument if scan, guess or
  /// covariance are not valid.
  [[nodiscard]] ScanMatch match(const LaserScan& scan, const Pose2& guess,
                                const std::optional<Matrix<3, 3>>& covariance = {}) const;

 private:
  LocalMapConfig config_;
  std::shared_ptr<const internal::LineCloud> cloud_;
};

}  // namespace locfuse
