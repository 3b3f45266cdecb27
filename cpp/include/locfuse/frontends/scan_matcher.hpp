// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "locfuse/frontends/heading_search.hpp"
#include "locfuse/frontends/scan_map.hpp"

namespace locfuse {

struct ScanMatcherConfig {
  double sigma_range_m = 0.01;      ///< noise of one beam
  double outlier_share = 0.1;       ///< returns from things that are not on the map
  double no_return_share = 0.1;     ///< beams that should come back and do not
  double wrong_probability = 1e-3;  ///< that the other hypotheses may keep when one is `ready`
  double min_explained = 0.5;       ///< share of the returns that a pose must explain
  int max_hypotheses = 8;           ///< that a search returns
  int max_iterations = 30;          ///< of one refinement
  bool exact_neighbours = false;    ///< nearest cell of each end point, not of the cell it is in
};

/// Where a scan fits the map next to a guess.
struct ScanMatch {
  enum class Reason {
    kConverged,
    kNoReturns,      ///< no beam of the scan came back
    kOutsideMap,     ///< the guess, or where it led, is not on the map
    kTooFewMatches,  ///< fewer returns near a wall than a pose needs
    kNoConvergence,  ///< still moving after max_iterations
  };

  Pose2 pose;              ///< T_world_body; the guess unless `converged`
  bool converged = false;  ///< without it, only `reason` and `iterations` say something
  Reason reason = Reason::kNoReturns;
  int iterations = 0;
  double explained = 0.0;  ///< share of the returns that end within two cells or 3 sigma of a wall
  double rms = 0.0;        ///< of their distances to the wall lines [m]

  /// What the scan alone says of (x, y, heading); zero along `weak_direction`.
  Matrix<3, 3> information = Matrix<3, 3>::Zero();

  /// Of (x, y, heading), scan and prior together. Empty if a direction is known from neither.
  std::optional<Matrix<3, 3>> covariance;

  /// What the scan does not say: a change of (x, y, heading) of length 1 (a radian counts as the
  /// typical range) that it would not see, as along a corridor.
  std::optional<Vector<3>> weak_direction;
};

/// One pose at which the scan fits, with its standing among the others.
struct ScanHypothesis {
  ScanMatch match;
  double cost = 0.0;         ///< minus log of likelihood and prior; 0 is a perfect fit
  double probability = 0.0;  ///< among the hypotheses found; docs/models/scan_matching.md eq. (9)
};

struct ScanSearch {
  enum class Status { kReady, kAmbiguous, kNone };
  enum class Reason {
    kUnique,             ///< the others together are less likely than wrong_probability
    kSeveralFit,         ///< they are not
    kHeadingUnobserved,  ///< the scan looks the same from any heading
    kPoorFit,            ///< no pose explains min_explained of the returns
    kNoReturns,          ///< no beam of the scan came back
    kOutsideMap,         ///< the window has no place on the map where a body may be
  };

  Status status = Status::kNone;
  Reason reason = Reason::kNoReturns;
  std::vector<ScanHypothesis> hypotheses;  ///< likeliest first
};

/// Finds a body on a map from single scans; docs/models/scan_matching.md. Immutable.
class ScanMatcher {
 public:
  /// Throws std::invalid_argument if there is no map or it has no occupied cell, or on a setting
  /// out of bounds.
  explicit ScanMatcher(const std::shared_ptr<const OccupancyGrid>& grid,
                       const ScanMatcherConfig& config = {});

  [[nodiscard]] const ScanMap& map() const { return *map_; }
  [[nodiscard]] const ScanMatcherConfig& config() const { return config_; }

  /// Point-to-line fit over (x, y, heading) next to `guess`, eq. (4) to (7). With a `covariance` of
  /// the guess (3x3, positive definite), the guess is a prior, too.
  ///
  /// It finds poses within 20 cm and 5 degrees; further off it may find another one. Throws
  /// std::invalid_argument if scan, guess or covariance are not valid.
  [[nodiscard]] ScanMatch refine(const LaserScan& scan, const Pose2& guess,
                                 const std::optional<Matrix<3, 3>>& covariance = {}) const;

  /// Every pose within three sigma of `position` (of the body, in world) at which the scan fits, at
  /// any heading. Throws std::invalid_argument if scan, position or covariance are not valid.
  [[nodiscard]] ScanSearch search(const LaserScan& scan, const Vector<2>& position,
                                  const Matrix<2, 2>& covariance) const;

 private:
  std::shared_ptr<const ScanMap> map_;
  ScanMatcherConfig config_;
};

}  // namespace locfuse
