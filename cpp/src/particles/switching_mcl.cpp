// SPDX-License-Identifier: Apache-2.0
#include "locfuse/particles/switching_mcl.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include "estimators/recipe.hpp"

namespace locfuse {
namespace {

/// Constants that are not settings; docs/models/particles.md.
struct SwitchingMclTuning {
  static constexpr double kNisWeight = 1.0 / 50.0;  ///< of a range or fix in their mean NIS
  static constexpr double kMaxNis = 10.0;           ///< per row, of one of them
  static constexpr double kContradictionSigmas = 3.0;
  static constexpr std::size_t kMaxInjections = 1000;  ///< that are remembered
};

/// Throws std::invalid_argument unless low <= high; `why` ends the sentence.
void check_order(const char* low_name, double low, const char* high_name, double high,
                 const char* why) {
  if (!(low <= high)) {
    throw std::invalid_argument(std::string(low_name) + " is " + std::to_string(low) + " and " +
                                high_name + " is " + std::to_string(high) + ", expected " +
                                low_name + " <= " + high_name + ": " + why);
  }
}

const SwitchingMcl::Config& checked(const SwitchingMcl::Config& c) {
  using internal::positive;
  positive("sigma_unsure_m", c.sigma_unsure_m);
  positive("sigma_sure_m", c.sigma_sure_m);
  positive("sigma_unsure_rad", c.sigma_unsure_rad);
  positive("sigma_sure_rad", c.sigma_sure_rad);
  positive("elsewhere_m", c.elsewhere_m);
  positive("elsewhere_rad", c.elsewhere_rad);
  positive("uwb_sigma_m", c.uwb_sigma_m);
  positive("uwb_sigma_rad", c.uwb_sigma_rad);
  positive("uwb_nis", c.uwb_nis);
  if (!(c.share > 0.0 && c.share <= 1.0)) {
    throw std::invalid_argument("share is " + std::to_string(c.share) +
                                ", expected 0 < share <= 1");
  }
  const char* const ends = "else particles would be suspect again at once";
  check_order("sigma_sure_m", c.sigma_sure_m, "sigma_unsure_m", c.sigma_unsure_m, ends);
  check_order("sigma_sure_rad", c.sigma_sure_rad, "sigma_unsure_rad", c.sigma_unsure_rad, ends);
  const char* const cures = "else UWB would take over again and again, as its own pose is suspect";
  check_order("uwb_sigma_m", c.uwb_sigma_m, "sigma_sure_m", c.sigma_sure_m, cures);
  check_order("uwb_sigma_rad", c.uwb_sigma_rad, "sigma_sure_rad", c.sigma_sure_rad, cures);
  return c;
}

}  // namespace

SwitchingMcl::SwitchingMcl(const Config& config, Mcl mcl, RecoveringEkf uwb)
    : config_(checked(config)),
      switch_delay_(internal::stamps_of("doubt_s", config.doubt_s)),
      uwb_age_(internal::stamps_of("uwb_age_s", config.uwb_age_s)),
      mcl_(std::move(mcl)),
      uwb_(std::move(uwb)) {}

Outcome SwitchingMcl::on(const Velocity& u) { return drive(u); }
Outcome SwitchingMcl::on(const Increment& u) { return drive(u); }
Outcome SwitchingMcl::on(const Range& z) { return update_uwb(z); }
Outcome SwitchingMcl::on(const PositionFix& z) { return update_uwb(z); }
Outcome SwitchingMcl::on(const PoseObservation& z) { return mcl_.on(z); }
Outcome SwitchingMcl::on(const RangeBearing& z) { return mcl_.on(z); }

Outcome SwitchingMcl::on(const Altitude& z) { return internal::not_used(z); }
Outcome SwitchingMcl::on(const Heading& z) { return internal::not_used(z); }

Outcome SwitchingMcl::on(const LaserScan& z) {
  const Outcome outcome = mcl_.on(z);
  if (outcome.verdict != Verdict::kStale) {
    switch_if_suspect(z.stamp);
  }
  return outcome;
}

Outcome SwitchingMcl::on(const Message& message) { return internal::dispatch(*this, message); }

SwitchingMcl SwitchingMcl::restarted(const PoseEstimate& pose) const {
  SwitchingMcl again(config_, mcl_.restarted(pose), uwb_);
  if (uwb_.has_started()) {
    again.uwb_ = uwb_.restarted(pose);
  } else {
    again.uwb_.start_at(pose);
  }
  again.injections_ = injections_;
  return again;
}

template <class Motion>
Outcome SwitchingMcl::drive(const Motion& u) {
  const Outcome outcome = mcl_.on(u);
  if (outcome.verdict != Verdict::kStale) {
    uwb_.on(u);
  }
  return outcome;
}

template <class M>
Outcome SwitchingMcl::update_uwb(const M& z) {
  const Outcome outcome = uwb_.on(z);
  if (outcome.verdict == Verdict::kFused) {
    last_fused_ = z.stamp;
  }
  if (outcome.dof > 0) {
    nis_ += SwitchingMclTuning::kNisWeight *
            (std::min(outcome.nis / outcome.dof, SwitchingMclTuning::kMaxNis) - nis_);
  }
  return outcome;
}

/// Whether the UWB filter tracks, and fused a range or fix lately.
bool SwitchingMcl::is_uwb_tracking(Stamp stamp) const {
  return !uwb_.is_lost() && last_fused_ && stamp - *last_fused_ <= uwb_age_ &&
         uwb_.estimator()->current().stamp <= stamp;
}

/// The pose from UWB, if it is recent, consistent and its sigmas are small.
std::optional<PoseEstimate> SwitchingMcl::usable_uwb_pose(Stamp stamp) const {
  if (!is_uwb_tracking(stamp) || nis_ > config_.uwb_nis) {
    return std::nullopt;
  }
  const PoseEstimate now = uwb_.estimator()->estimate(stamp);
  const bool is_certain =
      now.sigma_position() <= config_.uwb_sigma_m && now.sigma_heading() <= config_.uwb_sigma_rad;
  const bool is_near = now.pose.position().norm() <= mcl_.config().limits.distance_m;
  return is_certain && is_near ? std::optional(now) : std::nullopt;
}

SwitchingMcl::InjectionReason SwitchingMcl::assess(const PoseEstimate& here,
                                                   const std::optional<PoseEstimate>& uwb,
                                                   bool was_suspect) const {
  const double max_sigma = was_suspect ? config_.sigma_sure_m : config_.sigma_unsure_m;
  const double max_sigma_heading = was_suspect ? config_.sigma_sure_rad : config_.sigma_unsure_rad;
  if (here.sigma_position() > max_sigma || here.sigma_heading() > max_sigma_heading) {
    return InjectionReason::kUncertain;
  }
  if (uwb) {
    const Vector<3> off = local(here.pose, uwb->pose);
    const PoseEstimate both{here.stamp, here.pose, here.covariance + uwb->covariance};
    if (off.head<2>().norm() > config_.elsewhere_m + SwitchingMclTuning::kContradictionSigmas *
                                                         both.sigma_position() ||
        std::abs(off(2)) > config_.elsewhere_rad +
                               SwitchingMclTuning::kContradictionSigmas * both.sigma_heading()) {
      return InjectionReason::kElsewhere;
    }
  }
  return InjectionReason::kNone;
}

void SwitchingMcl::switch_if_suspect(Stamp stamp) {
  const PoseEstimate here = mcl_.overall_estimate();
  const std::optional<PoseEstimate> uwb = usable_uwb_pose(stamp);
  const InjectionReason why = assess(here, uwb, suspect_since_.has_value());
  if (why == InjectionReason::kNone) {
    suspect_since_.reset();
    inconsistent_since_.reset();
    return;
  }
  suspect_since_ = suspect_since_.value_or(stamp);
  inflate_uwb(stamp);
  if (!uwb || stamp - *suspect_since_ < switch_delay_) {
    return;
  }
  mcl_.inject(*uwb, config_.share);
  if (injections_.size() == SwitchingMclTuning::kMaxInjections) {
    injections_.erase(injections_.begin());
  }
  injections_.push_back({stamp, why, here, *uwb});
  suspect_since_.reset();
}

/// Multiplies the covariance of the UWB filter by its NIS where it is needed and has been
/// inconsistent for uwb_age_s, so that gates accept measurements again.
void SwitchingMcl::inflate_uwb(Stamp stamp) {
  if (!is_uwb_tracking(stamp)) {
    return;
  }
  if (nis_ <= std::max(config_.uwb_nis, 1.0)) {
    inconsistent_since_.reset();
    return;
  }
  inconsistent_since_ = inconsistent_since_.value_or(stamp);
  if (stamp - *inconsistent_since_ < std::max<Stamp>(uwb_age_, 1)) {  // once per stamp
    return;
  }
  PoseEstimate now = uwb_.estimator()->estimate(stamp);
  now.covariance *= nis_;
  uwb_.start_at(now);
  inconsistent_since_ = stamp;
}

}  // namespace locfuse
