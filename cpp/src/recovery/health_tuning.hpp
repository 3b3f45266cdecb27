// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace locfuse::internal {

/// Constants of Health that are not settings; table "Constants" of docs/health.md, whose equations
/// are meant.
struct HealthTuning {
  /// @name Running means
  static constexpr double kSourceWeight = 1.0 / 32.0;   ///< of a message in those of its source
  static constexpr double kOverallWeight = 1.0 / 64.0;  ///< of a message in those of all sources

  /// @name Limits of what one message says
  static constexpr double kMaxOdds = 1e9;  ///< of a wrong pose: more would take long to come back
  static constexpr double kMaxMeanNis = 10.0;  ///< per row, of one message in the mean
  static constexpr double kMaxPeak = 1e100;    ///< likelihood over that of an outlier

  /// @name Outliers by themselves, eq. (13)
  static constexpr double kOutlierWeight = 1.0 / 512.0;  ///< of a message in their share
  static constexpr double kMaxOutlierShare = 0.3;        ///< that is held for chance
  static constexpr double kManyOutliers = 0.15;          ///< share above which noise is too large

  /// @name Reasons for kDegraded
  static constexpr double kFaultySource = 0.85;     ///< minimum probability that a source is wrong
  static constexpr double kAgreesAgain = 0.5;       ///< maximum of that at which it is used again
  static constexpr double kLargeNis = 2.0;          ///< minimum mean NIS per row
  static constexpr double kSilentIntervals = 10.0;  ///< minimum silence, in mean message intervals

  /// @name Ranges of a faulty source, eq. (4)
  static constexpr double kSignificantNis = 4.0;  ///< minimum for the sign of a residual to count
  static constexpr double kLongShare = 0.9;       ///< share of wrong ranges that read long

  /// @name Covariance inflation, eq. (8) and (9)
  static constexpr double kNisTolerance = 0.3;      ///< mean NIS above 1 that may be chance
  static constexpr double kDegreesOfFreedom = 8.0;  ///< of Student's distribution

  /// @name Scans, eq. (10) to (12)
  static constexpr double kInitialExplained = 0.9;   ///< usual share of explained returns
  static constexpr double kInitialByChance = 0.3;    ///< the same from anywhere else
  static constexpr double kScanWeight = 1.0 / 64.0;  ///< of a scan in what is usual
  static constexpr double kWorseScanWeight = 0.125;  ///< of that, where it fits worse than usual
  static constexpr double kShareSigma = 0.12;   ///< of the explained share: people, moved furniture
  static constexpr double kBreakEven = 0.4;     ///< from by chance (0) to usual (1): odds stay
  static constexpr double kMaxScanGain = 3.0;   ///< against a pose by one scan [nats]
  static constexpr double kSupportShare = 0.2;  ///< of that for a pose: views repeat for a while
  static constexpr double kMaxScanOdds = 1e3;   ///< of a wrong pose by scans alone

  /// @name Covered lasers
  static constexpr double kCoverExcess = 0.15;   ///< share above the usual one: odds stay
  static constexpr double kCoverSigma = 0.05;    ///< of that share, per nat
  static constexpr double kUsualCover = 1e-3;    ///< share of the time
  static constexpr double kBlindingCover = 0.5;  ///< share from which a scan is not used
};

}  // namespace locfuse::internal
