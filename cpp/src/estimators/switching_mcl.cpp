// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/switching_mcl.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimators/recipe.hpp"

namespace locfuse {
namespace {

constexpr double kNews = 1.0 / 50.0;  // weight of a range or fix in the average of their NIS
constexpr double kMostNis = 10.0;     // of one of them: more says no more
constexpr std::size_t kMostInjections = 1000;  // that are remembered

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
  const char* const ends = "else doubt would end where it begins";
  check_order("sigma_sure_m", c.sigma_sure_m, "sigma_unsure_m", c.sigma_unsure_m, ends);
  check_order("sigma_sure_rad", c.sigma_sure_rad, "sigma_unsure_rad", c.sigma_unsure_rad, ends);
  const char* const cures = "else UWB would take over for ever, as its own pose leaves doubt";
  check_order("uwb_sigma_m", c.uwb_sigma_m, "sigma_sure_m", c.sigma_sure_m, cures);
  check_order("uwb_sigma_rad", c.uwb_sigma_rad, "sigma_sure_rad", c.sigma_sure_rad, cures);
  return c;
}

}  // namespace

SwitchingMcl::SwitchingMcl(const Config& config, Mcl mcl, RecoveringEkf uwb)
    : config_(checked(config)),
      doubt_for_(internal::stamps_of("doubt_s", config.doubt_s)),
      uwb_age_(internal::stamps_of("uwb_age_s", config.uwb_age_s)),
      mcl_(std::move(mcl)),
      uwb_(std::move(uwb)) {}

Outcome SwitchingMcl::on(const Velocity& u) { return drive(u); }
Outcome SwitchingMcl::on(const Increment& u) { return drive(u); }
Outcome SwitchingMcl::on(const Range& z) { return hear(z); }
Outcome SwitchingMcl::on(const PositionFix& z) { return hear(z); }
Outcome SwitchingMcl::on(const PoseObservation& z) { return mcl_.on(z); }
Outcome SwitchingMcl::on(const RangeBearing& z) { return mcl_.on(z); }

Outcome SwitchingMcl::on(const LaserScan& z) {
  const Outcome outcome = mcl_.on(z);
  if (outcome.verdict != Verdict::kStale) {
    judge(z.stamp);
  }
  return outcome;
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
Outcome SwitchingMcl::hear(const M& z) {
  const Outcome outcome = uwb_.on(z);
  if (outcome.verdict == Verdict::kFused) {
    heard_ = z.stamp;
  }
  if (outcome.dof > 0) {
    nis_ += kNews * (std::min(outcome.nis / outcome.dof, kMostNis) - nis_);
  }
  return outcome;
}

/// Whether UWB's filter tracks, and something was fused lately.
bool SwitchingMcl::is_heard(Stamp stamp) const {
  return !uwb_.is_lost() && heard_ && stamp - *heard_ <= uwb_age_ &&
         uwb_.estimator()->current().stamp <= stamp;
}

/// The pose by UWB, if it is sure, was heard lately, and what was heard agrees with it.
std::optional<PoseEstimate> SwitchingMcl::useful(Stamp stamp) const {
  if (!is_heard(stamp) || nis_ > config_.uwb_nis) {
    return std::nullopt;
  }
  const PoseEstimate now = uwb_.estimator()->estimate(stamp);
  const bool is_sure =
      now.sigma_position() <= config_.uwb_sigma_m && now.sigma_heading() <= config_.uwb_sigma_rad;
  const bool is_near = now.pose.position().norm() <= mcl_.config().limits.distance_m;
  return is_sure && is_near ? std::optional(now) : std::nullopt;
}

SwitchingMcl::Doubt SwitchingMcl::doubt(const PoseEstimate& here,
                                        const std::optional<PoseEstimate>& uwb,
                                        bool was_unsure) const {
  const double most = was_unsure ? config_.sigma_sure_m : config_.sigma_unsure_m;
  const double most_turn = was_unsure ? config_.sigma_sure_rad : config_.sigma_unsure_rad;
  if (here.sigma_position() > most || here.sigma_heading() > most_turn) {
    return Doubt::kUncertain;
  }
  if (uwb) {
    const Vector<3> off = local(here.pose, uwb->pose);
    const PoseEstimate both{here.stamp, here.pose, here.covariance + uwb->covariance};
    if (off.head<2>().norm() > config_.elsewhere_m + 3.0 * both.sigma_position() ||
        std::abs(off(2)) > config_.elsewhere_rad + 3.0 * both.sigma_heading()) {
      return Doubt::kElsewhere;
    }
  }
  return Doubt::kNone;
}

void SwitchingMcl::judge(Stamp stamp) {
  const PoseEstimate here = mcl_.spread();
  const std::optional<PoseEstimate> uwb = useful(stamp);
  const Doubt why = doubt(here, uwb, since_.has_value());
  if (why == Doubt::kNone) {
    since_.reset();
    contradicted_.reset();
    return;
  }
  since_ = since_.value_or(stamp);
  widen(stamp);
  if (!uwb || stamp - *since_ < doubt_for_) {
    return;
  }
  mcl_.inject(*uwb, config_.share);
  if (injections_.size() == kMostInjections) {
    injections_.erase(injections_.begin());
  }
  injections_.push_back({stamp, why, here, *uwb});
  since_.reset();
}

/// A filter of UWB that is needed, and contradicts what it hears for as long as it may be silent,
/// is less sure than it says: its covariance grows by its NIS, so that gates let in what is heard.
void SwitchingMcl::widen(Stamp stamp) {
  if (!is_heard(stamp)) {
    return;
  }
  if (nis_ <= std::max(config_.uwb_nis, 1.0)) {
    contradicted_.reset();
    return;
  }
  contradicted_ = contradicted_.value_or(stamp);
  if (stamp - *contradicted_ < std::max<Stamp>(uwb_age_, 1)) {  // once at a time
    return;
  }
  PoseEstimate now = uwb_.estimator()->estimate(stamp);
  now.covariance *= nis_;
  uwb_.start_at(now);
  contradicted_ = stamp;
}

}  // namespace locfuse
