// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "locfuse/frontends/heading_search.hpp"
#include "locfuse/frontends/scan_map.hpp"

namespace locfuse {

struct ScanMatcherConfig {
  double sigma_range_m = 0.01;   ///< noise of one beam
  double outlier_share = 0.1;    ///< share of returns from objects that are not on the map
  double no_return_share = 0.1;  ///< share of beams that should return and do not
  double wrong_probability =
      1e-3;                    ///< maximum probability of the other hypotheses when one is `ready`
  double min_explained = 0.5;  ///< minimum share of the returns that a pose explains
  int max_hypotheses = 8;      ///< of a search
  int max_iterations = 30;     ///< of one refinement
  bool exact_neighbours =
      false;  ///< nearest cell of each end point itself, not of the centre of its cell
};

/// Match of a scan with the map near a guess.
struct ScanMatch {
  enum class Reason {
    kConverged,
    kNoReturns,      ///< no beam of the scan returned
    kOutsideMap,     ///< the guess, or the pose during the fit, is not on the map
    kTooFewMatches,  ///< too few returns near a wall for a pose
    kNoConvergence,  ///< still moving after max_iterations
  };

  Pose2 pose;              ///< T_world_body; the guess unless `converged`
  bool converged = false;  ///< if not, only `reason` and `iterations` are valid
  Reason reason = Reason::kNoReturns;
  int iterations = 0;
  double explained = 0.0;  ///< share of the returns that end within two cells or 3 sigma of a wall
  double rms = 0.0;        ///< of their distances to the wall lines [m]

  /// Information of the scan alone on (x, y, heading); zero along `weak_direction`.
  Matrix<3, 3> information = Matrix<3, 3>::Zero();

  /// Covariance of (x, y, heading) from scan and prior. Empty if neither observes a direction.
  std::optional<Matrix<3, 3>> covariance;

  /// Direction that the scan does not observe, as along a corridor: a change of (x, y, heading) of
  /// length 1 (a radian counts as the typical range).
  std::optional<Vector<3>> weak_direction;
};

/// One pose at which the scan fits, with its probability.
struct ScanHypothesis {
  ScanMatch match;
  double cost = 0.0;         ///< negative log of likelihood and prior; 0 is a perfect fit
  double probability = 0.0;  ///< among the hypotheses found; docs/models/scans.md eq. (1.9)
};

struct ScanSearch {
  enum class Status { kReady, kAmbiguous, kNone };
  enum class Reason {
    kUnique,             ///< the others together are less likely than wrong_probability
    kSeveralFit,         ///< several poses fit: the others are likelier than that
    kHeadingUnobserved,  ///< the scan looks the same from any heading
    kPoorFit,            ///< no pose explains min_explained of the returns
    kNoReturns,          ///< no beam of the scan returned
    kOutsideMap,         ///< the window does not overlap the map
  };

  Status status = Status::kNone;
  Reason reason = Reason::kNoReturns;
  std::vector<ScanHypothesis> hypotheses;  ///< likeliest first
};

/// Localizes a body on a map from single scans; docs/models/scans.md. Immutable.
class ScanMatcher {
 public:
  /// Throws std::invalid_argument if there is no map or it has no occupied cell, or on a setting
  /// out of bounds.
  explicit ScanMatcher(const std::shared_ptr<const OccupancyGrid>& grid,
                       const ScanMatcherConfig& config = {});

  [[nodiscard]] const ScanMap& map() const { return *map_; }
  [[nodiscard]] const ScanMatcherConfig& config() const { return config_; }

  /// Point-to-line fit over (x, y, heading) near `guess`, eq. (1.4) to (1.7). With a `covariance`
  /// (3x3, positive definite) the guess is also a prior.
  ///
  /// Converges from errors of up to 20 cm and 5 degrees; from larger ones possibly to another pose.
  /// Throws std::invalid_argument if scan, guess or covariance are not valid.
  [[nodiscard]] ScanMatch refine(const LaserScan& scan, const Pose2& guess,
                                 const std::optional<Matrix<3, 3>>& covariance = {}) const;

  /// Poses with any heading within three sigma of `position` (of the body, in world) at which the
  /// scan fits. Throws std::invalid_argument if scan, position or covariance are not valid.
  [[nodiscard]] ScanSearch search(const LaserScan& scan, const Vector<2>& position,
                                  const Matrix<2, 2>& covariance) const;

 private:
  std::shared_ptr<const ScanMap> map_;
  ScanMatcherConfig config_;
};

}  // namespace locfuse
