// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/health.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "estimators/recipe.hpp"
#include "locfuse/messages/told_covariance.hpp"

namespace locfuse {
namespace {

constexpr double kOfSource = 1.0 / 32.0;  // weight of a message in the means of its source
constexpr double kOfAll = 1.0 / 64.0;     // likewise of all sources
constexpr double kMostOdds = 1e9;         // more says no more, and would never come back
constexpr double kNotable = 0.5;          // probability that a source is wrong, to be told
constexpr double kNoisy = 2.0;            // NIS per degree of freedom, to be told
constexpr double kMostNis = 10.0;         // of one message: more says no more
constexpr double kMostPeak = 1e100;       // of a likelihood over that of anything, likewise
constexpr double kNotableNis = 4.0;       // of a range, for its sign to tell
constexpr double kReadsLong = 0.9;        // share of ranges that are wrong and read long
constexpr double kChance = 0.3;           // by which a mean NIS is above 1 by chance
constexpr double kSilentIntervals = 10.0;
constexpr double kUsuallyExplained = 0.9;  // share of the returns of scans, before any came
constexpr double kUsuallyByChance = 0.3;   // likewise from anywhere else
constexpr double kOfScans = 1.0 / 64.0;    // weight of a scan in what is usual
constexpr double kForgets = 0.125;         // of that weight where a scan fits worse than usual
constexpr double kShareSigma = 0.12;       // of the explained share: people, furniture that moved
constexpr double kMostOfScan = 3.0;        // nats for or against a pose by one scan
constexpr double kMiddle = 0.4;            // between by chance and usual: a pose that lags
constexpr double kConfirms = 0.2;          // of that for a pose: a place looks alike for a while
constexpr double kMostScanOdds = 1e3;      // that scans alone speak for another pose
constexpr double kCoveredShare = 0.15;     // of returns more than usual: rather covered than not
constexpr double kCoveredSigma = 0.05;     // of that share, per nat
constexpr double kUsuallyCovered = 1e-3;   // share of the time
constexpr double kMostlyCovered = 0.5;     // from here on a scan says nothing of the pose

double odds_of(double probability) { return probability / (1.0 - probability); }

double share(const char* name, double value, double least, double most) {
  if (!(value > least && value < most)) {
    std::ostringstream text;
    text << name << " is " << value << ", expected a number between " << least << " and " << most;
    throw std::invalid_argument(text.str());
  }
  return value;
}

const Health::Config& checked(const Health::Config& c) {
  using internal::positive;
  positive("limit_m", c.limit_m);
  share("risk", c.risk, 0.0, 0.5);
  share("mean_s_between_losses", c.mean_s_between_losses, 1e-3, 1e12);
  share("wrong_share", c.wrong_share, 1e-9, 1.0);
  share("wrong_span_m", c.wrong_span_m, 1e-6, 1e12);
  share("chance_share", c.chance_share, 0.0, 1.0);
  share("faulty_share", c.faulty_share, 0.0, 1.0);
  share("faulty_share_unnamed", c.faulty_share_unnamed, 0.0, 1.0);
  positive("faulty_s", c.faulty_s);
  share("probability_lost", c.probability_lost, 0.0, 1.0);
  share("probability_found", c.probability_found, 0.0, 1.0);
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

/// Of the error in its own sigmas, for half of the risk to be beyond, to either side. That sigma is
/// no better known than from some innovations: hence Student's distribution, eq. (9).
double quantile_of(double risk) {
  constexpr double kDegreesOfFreedom = 8.0;
  // Of the lower tail: 1 less a small risk is 1.
  const double tail = std::max(0.25 * risk, std::numeric_limits<double>::min());
  return -boost::math::quantile(boost::math::students_t(kDegreesOfFreedom), tail);
}

/// Probability that a zero-mean Gaussian position stays within `radius`, eq. (7) of docs/health.md.
double probability_within(double radius, const Matrix<2, 2>& covariance) {
  constexpr int kAngles = 8;  // over a quarter turn; the integrand is smooth and periodic
  const double middle = 0.5 * (covariance(0, 0) + covariance(1, 1));
  const double half = std::hypot(0.5 * (covariance(0, 0) - covariance(1, 1)), covariance(0, 1));
  double sum = 0.0;
  for (int k = 0; k < kAngles; ++k) {
    const double cosine = std::cos((k + 0.5) * kPi / kAngles);
    sum += std::exp(-0.5 * radius * radius / std::max(middle + half * cosine, 1e-300));
  }
  return 1.0 - sum / kAngles;
}

}  // namespace

Health::Health(const Config& config)
    : config_(checked(config)),
      aiding_lost_(internal::stamps_of("aiding_lost_s", config.aiding_lost_s)),
      invalid_(internal::stamps_of("invalid_s", config.invalid_s)),
      doubt_(internal::stamps_of("doubt_s", config.doubt_s)),
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
  odds_ = odds_of(wrong);
  nis_ = 1.0;
  scale_ = 0.0;
  lost_ = false;
  doubted_.reset();
  sources_.clear();
  latest_ = 0;
  excluded_ = 0;
  explained_ = kUsuallyExplained;
  by_chance_ = kUsuallyByChance;
  covered_ = 0.0;
  scans_lost_ = false;
}

double Health::faulty_share(const NamedSource& source) const {
  if (source.kind == Source::kScans) {
    return kUsuallyCovered;
  }
  const bool is_sensor = source.kind == Source::kSightings && source.name == NamedSource::kNameless;
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
    fresh.heard = stamp;
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
  odds_ = std::min(odds_ + (1.0 + odds_) * seconds / config_.mean_s_between_losses, kMostOdds);
  if (is_out_of_date(stamp_)) {
    odds_ = std::max(odds_, odds_lost_);
    doubted_ = doubted_.value_or(stamp_);
    lost_ = true;
    return;
  }
  judge();
}

/// Doubt that lasts becomes loss: outliers that come together by chance do not last.
void Health::judge() {
  if (odds_ <= (lost_ ? odds_found_ : odds_lost_)) {
    lost_ = false;
    doubted_.reset();
    return;
  }
  doubted_ = doubted_.value_or(stamp_);
  lost_ = lost_ || stamp_ - *doubted_ >= doubt_;
}

void Health::hear(const NamedSource& source, Stamp stamp, const Outcome& outcome, double limit,
                  double breadth) {
  const bool is_fused = outcome.verdict == Verdict::kFused;
  if (!is_fused && outcome.verdict != Verdict::kGated) {
    return;
  }
  advance(stamp);
  SourceStatus& status = status_of(source, stamp);
  excluded_ -= status.faulty > config_.exclude_above ? 1 : 0;
  heard(status, stamp, is_fused);
  if (outcome.dof > 0) {
    status.residual = outcome.residual;
    status.sigma = std::sqrt(outcome.scale);
    status.test_ratio = outcome.nis / limit;
  }
  scans_lost_ = false;
  weigh(status, outcome, breadth);
  excluded_ += status.faulty > config_.exclude_above ? 1 : 0;
}

/// A scan that fits as usual speaks for the pose, one that fits as from anywhere against it, by the
/// distance of the two; one that is covered, against the laser.
void Health::hear(const ScanEvidence& scan) {
  advance(scan.stamp);
  SourceStatus& status = status_of({Source::kScans, NamedSource::kNameless}, scan.stamp);
  const double excess = (scan.covered - covered_ - kCoveredShare) / kCoveredSigma;
  const bool is_clear = scan.covered < kMostlyCovered;
  heard(status, scan.stamp, is_clear);
  const double more = scan.news * std::min(std::max(excess, -kMostOfScan), kMostOfScan);
  const double odds = std::min(odds_of(status.faulty) * std::exp(more), kMostScanOdds);
  status.faulty = odds / (1.0 + odds);
  if (!is_clear) {
    return;
  }
  // A pose that was searched for fits better than one by chance.
  const double least = lost_ ? 0.5 * (explained_ + by_chance_) : by_chance_;
  const double apart = std::max(explained_ - least, 0.0);
  const double middle = least + kMiddle * (explained_ - least);
  const double clear = 1.0 - scan.covered;
  const double variance =
      kShareSigma * kShareSigma + middle * (1.0 - middle) / (scan.independent * clear);
  const double says = clear * apart * (scan.explained - middle) / variance;
  const double most_for = kConfirms * kMostOfScan;
  const double nats = scan.news * std::min(std::max(says, -kMostOfScan), most_for);
  status.residual = scan.explained - explained_;
  status.sigma = std::sqrt(variance);
  status.test_ratio = (explained_ - scan.explained) / std::max(0.5 * apart, 1e-3);
  const double most = std::max(odds_, kMostScanOdds);
  odds_ = std::min(odds_ * std::exp(-nats), most);
  scans_lost_ = nats < 0.0;
  // What is usual is learnt where the pose is right, and forgotten slowly: a wrong place fits
  // worse.
  const double share = odds_ < odds_found_ ? kOfScans * scan.news : 0.0;
  const double worse = scan.explained < explained_ ? kForgets : 1.0;
  explained_ += share * worse * (scan.explained - explained_);
  by_chance_ += share * (scan.by_chance - by_chance_);
  covered_ += share * (1.0 - status.faulty) * (scan.covered - covered_);
  judge();
}

void Health::heard(SourceStatus& status, Stamp stamp, bool is_fused) {
  const double seconds = std::max(seconds_between(status.heard, stamp), 0.0);
  const double stays = std::max(1.0 - seconds / config_.faulty_s, 0.0);
  const double usual = faulty_share(status.source);
  status.faulty = usual + stays * (status.faulty - usual);
  status.interval += (status.interval > 0.0 ? kOfSource : 1.0) * (seconds - status.interval);
  status.heard = std::max(status.heard, stamp);
  status.accepted += kOfSource * ((is_fused ? 1.0 : 0.0) - status.accepted);
  if (is_fused) {
    status.fused = status.heard;
    fused_ = std::max(fused_, stamp);
  }
}

/// Eq. (2) to (5) of docs/health.md.
void Health::weigh(SourceStatus& status, const Outcome& outcome, double breadth) {
  double fits = 0.0;  // likelihood if it is right, over that of anything
  if (outcome.dof > 0) {
    const double volume = 2.0 * kPi * outcome.scale;
    const double peak = outcome.dof == 1   ? 1.0 / std::sqrt(volume)
                        : outcome.dof == 2 ? 1.0 / volume
                                           : std::pow(volume, -0.5 * outcome.dof);
    fits = std::exp(-0.5 * outcome.nis) * (std::min(breadth * peak, kMostPeak) + 2.0);
  }
  const double wrong = config_.wrong_share;
  const double elsewhere = 1.0 - config_.chance_share + config_.chance_share * fits;
  const double good = 1.0 - status.faulty;
  if (outcome.dof > 0) {
    const double ratio = std::min(outcome.nis / outcome.dof, kMostNis);
    status.nis += kOfSource * good * (ratio - status.nis);
    nis_ += kOfAll * good * (ratio - nis_);
    scale_ += kOfAll * good * (std::min(outcome.scale, kNotMeasured) - scale_);
  }
  double faulty = elsewhere;
  if (status.source.kind == Source::kRanges && outcome.nis > kNotableNis) {
    faulty *= 2.0 * (outcome.residual > 0.0 ? kReadsLong : 1.0 - kReadsLong);
  }
  const double right = good * ((1.0 - wrong) * fits + wrong) + status.faulty * faulty;
  status.faulty = std::min(status.faulty * (faulty / right), 1.0);
  double ratio = elsewhere / right;
  if (lost_ && ratio < 1.0) {
    ratio = 1.0 - agreement() * (1.0 - ratio);
  }
  odds_ = std::min(odds_ * ratio, kMostOdds);
  judge();
}

/// Eq. (6) of docs/health.md: how far sources that are heard agree, where the pose is in doubt.
double Health::agreement() const {
  double right = 0.0;
  double wrong = 0.0;
  for (const SourceStatus& status : sources_) {
    const double stays = 1.0 - seconds_between(status.heard, stamp_) / config_.faulty_s;
    if (stays > 0.0) {
      const double usual = faulty_share(status.source);
      const double faulty = usual + stays * (status.faulty - usual);
      right += 1.0 - faulty;
      wrong += faulty;
    }
  }
  return right > wrong ? 1.0 - wrong / right : 0.0;
}

double Health::breadth_of(const Range& /*z*/) const { return config_.wrong_span_m; }
double Health::breadth_of(const PositionFix& /*z*/) const {
  return config_.wrong_span_m * config_.wrong_span_m;
}
double Health::breadth_of(const PoseObservation& /*z*/) const {
  return config_.wrong_span_m * config_.wrong_span_m * 2.0 * kPi;
}
double Health::breadth_of(const RangeBearing& z) const {
  return (z.range ? config_.wrong_span_m : 1.0) * (z.bearing ? 2.0 * kPi : 1.0);
}

bool Health::is_excluded(const NamedSource& source) const {
  if (excluded_ == 0 || odds_ > odds_found_) {
    return false;  // rather the pose is wrong than the source
  }
  const auto place = std::lower_bound(
      sources_.begin(), sources_.end(), source,
      [](const SourceStatus& status, const NamedSource& wanted) { return status.source < wanted; });
  return place != sources_.end() && place->source == source &&
         place->faulty > config_.exclude_above;
}

/// Eq. (8) of docs/health.md: what innovations are too large by is put down to the pose.
double Health::inflation(const PoseEstimate& estimate) const {
  const double excess = std::max(nis_ - 1.0 - kChance, 0.0);
  const double sigma = estimate.sigma_position();
  return 1.0 + excess * std::max(scale_ / (sigma * sigma), 1.0);
}

HealthReport Health::report(const PoseEstimate& estimate) const {
  check_stamp(estimate.stamp);
  HealthReport report;
  report.stamp = std::max(stamp_, estimate.stamp);
  const double since = seconds_between(stamp_, report.stamp);
  double odds = std::min(odds_ + (1.0 + odds_) * since / config_.mean_s_between_losses, kMostOdds);
  if (is_out_of_date(report.stamp)) {
    odds = std::max(odds, odds_lost_);
  }
  report.wrong = odds / (1.0 + odds);
  report.inflation = inflation(estimate);
  const Matrix<3, 3> P = report.inflation * estimate.covariance;
  report.within =
      (1.0 - report.wrong) * probability_within(config_.limit_m, P.topLeftCorner<2, 2>());
  if (report.wrong < 0.5 * config_.risk) {
    report.protection = quantile_ * P.diagonal().cwiseSqrt();
  }
  find_state(report);
  return report;
}

void Health::find_state(HealthReport& report) const {
  report.source.reset();
  const Stamp silence = report.stamp - fused_;
  const bool is_silent = is_out_of_date(report.stamp);
  if (lost_ || is_silent) {
    report.state = HealthState::kLost;
    report.clue = is_silent     ? HealthClue::kSilence
                  : scans_lost_ ? HealthClue::kScansDoNotFit
                                : HealthClue::kMeasurements;
  } else if (silence > aiding_lost_) {
    report.state = HealthState::kDeadReckoning;
    report.clue = HealthClue::kSilence;
    for (const SourceStatus& status : sources_) {
      if (status.source.kind == Source::kScans && status.faulty > kNotable) {
        report.clue = HealthClue::kLaserIsCovered;
        report.source = status.source;
      }
    }
  } else {
    find_flaw(report);
    report.state = report.clue == HealthClue::kNone ? HealthState::kOk : HealthState::kDegraded;
  }
}

/// What a right pose may suffer from.
void Health::find_flaw(HealthReport& report) const {
  report.clue = HealthClue::kNone;
  if (doubted_) {
    report.clue = scans_lost_ ? HealthClue::kScansDoNotFit : HealthClue::kMeasurements;
    return;
  }
  if (report.within < 0.5) {
    report.clue = HealthClue::kPositionIsVague;
  } else if (nis_ > kNoisy) {
    report.clue = HealthClue::kNoiseIsLarger;
  }
  const auto end = sources_.end();
  for (auto first = sources_.begin(); first != end;) {  // one kind after another
    bool is_silent = true;
    auto status = first;
    for (; status != end && status->source.kind == first->source.kind; ++status) {
      const double since = seconds_between(status->heard, report.stamp);
      is_silent =
          is_silent && since > std::max(config_.aiding_lost_s, kSilentIntervals * status->interval);
      if (status->faulty > kNotable) {
        report.clue = status->source.kind == Source::kScans ? HealthClue::kLaserIsCovered
                                                            : HealthClue::kSourceIsWrong;
        report.source = status->source;
      }
    }
    if (is_silent && !report.source) {
      report.clue = HealthClue::kSourceIsSilent;
      report.source = first->source;
    }
    first = status;
  }
}

}  // namespace locfuse
