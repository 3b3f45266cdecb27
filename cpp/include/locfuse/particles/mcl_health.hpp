// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "locfuse/messages/per_laser.hpp"
#include "locfuse/particles/mcl_recipe.hpp"
#include "locfuse/recovery/health.hpp"

namespace locfuse::internal {

/// Health of an Mcl: what scans and other measurements say of its likeliest cluster, from the first
/// time that it has converged; section "Scans" of docs/health.md.
class MclHealth {
 public:
  explicit MclHealth(std::shared_ptr<const MclRecipe> recipe)
      : recipe_(std::move(recipe)), health_(recipe_->config.health) {}

  /// Until `start` nothing is recorded.
  void stop() { is_active_ = false; }
  /// The pose is wrong with that probability.
  void start(Stamp stamp, double wrong);
  /// A pose was injected: it is right, and health is as active as it was before.
  void restart(Stamp stamp, bool is_active);
  [[nodiscard]] bool is_active() const { return is_active_; }

  void add_motion(const Pose2& motion);
  /// How well a scan fits at a pose; shares of as many beams as weigh particles.
  [[nodiscard]] ScanEvidence evidence_of(const LaserScan& z, const PoseEstimate& here) const;
  /// The scan without returns right in front of the laser, if so many are that it must be cleared.
  [[nodiscard]] static std::optional<LaserScan> without_cover(const LaserScan& z,
                                                              const ScanEvidence& evidence);
  /// Records a scan, as far as it is new information beside the last one of the same laser.
  void report_scan(const LaserScan& z, ScanEvidence evidence);
  /// Records how another measurement fits the likeliest cluster before its update.
  template <class Message>
  void record(const Message& z, Outcome outcome);

  [[nodiscard]] bool is_lost() const { return health_.is_lost(); }
  [[nodiscard]] PoseEstimate doubted(const PoseEstimate& estimate, double wrong) const {
    return health_.doubted(estimate, wrong);
  }
  /// `probability` is that of the likeliest cluster, whose `estimate` it is.
  [[nodiscard]] HealthReport report(double probability, const PoseEstimate& estimate,
                                    bool has_scan) const;
  [[nodiscard]] const std::vector<SourceStatus>& sources() const { return health_.sources(); }

 private:
  struct SinceScan {
    Stamp stamp = 0;         // of the last scan
    double travelled = 0.0;  // since then, in scan spacings
  };

  std::shared_ptr<const MclRecipe> recipe_;
  Health health_;
  bool is_active_ = false;
  PerLaser<SinceScan> since_scan_;
};

}  // namespace locfuse::internal
