// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "locfuse/particles/mcl.hpp"
#include "locfuse/recovery/recovering_ekf.hpp"

namespace locfuse {

/// An Mcl that UWB re-initializes (celan2017, sections III.C and V.B): scans alone localize while
/// particles are certain; otherwise the pose from UWB and odometry is injected into them.
///
/// Ranges and fixes go to a RecoveringEkf beside the particles, which starts by itself and detects
/// when it is lost. Derivation: docs/models/particles.md.
///
/// Copying it is a snapshot. Every `on` throws std::invalid_argument for a message that is not
/// valid.
class SwitchingMcl {
 public:
  static constexpr int kSnapshots = Mcl::kSnapshots;

  /// Why the particles are suspect.
  enum class InjectionReason : std::uint8_t {
    kNone,
    kUncertain,  ///< their covariance is large
    kElsewhere,  ///< they contradict UWB
  };

  struct Config {
    double sigma_unsure_m = 0.5;     ///< largest half axis of all particles: suspect above [m]
    double sigma_sure_m = 0.3;       ///< no longer suspect below [m]
    double sigma_unsure_rad = 0.35;  ///< heading: suspect above [rad]
    double sigma_sure_rad = 0.2;     ///< heading: no longer suspect below [rad]
    double elsewhere_m = 1.0;        ///< suspect farther from UWB than this plus three sigmas [m]
    double elsewhere_rad = 0.5;      ///< the same for the heading [rad]
    double doubt_s = 2.0;            ///< how long they must be suspect before UWB takes over [s]
    double uwb_sigma_m = 0.25;       ///< maximum position sigma of a UWB pose to use [m]
    double uwb_sigma_rad = 0.2;      ///< maximum heading sigma of a UWB pose to use [rad]
    double uwb_age_s = 2.5;          ///< maximum time since the last fused range or fix [s]
    double uwb_nis = 1.4;            ///< maximum mean NIS per row of recent ranges or fixes
    double share = 1.0;              ///< share of the particles that is replaced
  };

  /// UWB took over.
  struct Injection {
    Stamp stamp;
    InjectionReason reason;  ///< the reason
    PoseEstimate before;     ///< with the covariance of all particles
    PoseEstimate after;      ///< from UWB
  };

  /// Throws std::invalid_argument on a config out of range, or if UWB would take over again and
  /// again: `sure` must lie below `unsure`, and the maximum sigmas of UWB below `sure`.
  SwitchingMcl(const Config& config, Mcl mcl, RecoveringEkf uwb);

  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  /// Go to the UWB filter; kIgnored while it searches for its start.
  Outcome on(const Range& z);
  Outcome on(const PositionFix& z);
  /// Weigh particles.
  Outcome on(const LaserScan& z);
  Outcome on(const PoseObservation& z);
  Outcome on(const RangeBearing& z);
  /// Checked, and kNotModelled: it has no height.
  Outcome on(const Altitude& z);
  Outcome on(const Heading& z);
  Outcome on(const Message& message);

  /// The same estimator, with particles and the UWB filter at a pose.
  [[nodiscard]] SwitchingMcl restarted(const PoseEstimate& pose) const;
  /// As Mcl::watches.
  [[nodiscard]] bool watches(const Message& message) const { return mcl_.watches(message); }
  /// Whether the particles know where they are.
  [[nodiscard]] bool has_started() const { return mcl_.has_started(); }

  /// Estimate of the particles at the stamp of the last message.
  [[nodiscard]] const PoseEstimate& current() const { return mcl_.current(); }
  /// Estimate of the particles, carried to where odometry ends.
  [[nodiscard]] PoseEstimate estimate() const { return mcl_.estimate(); }
  /// How far it may be trusted, by the measurements that weighed particles.
  [[nodiscard]] HealthReport health() const { return mcl_.health(); }
  [[nodiscard]] const Mcl& mcl() const { return mcl_; }
  [[nodiscard]] const RecoveringEkf& uwb() const { return uwb_; }
  /// Mean NIS per row of recent ranges or fixes: 1 if the UWB filter is consistent.
  [[nodiscard]] double uwb_nis() const { return nis_; }
  /// The last 1000.
  [[nodiscard]] const std::vector<Injection>& injections() const { return injections_; }

 private:
  template <class Motion>
  Outcome drive(const Motion& u);
  template <class M>
  Outcome update_uwb(const M& z);
  [[nodiscard]] bool is_uwb_tracking(Stamp stamp) const;
  [[nodiscard]] std::optional<PoseEstimate> usable_uwb_pose(Stamp stamp) const;
  [[nodiscard]] InjectionReason assess(const PoseEstimate& here,
                                       const std::optional<PoseEstimate>& uwb,
                                       bool was_suspect) const;
  void switch_if_suspect(Stamp stamp);
  void inflate_uwb(Stamp stamp);

  Config config_;
  Stamp switch_delay_;
  Stamp uwb_age_;
  Mcl mcl_;
  RecoveringEkf uwb_;
  std::optional<Stamp> last_fused_;          // range or fix
  double nis_ = 1.0;                         // mean per row of recent ranges or fixes
  std::optional<Stamp> suspect_since_;       // the particles
  std::optional<Stamp> inconsistent_since_;  // the UWB filter, or since it was inflated last
  std::vector<Injection> injections_;
};

}  // namespace locfuse
