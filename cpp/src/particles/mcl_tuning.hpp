// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// Constants of an Mcl that are not settings. Equations are those of docs/models/particles.md.
namespace locfuse::internal {

struct ParticleFilterTuning {
  static constexpr int kMaxClusters = 32;
  /// Particles that a global start draws for each one of config.max_particles, and how many at
  /// most; section "From nothing".
  static constexpr int kGlobalDraws = 16;
  static constexpr int kMaxGlobalDraws = 1 << 20;
  /// Heading side over position side of the box that such a particle stands for [rad / m].
  static constexpr double kBoxTurnPerMetre = 2.0;
  /// Exponent of a bin's weight in its number of particles, and the weight below which a bin is
  /// dropped; equation 7 of the page on particles.
  static constexpr double kBinPower = 0.5;
  static constexpr double kMinBinWeight = 1e-9;
  /// Pending motion beyond which particles move without waiting for a measurement [m], [rad].
  static constexpr double kMaxPendingDistance = 0.5;
  static constexpr double kMaxPendingTurn = 0.3;
  /// Minimum ratio of the next number of particles to the last one.
  static constexpr double kMinShrinkage = 0.5;
  /// Minimum sigma of a cluster [m], [rad]: particles in one place have no covariance.
  static constexpr double kMinClusterSigma = 1e-6;
  /// Share of summed variances that rounding may leave in a difference of them.
  static constexpr double kVarianceRounding = 1e-14;
  /// Log likelihood of an outlier per row: as of four sigmas [nats].
  static constexpr double kOutlierLogLikelihood = -8.0;
};

/// Section "Drawing where the scan says".
struct LineProposalTuning {
  /// Confidence of the gate by which a line is taken for a wall.
  static constexpr double kGateConfidence = 0.99;
  /// Distance that a line may be seen beyond the end of its wall [m].
  static constexpr double kBeyondWall = 0.5;
  /// Standard deviations of all particles within which walls are candidates.
  static constexpr double kCandidateSigmas = 7.0;
  /// Angle between a line and its wall, at most [rad].
  static constexpr double kMaxTurn = 0.5;
  /// Sum of the variances of a motion above which lines say nothing of where particles are.
  static constexpr double kMaxVariance = 100.0;
};

struct TrackingTuning {
  /// Scans that are used without motion after a start.
  static constexpr int kStationaryScans = 10;
  /// Probability above which the likeliest cluster stays the tracked one.
  static constexpr double kMinProbability = 0.5;
};

struct MapSharpnessTuning {
  /// Weight of a scan in the running means of: the evidence for each field (5 scans), the usual
  /// evidence (50 scans), the explained share (10 scans).
  static constexpr double kEvidenceWeight = 0.2;
  static constexpr double kUsualEvidenceWeight = 0.02;
  static constexpr double kExplainedWeight = 0.1;
  /// Maximum sigma of an estimate that has settled, in sigma_hit.
  static constexpr double kSettledSigma = 0.5;
};

struct RecoveryTuning {
  /// Evidence below which a candidate is rejected [nats].
  static constexpr double kMinGain = -4.0;
  /// Factor per scan by which evidence is forgotten; eq. (2.3).
  static constexpr double kGainMemory = 0.98;
  /// Draws per candidate and field of the hill climb.
  static constexpr int kClimbDraws = 16;
  /// Sigma of such a draw's heading over that of its position, which is sigma_hit [rad / m].
  static constexpr double kClimbTurnPerMetre = 0.5;
};

/// Section "Scans" of the page on health.
struct MclHealthTuning {
  /// Returns nearer than this, where the map has no wall, come from something that covers the
  /// laser [m].
  static constexpr double kCoverDistance = 0.3;
  /// Share of such returns above which they are removed from the scan.
  static constexpr double kRemovedCover = 0.1;
  /// Time after which a scan without motion counts as new information [s].
  static constexpr double kStationaryPeriod = 1.0;
  /// Probability of the likeliest cluster below which health is ambiguous.
  static constexpr double kMinProbabilityChosen = 0.9;
  /// Minimum of the settings spacing_m [m] and spacing_heading_rad [rad].
  static constexpr double kMinScanSpacing = 1e-6;
  /// Random poses at which a scan is evaluated to learn what fits by chance.
  static constexpr int kChancePoses = 2;
  /// Separates the key of those poses from all others.
  static constexpr std::uint64_t kChanceKey = 0x6865616C7468ULL;
  /// Confidence of the gate by which measurements count as accepted.
  static constexpr double kGateConfidence = 0.999;
};

}  // namespace locfuse::internal
