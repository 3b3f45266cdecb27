// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "locfuse/math/linearization.hpp"

/// Which sighting is of which landmark, by squared Mahalanobis distance under a belief's
/// covariance. Derivation: docs/models/landmarks.md.
namespace locfuse {

/// A sighting that a landmark may have caused, and what it would say then.
struct Pairing {
  int landmark = 0;                                   ///< index that the caller knows it by
  Linearization<Eigen::Dynamic, Eigen::Dynamic> lin;  ///< with respect to `rows` of the belief
  std::vector<int> rows;
  double nis = 0.0;  ///< r' S^-1 r, filled in by `compare`
};

/// Of each sighting the pairings that a gate lets pass by themselves.
using Pairings = std::vector<std::vector<Pairing>>;

/// Index into a sighting's pairings, or -1: it is of none of them.
using Assignment = std::vector<int>;

/// Which landmark a sighting without a name is of.
enum class Association : std::uint8_t {
  kNearest,  ///< the nearest, each by itself
  kGlobal,   ///< minimum sum of NIS over all sightings
  kJoint,    ///< the largest set that fits jointly
};

/// Fills in `nis` of each pairing under the covariance P, eq. (2.1), and drops those beyond the
/// gate of that probability, and those whose NIS is not finite whatever the gate. Throws
/// NumericalError if an S is not positive definite.
void compare(const Eigen::MatrixXd& P, double probability, Pairings& pairings);

/// To each sighting its nearest landmark; if several want the same one, the nearest gets it.
[[nodiscard]] Assignment nearest_neighbour(const Pairings& pairings);

/// As many pairs as possible that use no landmark twice, and of those the minimum sum of NIS
/// (Hungarian method). A NIS that is NaN, or too large to be summed, makes no pair.
[[nodiscard]] Assignment global_nearest_neighbour(const Pairings& pairings);

/// The largest set of pairs that fits jointly, all correlations counted, and of those the one with
/// the minimum joint NIS: eq. (2.2), by branch and bound (Neira and Tardos, 2001). Where too much
/// fits, it ends after trying 100,000 pairs: with the best set that it found, at least those pairs
/// of `global_nearest_neighbour` that fit jointly one after the other.
[[nodiscard]] Assignment joint_compatibility(const Eigen::MatrixXd& P, const Pairings& pairings,
                                             double probability);

/// Whichever of the three is named.
[[nodiscard]] Assignment associate(Association association, const Eigen::MatrixXd& P,
                                   const Pairings& pairings, double probability);

}  // namespace locfuse
