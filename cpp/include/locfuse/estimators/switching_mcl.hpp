// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "locfuse/estimators/mcl.hpp"
#include "locfuse/estimators/recovering_ekf.hpp"

namespace locfuse {

/// An Mcl that UWB rescues (celan2017, sections III.C and V.B): scans alone tell of the pose while
/// they leave no doubt; where they do, the pose by UWB and odometry becomes the particles' belief.
///
/// Ranges and fixes go to a RecoveringEkf beside the particles, which starts by itself and knows
/// when it is lost. Derivation: docs/models/switching_mcl.md.
///
/// Copying it is a snapshot. Every `on` throws std::invalid_argument for a message that is not
/// valid.
class SwitchingMcl {
 public:
  /// Why scans are in doubt.
  enum class Doubt : std::uint8_t {
    kNone,
    kUncertain,  ///< the particles have spread
    kElsewhere,  ///< they are beside where UWB says
  };

  struct Config {
    double sigma_unsure_m = 0.5;     ///< of the particles, in their worst direction: in doubt [m]
    double sigma_sure_m = 0.3;       ///< below it no longer [m]
    double sigma_unsure_rad = 0.35;  ///< likewise of their heading [rad]
    double sigma_sure_rad = 0.2;     ///< [rad]
    double elsewhere_m = 1.0;        ///< off UWB by more than this and three sigmas: in doubt [m]
    double elsewhere_rad = 0.5;      ///< likewise turned [rad]
    double doubt_s = 2.0;            ///< that it must last [s]
    double uwb_sigma_m = 0.25;       ///< of the pose by UWB, at most, to be of use [m]
    double uwb_sigma_rad = 0.2;      ///< likewise [rad]
    double uwb_age_s = 2.5;          ///< since the last range or fix that was fused, likewise [s]
    double uwb_nis = 1.4;            ///< of the last ranges or fixes, per row, on average, likewise
    double share = 1.0;              ///< of the particles that are replaced
  };

  /// UWB took over.
  struct Injection {
    Stamp stamp;
    Doubt doubt;
    PoseEstimate before;  ///< with the covariance of all particles
    PoseEstimate after;   ///< by UWB
  };

  /// Throws std::invalid_argument on a config out of range, or where a threshold could fire for
  /// ever: `sure` must lie below `unsure`, and a pose by UWB that is of use must be sure.
  SwitchingMcl(const Config& config, Mcl mcl, RecoveringEkf uwb);

  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  /// What UWB's filter makes of it; kIgnored while that one looks for its start.
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  /// Weigh particles.
  Outcome on(const LaserScan& z);
  Outcome on(const PoseObservation& z);
  Outcome on(const RangeBearing& z);

  /// Of the particles, carried to where odometry ends.
  [[nodiscard]] PoseEstimate estimate() const { return mcl_.estimate(); }
  /// How far that may be trusted, by what particles were weighed with.
  [[nodiscard]] HealthReport health() const { return mcl_.health(); }
  [[nodiscard]] const Mcl& mcl() const { return mcl_; }
  [[nodiscard]] const RecoveringEkf& uwb() const { return uwb_; }
  /// NIS of the last ranges or fixes per row, on average: 1 where UWB's filter is right.
  [[nodiscard]] double uwb_nis() const { return nis_; }
  /// The last thousand.
  [[nodiscard]] const std::vector<Injection>& injections() const { return injections_; }

 private:
  template <class Motion>
  Outcome drive(const Motion& u);
  template <class M>
  Outcome hear(const M& z);
  [[nodiscard]] bool is_heard(Stamp stamp) const;
  [[nodiscard]] std::optional<PoseEstimate> useful(Stamp stamp) const;
  [[nodiscard]] Doubt doubt(const PoseEstimate& here, const std::optional<PoseEstimate>& uwb,
                            bool was_unsure) const;
  void judge(Stamp stamp);
  void widen(Stamp stamp);

  Config config_;
  Stamp doubt_for_;
  Stamp uwb_age_;
  Mcl mcl_;
  RecoveringEkf uwb_;
  std::optional<Stamp> heard_;         // the last range or fix that was fused
  double nis_ = 1.0;                   // of the last ones per row, on average
  std::optional<Stamp> since_;         // in doubt
  std::optional<Stamp> contradicted_;  // in doubt, UWB's filter by what it hears, or widened
  std::vector<Injection> injections_;
};

}  // namespace locfuse
