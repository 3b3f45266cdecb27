// SPDX-License-Identifier: Apache-2.0
#include "locfuse/recovery/health.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "estimators/recipe.hpp"
#include "locfuse/messages/reported_covariance.hpp"
#include "recovery/health_tuning.hpp"
#include "recovery/within.hpp"

namespace locfuse {
namespace {

/// Whether what a source measures depends on where the body is.
bool says_of_place(const NamedSource& source) {
  return source.kind != Source::kAltitudes && source.kind != Source::kHeadings;
}

double odds_of(double probability) { return probability / (1.0 - probability); }

double between(const char* name, double value, double low, double high) {
  if (!(value > low && value < high)) {
    std::ostringstream text;
    text << name << " is " << value << ", expected a number between " << low << " and " << high;
    throw std::invalid_argument(text.str());
  }
  return value;
}

const Health::Config& checked(const Health::Config& c) {
  using internal::positive;
  positive("limit_m", c.limit_m);
  between("risk", c.risk, 0.0, 0.5);
  between("mean_s_between_losses", c.mean_s_between_losses, 1e-3, 1e12);
  between("wrong_share", c.wrong_share, 1e-9, 1.0);
  between("wrong_span_m", c.wrong_span_m, 1e-6, 1e12);
  between("chance_share", c.chance_share, 0.0, 1.0);
  between("faulty_share", c.faulty_share, 0.0, 1.0);
  between("faulty_share_unnamed", c.faulty_share_unnamed, 0.0, 1.0);
  positive("faulty_s", c.faulty_s);
  between("probability_lost", c.probability_lost, 0.0, 1.0);
  between("probability_found", c.probability_found, 0.0, 1.0);
  if (!(c.exclude_above > 0.0 && c.exclude_above <= 1.0)) {
    throw std::invalid_argument("exclude_above is " + std::to_string(c.exclude_above) +
                                ", expected 0 < exclude_above <= 1");
  }
  if (c.probability_found > c.probability_lost) {
    throw std::invalid_argument("probability_found is " + std::to_string(c.probability_found) +
                                " and probability_lost is " + std::to_string(c.probability_lost) +
                                ", expected probability_found <= probability_lost");
  }
  return c;
}

/// Error in sigmas that half of the risk exceeds, to either side, eq. (9): Student's distribution,
/// since sigma is known from a few innovations only.
double quantile_of(double risk) {
  // The lower tail: 1 minus a small risk rounds to 1.
  const double tail = std::max(0.25 * risk, std::numeric_limits<double>::min());
  return -boost::math::quantile(boost::math::students_t(internal::HealthTuning::kDegreesOfFreedom),
                                tail);
}

}  // namespace

Health::Health(const Config& config)
    : config_(checked(config)),
      aiding_lost_(internal::stamps_of("aiding_lost_s", config.aiding_lost_s)),
      invalid_(internal::stamps_of("invalid_s", config.invalid_s)),
      lost_delay_(internal::stamps_of("doubt_s", config.doubt_s)),
      odds_lost_(odds_of(config.probability_lost)),
      odds_found_(odds_of(config.probability_found)),
      quantile_(quantile_of(config.risk)) {}

void Health::start(Stamp stamp, double wrong) {
  check_stamp(stamp);
  if (!(wrong >= 0.0 && wrong < 1.0)) {
    throw std::invalid_argument("wrong is " + std::to_string(wrong) +
                                ", expected a probability less than 1");
  }
  stamp_ = fused_ = stamp;
  odds_ = odds_measured_ = odds_of(wrong);
  nis_ = 1.0;
  outliers_ = config_.wrong_share;
  scale_ = 0.0;
  lost_ = false;
  suspect_since_.reset();
  sources_.clear();
  latest_ = 0;
  excluded_ = 0;
  explained_ = internal::HealthTuning::kInitialExplained;
  by_chance_ = internal::HealthTuning::kInitialByChance;
  covered_ = 0.0;
  scans_contradict_ = false;
}

double Health::faulty_share(const NamedSource& source) const {
  if (source.kind == Source::kScans) {
    return internal::HealthTuning::kUsualCover;
  }
  const bool is_sensor = source.kind == Source::kSightings && source.name == NamedSource::kUnnamed;
  return is_sensor ? config_.faulty_share_unnamed : config_.faulty_share;
}

SourceStatus& Health::status_of(const NamedSource& source, Stamp stamp) {
  // Sources tend to take turns.
  if (latest_ + 1 < sources_.size() && sources_[latest_ + 1].source == source) {
    return sources_[++latest_];
  }
  const auto place = std::lower_bound(
      sources_.begin(), sources_.end(), source,
      [](const SourceStatus& status, const NamedSource& wanted) { return status.source < wanted; });
  latest_ = static_cast<std::size_t>(place - sources_.begin());
  if (place == sources_.end() || !(place->source == source)) {
    SourceStatus fresh;
    fresh.source = source;
    fresh.last_received = stamp;
    fresh.faulty = faulty_share(source);
    sources_.insert(place, fresh);
  }
  return sources_[latest_];
}

void Health::advance(Stamp stamp) {
  check_stamp(stamp);
  if (stamp <= stamp_) {
    return;
  }
  const double seconds = seconds_between(stamp_, stamp);
  stamp_ = stamp;
  odds_ = grown(odds_, seconds);
  odds_measured_ = grown(odds_measured_, seconds);
  if (is_out_of_date(stamp_)) {
    odds_ = std::max(odds_, odds_lost_);
    suspect_since_ = suspect_since_.value_or(stamp_);
    lost_ = true;
    return;
  }
  update_state();
}

/// Odds of a wrong pose after some time.
double Health::grown(double odds, double seconds) const {
  return std::min(odds + (1.0 + odds) * seconds / config_.mean_s_between_losses,
                  internal::HealthTuning::kMaxOdds);
}

/// The pose is lost once suspicion has lasted: a burst of outliers does not.
void Health::update_state() {
  if (odds_ <= (lost_ ? odds_found_ : odds_lost_)) {
    odds_measured_ = odds_;
    lost_ = false;
    suspect_since_.reset();
    return;
  }
  suspect_since_ = suspect_since_.value_or(stamp_);
  lost_ = lost_ || stamp_ - *suspect_since_ >= lost_delay_;
}

void Health::record(const NamedSource& source, Stamp stamp, const Outcome& outcome, double limit,
                    double outlier_volume) {
  const bool is_fused = outcome.verdict == Verdict::kFused;
  if (!is_fused && outcome.verdict != Verdict::kGated) {
    return;
  }
  advance(stamp);
  SourceStatus& status = status_of(source, stamp);
  receive(status, stamp, is_fused);
  if (outcome.dof > 0) {
    status.residual = outcome.residual;
    status.sigma = std::sqrt(outcome.scale);
    status.test_ratio = outcome.nis / limit;
  }
  if (!says_of_place(source)) {
    status.nis += internal::HealthTuning::kSourceWeight *
                  (std::min(outcome.nis, internal::HealthTuning::kMaxMeanNis) - status.nis);
    return;
  }
  scans_contradict_ = false;
  weigh(status, outcome, outlier_volume);
  exclude(status);
}

void Health::record(const ScanEvidence& scan) {
  advance(scan.stamp);
  SourceStatus& status = status_of({Source::kScans, NamedSource::kUnnamed}, scan.stamp);
  const bool is_clear = scan.covered < internal::HealthTuning::kBlindingCover;
  receive(status, scan.stamp, is_clear);
  weigh_cover(status, scan);
  if (is_clear) {
    weigh(status, scan);
    learn_usual(status, scan);
    update_state();
  }
}

/// A source that is excluded stays so until it likely is right.
void Health::exclude(SourceStatus& status) {
  const double above = status.is_excluded
                           ? std::min(internal::HealthTuning::kAgreesAgain, config_.exclude_above)
                           : config_.exclude_above;
  excluded_ -= status.is_excluded ? 1 : 0;
  status.is_excluded = status.faulty > above;
  excluded_ += status.is_excluded ? 1 : 0;
}

/// A scan with more cover than usual contradicts the laser.
void Health::weigh_cover(SourceStatus& status, const ScanEvidence& scan) const {
  const double excess = (scan.covered - covered_ - internal::HealthTuning::kCoverExcess) /
                        internal::HealthTuning::kCoverSigma;
  const double nats =
      scan.novelty * std::min(std::max(excess, -internal::HealthTuning::kMaxScanGain),
                              internal::HealthTuning::kMaxScanGain);
  const double odds =
      std::min(odds_of(status.faulty) * std::exp(nats), internal::HealthTuning::kMaxScanOdds);
  status.faulty = odds / (1.0 + odds);
}

/// A scan that fits as usual supports the pose, one that fits as from random poses contradicts it;
/// eq. (10) to (12) of docs/health.md.
void Health::weigh(SourceStatus& status, const ScanEvidence& scan) {
  // A pose that a search found fits better than a random one.
  const double by_chance = lost_ ? 0.5 * (explained_ + by_chance_) : by_chance_;
  const double contrast = std::max(explained_ - by_chance, 0.0);
  const double middle = by_chance + internal::HealthTuning::kBreakEven * (explained_ - by_chance);
  const double clear = 1.0 - scan.covered;
  const double variance =
      internal::HealthTuning::kShareSigma * internal::HealthTuning::kShareSigma +
      middle * (1.0 - middle) / (scan.independent * clear);
  const double support = clear * contrast * (scan.explained - middle) / variance;
  const double max_support =
      internal::HealthTuning::kSupportShare * internal::HealthTuning::kMaxScanGain;
  const double nats =
      scan.novelty *
      std::min(std::max(support, -internal::HealthTuning::kMaxScanGain), max_support);
  status.residual = scan.explained - explained_;
  status.sigma = std::sqrt(variance);
  status.test_ratio = (explained_ - scan.explained) / std::max(0.5 * contrast, 1e-3);
  const double max_odds = std::max(odds_, internal::HealthTuning::kMaxScanOdds);
  odds_ = std::min(odds_ * std::exp(-nats), max_odds);
  odds_measured_ = std::min(odds_measured_ * std::exp(-nats), max_odds);
  scans_contradict_ = nats < 0.0;
}

/// Learns what is usual while the pose is right, and slowly where scans fit worse: that may be a
/// wrong place.
void Health::learn_usual(const SourceStatus& status, const ScanEvidence& scan) {
  const double weight =
      odds_ < odds_found_ ? internal::HealthTuning::kScanWeight * scan.novelty : 0.0;
  const double worse = scan.explained < explained_ ? internal::HealthTuning::kWorseScanWeight : 1.0;
  explained_ += weight * worse * (scan.explained - explained_);
  by_chance_ += weight * (scan.by_chance - by_chance_);
  covered_ += weight * (1.0 - status.faulty) * (scan.covered - covered_);
}

void Health::receive(SourceStatus& status, Stamp stamp, bool is_fused) {
  const double seconds = std::max(seconds_between(status.last_received, stamp), 0.0);
  const double stays = std::max(1.0 - seconds / config_.faulty_s, 0.0);
  const double usual = faulty_share(status.source);
  status.faulty = usual + stays * (status.faulty - usual);
  status.interval += (status.interval > 0.0 ? internal::HealthTuning::kSourceWeight : 1.0) *
                     (seconds - status.interval);
  status.last_received = std::max(status.last_received, stamp);
  status.accepted +=
      internal::HealthTuning::kSourceWeight * ((is_fused ? 1.0 : 0.0) - status.accepted);
  if (is_fused) {
    status.fused = status.last_received;
    if (says_of_place(status.source)) {
      fused_ = std::max(fused_, stamp);
    }
  }
}

/// Eq. (2) to (5) of docs/health.md.
void Health::weigh(SourceStatus& status, const Outcome& outcome, double outlier_volume) {
  double fits = 0.0;  // likelihood of an inlier over that of an outlier, eq. (1)
  if (outcome.dof > 0) {
    const double volume = 2.0 * kPi * outcome.scale;
    const double peak = outcome.dof == 1   ? 1.0 / std::sqrt(volume)
                        : outcome.dof == 2 ? 1.0 / volume
                                           : std::pow(volume, -0.5 * outcome.dof);
    fits = std::exp(-0.5 * outcome.nis) *
           (std::min(outlier_volume * peak, internal::HealthTuning::kMaxPeak) + 2.0);
  }
  const double wrong = std::max(outliers_, config_.wrong_share);
  const double elsewhere = 1.0 - config_.chance_share + config_.chance_share * fits;
  const double good = 1.0 - status.faulty;
  const double outlier = wrong / ((1.0 - wrong) * fits + wrong);  // if pose and source are right
  if (odds_ < odds_found_) {
    outliers_ += internal::HealthTuning::kOutlierWeight * good * (outlier - outliers_);
    outliers_ = std::min(outliers_, internal::HealthTuning::kMaxOutlierShare);
  }
  if (outcome.dof > 0) {
    const double ratio = std::min(outcome.nis / outcome.dof, internal::HealthTuning::kMaxMeanNis);
    status.nis +=
        internal::HealthTuning::kSourceWeight * good * (1.0 - outlier) * (ratio - status.nis);
    nis_ += internal::HealthTuning::kOverallWeight * good * (ratio - nis_);
    scale_ += internal::HealthTuning::kOverallWeight * good *
              (std::min(outcome.scale, kNotMeasured) - scale_);
  }
  double faulty = elsewhere;
  if (status.source.kind == Source::kRanges &&
      outcome.nis > internal::HealthTuning::kSignificantNis) {
    faulty *= 2.0 * (outcome.residual > 0.0 ? internal::HealthTuning::kLongShare
                                            : 1.0 - internal::HealthTuning::kLongShare);
  }
  const double right = good * ((1.0 - wrong) * fits + wrong) + status.faulty * faulty;
  status.faulty = std::min(status.faulty * (faulty / right), 1.0);
  double ratio = elsewhere / right;
  if (lost_ && ratio < 1.0) {
    ratio = 1.0 - agreement() * (1.0 - ratio);
  }
  odds_ = std::min(odds_ * ratio, internal::HealthTuning::kMaxOdds);
  odds_measured_ = std::min(odds_measured_ * ratio, internal::HealthTuning::kMaxOdds);
  update_state();
}

/// Eq. (6) of docs/health.md: how far the sources that publish agree.
double Health::agreement() const {
  double right = 0.0;
  double wrong = 0.0;
  for (const SourceStatus& status : sources_) {
    const double stays = 1.0 - seconds_between(status.last_received, stamp_) / config_.faulty_s;
    if (stays > 0.0 && says_of_place(status.source)) {
      const double usual = faulty_share(status.source);
      const double faulty = usual + stays * (status.faulty - usual);
      right += 1.0 - faulty;
      wrong += faulty;
    }
  }
  return right > wrong ? 1.0 - wrong / right : 0.0;
}

std::optional<double> Health::wrong_by_one_source() const {
  int contradict = 0;
  for (const SourceStatus& status : sources_) {
    if (says_of_place(status.source) &&
        seconds_between(status.last_received, stamp_) < config_.faulty_s) {
      if (faulty_share(status.source) != config_.faulty_share) {
        return std::nullopt;  // a sensor that hardly ever is wrong as a whole
      }
      contradict += status.faulty > internal::HealthTuning::kAgreesAgain ? 1 : 0;
    }
  }
  if (contradict > 1) {
    return std::nullopt;
  }
  return odds_measured_ / (1.0 + odds_measured_);
}

double Health::outlier_volume(const Range& /*z*/) const { return config_.wrong_span_m; }
double Health::outlier_volume(const PositionFix& /*z*/) const {
  return config_.wrong_span_m * config_.wrong_span_m;
}
double Health::outlier_volume(const PoseObservation& /*z*/) const {
  return config_.wrong_span_m * config_.wrong_span_m * 2.0 * kPi;
}
double Health::outlier_volume(const RangeBearing& z) const {
  return (z.range ? config_.wrong_span_m : 1.0) * (z.bearing ? 2.0 * kPi : 1.0) *
         (z.elevation ? kPi : 1.0);
}

double Health::outlier_volume(const Altitude& /*z*/) const { return config_.wrong_span_m; }
double Health::outlier_volume(const Heading& /*z*/) const { return 2.0 * kPi; }

bool Health::is_excluded(const NamedSource& source) const {
  if (excluded_ == 0 || odds_ > odds_found_) {
    return false;  // the pose is likelier wrong than the source
  }
  const auto place = std::lower_bound(
      sources_.begin(), sources_.end(), source,
      [](const SourceStatus& status, const NamedSource& wanted) { return status.source < wanted; });
  return place != sources_.end() && place->source == source && place->is_excluded;
}

/// Eq. (8) of docs/health.md: attributes too large innovations to the pose.
double Health::inflation(const PoseEstimate& estimate) const {
  const double excess = std::max(nis_ - 1.0 - internal::HealthTuning::kNisTolerance, 0.0);
  const double sigma = estimate.sigma_position();
  return 1.0 + excess * std::max(scale_ / (sigma * sigma), 1.0);
}

HealthReport Health::report(const PoseEstimate& estimate) const {
  check_stamp(estimate.stamp);
  HealthReport report;
  report.stamp = std::max(stamp_, estimate.stamp);
  const double since = seconds_between(stamp_, report.stamp);
  double odds = grown(odds_, since);
  if (is_out_of_date(report.stamp)) {
    odds = std::max(odds, odds_lost_);
  }
  report.wrong = odds / (1.0 + odds);
  report.inflation = inflation(estimate);
  const Matrix<3, 3> P = report.inflation * estimate.covariance;
  report.within =
      (1.0 - report.wrong) * internal::probability_within(config_.limit_m, P.topLeftCorner<2, 2>());
  if (report.wrong < 0.5 * config_.risk) {
    report.protection = quantile_ * P.diagonal().cwiseSqrt();
  }
  find_state(report);
  return report;
}

PoseEstimate Health::doubted(PoseEstimate estimate, double wrong) const {
  const double position = config_.wrong_span_m * config_.wrong_span_m / 3.0;
  const Vector<3> anywhere(position, position, kPi * kPi / 3.0);
  estimate.covariance.diagonal() += wrong * anywhere;
  return estimate;
}

void Health::find_state(HealthReport& report) const {
  report.source.reset();
  const Stamp silence = report.stamp - fused_;
  const bool is_silent = is_out_of_date(report.stamp);
  if (lost_ || is_silent) {
    report.state = HealthState::kLost;
    report.reason = is_silent           ? HealthReason::kSilence
                    : scans_contradict_ ? HealthReason::kScansDoNotFit
                                        : HealthReason::kMeasurements;
  } else if (silence > aiding_lost_) {
    report.state = HealthState::kDeadReckoning;
    report.reason = HealthReason::kSilence;
    for (const SourceStatus& status : sources_) {
      if (status.source.kind == Source::kScans &&
          status.faulty > internal::HealthTuning::kFaultySource) {
        report.reason = HealthReason::kLaserIsCovered;
        report.source = status.source;
      }
    }
  } else {
    find_degradation(report);
    report.state = report.reason == HealthReason::kNone ? HealthState::kOk : HealthState::kDegraded;
  }
}

/// Why a right pose is not kOk.
void Health::find_degradation(HealthReport& report) const {
  report.reason = HealthReason::kNone;
  if (suspect_since_) {
    report.reason = scans_contradict_ ? HealthReason::kScansDoNotFit : HealthReason::kMeasurements;
    return;
  }
  if (report.within < 0.5) {
    report.reason = HealthReason::kPositionIsVague;
  } else if (nis_ > internal::HealthTuning::kLargeNis +
                        internal::HealthTuning::kMaxMeanNis * outliers_ ||
             outliers_ > internal::HealthTuning::kManyOutliers) {
    report.reason = HealthReason::kNoiseIsLarger;
  }
  const auto end = sources_.end();
  for (auto first = sources_.begin(); first != end;) {  // one kind after another
    bool is_silent = true;
    auto status = first;
    for (; status != end && status->source.kind == first->source.kind; ++status) {
      const double since = seconds_between(status->last_received, report.stamp);
      is_silent = is_silent &&
                  since > std::max(config_.aiding_lost_s,
                                   internal::HealthTuning::kSilentIntervals * status->interval);
      if (status->faulty > internal::HealthTuning::kFaultySource) {
        report.reason = status->source.kind == Source::kScans ? HealthReason::kLaserIsCovered
                                                              : HealthReason::kSourceIsWrong;
        report.source = status->source;
      }
    }
    if (is_silent && !report.source) {
      report.reason = HealthReason::kSourceIsSilent;
      report.source = first->source;
    }
    first = status;
  }
}

}  // namespace locfuse
