// SPDX-License-Identifier: Apache-2.0
#include "locfuse/recovery/initializer.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/error.hpp"
#include "locfuse/frontends/constellation.hpp"
#include "locfuse/frontends/multilateration.hpp"
#include "locfuse/math/chi_squared.hpp"
#include "recovery/outlier.hpp"

namespace locfuse {
namespace {

using internal::log_anything;
using internal::log_density;
using internal::log_sum;

/// What shapes the start besides Initializer::Config; docs/start.md.
struct InitializerTuning {
  static constexpr int kMaxLinkCount = 1 << 30;  ///< messages of a link, beyond which none count
  /// Squared Mahalanobis distance below which two positions are one: three sigma.
  static constexpr double kSamePositionDistance = 9.0;
  /// Probability below which a hypothesis is not reported.
  static constexpr double kMinProbability = 1e-3;
  /// Sightings of one stamp; more take long and add nothing.
  static constexpr std::size_t kMaxSightings = 128;
  /// Share of the largest eigenvalue of a scan match's information below which a direction is not
  /// observed.
  static constexpr double kMinEigenvalueShare = 1e-6;
  /// Sigma of a component's heading, in steps between headings: the sum of such Gaussians is flat
  /// to 1 %.
  static constexpr double kHeadingSigmaSteps = 0.6;
  /// Probability that measurements of the stated noise scatter no more than those that make
  /// the search begin anew with more noise: one right start in a thousand is delayed.
  static constexpr double kUsualScatter = 0.999;
  /// The same of those whose weights and covariances are taken for too sure.
  static constexpr double kReadyScatter = 0.99;
  /// Measurements that show the noise: of fewer a single one behind a wall may be the reason.
  static constexpr int kScatterRows = 8;
  /// Links whose ranges make a position more than a guess: with two it has a mirror image.
  static constexpr std::size_t kPlaceLinks = 3;
  /// Sigmas that a position must have changed by to have changed.
  static constexpr double kMovedSigmas = 3.0;
};

constexpr double kMinVariance = kPositionBounds.min * kPositionBounds.min;
constexpr const char* kNoneKnown = "no range between a known tag and a known anchor";

/// The rest of what odometry last said, from `stamp` on; empty where nothing is left.
std::optional<Message> from(const Message& control, Stamp stamp) {
  if (const Velocity* held = std::get_if<Velocity>(&control)) {
    return Velocity{std::max(held->stamp, stamp), held->forward, held->turn_rate, held->left};
  }
  const Increment& last = std::get<Increment>(control);
  if (last.begin >= stamp) {
    return last;
  }
  if (last.stamp <= stamp) {
    return std::nullopt;
  }
  const double left = seconds_between(stamp, last.stamp) / seconds_between(last.begin, last.stamp);
  Increment rest{stamp, last.stamp, arc_share(last.motion, left)};
  if (last.variance) {
    rest.variance = left * *last.variance;
  }
  return rest;
}

double in_range(const char* name, double value, double low, double high) {
  if (!(value > low && value < high)) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                                ", expected more than " + std::to_string(low) + " and less than " +
                                std::to_string(high));
  }
  return value;
}

/// What a match says of the pose, one row per direction that it sees, on a map that is itself known
/// to `map_covariance`.
Linearization<Eigen::Dynamic, 3> pose_rows(const ScanMatch& match, const Pose2& pose,
                                           const Matrix<3, 3>& map_covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix<3, 3>> eigen(match.information);
  const double min_eigenvalue = InitializerTuning::kMinEigenvalueShare * eigen.eigenvalues()(2);
  const Eigen::Index unseen = (eigen.eigenvalues().array() <= min_eigenvalue).count();
  const Eigen::Index seen = 3 - unseen;
  Linearization<Eigen::Dynamic, 3> lin;
  lin.jacobian = eigen.eigenvectors().rightCols(seen).transpose();
  lin.residual = lin.jacobian * local(match.pose, pose);
  lin.noise = lin.jacobian * map_covariance * lin.jacobian.transpose();
  lin.noise.diagonal() += eigen.eigenvalues().tail(seen).cwiseInverse();
  return lin;
}

/// A sighting as the body sees it, and the log of the area [m^2] that a range and a bearing of one
/// metre and one radian take there.
struct Seen {
  SeenLandmark landmark;
  double log_area;
};

/// Empty if range or bearing is missing, or the range so short that the noise has no area.
std::optional<Seen> seen_by(const RangeBearingModel& model, const RangeBearing& z) {
  const std::optional<RangeBearingModel::Placed> placed = model.place(Pose2{}, z);
  if (!placed) {
    return std::nullopt;
  }
  const Matrix<2, 2>& J = placed->by_observation;
  const Matrix<2, 2> noise = J * model.noise(z) * J.transpose();
  const double log_area = std::log(std::abs(J.determinant()));
  if (!std::isfinite(log_area) || noise.llt().info() != Eigen::Success) {
    return std::nullopt;
  }
  return Seen{{placed->position, noise, z.landmark}, log_area};
}

/// The ranges of an epoch to one tag, as positioning takes them.
struct TagRanges {
  Id tag = 0;
  Vector<2> tag_in_body = Vector<2>::Zero();
  double height = 0.0;
  std::vector<Vector<3>> anchor;
  std::vector<double> range;
  std::vector<double> sigma;

  [[nodiscard]] int rows() const { return static_cast<int>(range.size()); }
};

TagRanges ranges_of(const Tag& tag, const std::vector<Range>& epoch, const AnchorMap& anchors,
                    const RangeModel::Config& noise) {
  TagRanges epoch_ranges{tag.id, tag.position.head<2>(), tag.position.z(), {}, {}, {}};
  for (const Range& z : epoch) {
    const Anchor* anchor = z.tag == tag.id ? anchors.find(z.anchor) : nullptr;
    const double range = anchor != nullptr ? (z.range - anchor->offset) / anchor->scale : 0.0;
    if (range > 0.0) {
      const double sigma = std::hypot(noise.sigma_m, noise.sigma_relative * z.range);
      epoch_ranges.anchor.push_back(anchor->position);
      epoch_ranges.range.push_back(range);
      epoch_ranges.sigma.push_back(z.sigma.value_or(sigma) / anchor->scale);
    }
  }
  return epoch_ranges;
}

/// Of the tag with ranges to most anchors.
TagRanges most_ranges(const std::vector<Range>& epoch, const std::vector<Tag>& tags,
                      const AnchorMap& anchors, const RangeModel::Config& noise) {
  TagRanges most;
  for (const Tag& tag : tags) {
    TagRanges epoch_ranges = ranges_of(tag, epoch, anchors, noise);
    if (epoch_ranges.rows() > most.rows()) {
      most = std::move(epoch_ranges);
    }
  }
  return most;
}

/// The position of the tag, by SR-LS.
RangePosition<2> located(const TagRanges& ranges) {
  std::vector<double> rows;
  for (const Vector<3>& anchor : ranges.anchor) {
    rows.insert(rows.end(), anchor.data(), anchor.data() + 3);
  }
  const Eigen::Index size = ranges.rows();
  try {
    return locate_by_squares({RowsView(rows.data(), size, 3), ranges.height},
                             Eigen::Map<const Eigen::VectorXd>(ranges.range.data(), size),
                             Eigen::Map<const Eigen::VectorXd>(ranges.sigma.data(), size));
  } catch (const std::invalid_argument&) {
    RangePosition<2> refused;
    refused.status = PositionStatus::kBadRange;
    return refused;
  }
}

/// Why no heading of a scan is a start.
std::string why_none(const HeadingStart& found) {
  std::ostringstream reason;
  reason << std::setprecision(2);
  switch (found.search.reason) {
    case HeadingSearch::Reason::kNoReturns:
      return "the last scan has no return";
    case HeadingSearch::Reason::kOutsideMap:
      return "the position that ranges give is off the map";
    case HeadingSearch::Reason::kFound:
      reason << "no heading fits the map: at the best of 36 the scan ends " << found.distance
             << " m from its walls on average, more than " << found.limit
             << " m; is it the map of this place?";
  }
  return reason.str();
}

/// Whether a measurement is likelier one of the right pose than one that says nothing.
bool is_inlier(const Outcome& outcome, double wrong_share, double log_anything) {
  return std::log1p(-wrong_share) + outcome.log_likelihood() > std::log(wrong_share) + log_anything;
}

/// Whether measurements of the stated noise would scatter less, with that probability.
bool exceeds(const internal::Scatter& scatter, double probability) {
  return scatter.rows >= InitializerTuning::kScatterRows && scatter.nis > scatter.rows &&
         scatter.nis > chi_squared_quantile(scatter.rows, probability);
}

/// Variance of the noise over the stated one, where it is likely larger.
double excess(const internal::Scatter& scatter) {
  return exceeds(scatter, InitializerTuning::kReadyScatter) ? scatter.nis / scatter.rows : 1.0;
}

void add(internal::Scatter& scatter, const Outcome& outcome) {
  scatter.nis += outcome.nis;
  scatter.rows += outcome.dof;
}

/// Where a tag may be, in world.
struct Fit {
  Vector<2> position;
  Matrix<2, 2> covariance;
  double cost;
};

/// The second says nothing new beside the first: within three sigma, and no less likely.
bool is_same_place(const Fit& fit, const Fit& other) {
  const Vector<2> apart = fit.position - other.position;
  return other.cost <= fit.cost &&
         apart.dot((fit.covariance + other.covariance).llt().solve(apart)) <
             InitializerTuning::kSamePositionDistance;
}

/// Every position that ranges allow, without the range `left_out` if that is not negative.
std::vector<Fit> positions(const TagRanges& epoch_ranges, int left_out) {
  std::vector<double> rows;
  std::vector<double> ranges;
  std::vector<double> sigmas;
  for (int i = 0; i < epoch_ranges.rows(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (i != left_out && static_cast<int>(ranges.size()) < kMaxRanges) {
      rows.insert(rows.end(), epoch_ranges.anchor[k].data(), epoch_ranges.anchor[k].data() + 3);
      ranges.push_back(epoch_ranges.range[k]);
      sigmas.push_back(epoch_ranges.sigma[k]);
    }
  }
  const auto size = static_cast<Eigen::Index>(ranges.size());
  const AnchorTable table{RowsView(rows.data(), size, 3), epoch_ranges.height};
  const RangeLayout<2> layout(table, Eigen::Map<const Eigen::VectorXd>(sigmas.data(), size));
  const RangeMinima<2> minima = internal::find_minima<2>(
      layout, Eigen::Map<const Eigen::VectorXd>(ranges.data(), size), RangeLoss{}, -1.0);
  const double reach = *std::max_element(ranges.begin(), ranges.end());
  std::vector<Fit> fits;
  for (std::size_t j = 0; j < static_cast<std::size_t>(minima.count); ++j) {
    const RangeFit<2>& fit = minima.fit[j];
    if (fit.converged && !fit.saddle && !internal::leaves_open<2>(fit.information, reach)) {
      const Matrix<2, 2> covariance = fit.information.llt().solve(Matrix<2, 2>::Identity());
      fits.push_back(
          {fit.position + layout.centre, 0.5 * (covariance + covariance.transpose()), fit.cost});
    }
  }
  return fits;
}

/// A start compares hypotheses by what the filter of independent errors says of each.
PoseEkf::Config independent(PoseEkf::Config config) {
  config.correlation_s = 0.0;
  return config;
}

}  // namespace

Initializer::Initializer(const Config& config, const World& world)
    : config_(config),
      anchors_(internal::anchors_of(world)),
      tags_(world.tags),
      matcher_(world.matcher),
      gate_(config.estimator.pose.gate),
      prototype_(independent(config.estimator), world, {0, {}, Matrix<3, 3>::Identity()}),
      tracker_(config.estimator, world, {0, {}, Matrix<3, 3>::Identity()}) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (config.method == StartMethod::kSrlsHeadings) {
    waiting_for_ = kNoneKnown;
  }
  in_range("epoch_s", config.epoch_s, 0.0, 3600.0);
  in_range("headings", config.headings, 3.0, 361.0);
  in_range("wrong_share", config.wrong_share, 0.0, 1.0);
  in_range("wrong_span_m", config.wrong_span_m, 0.0, kInfinity);
  in_range("spacing_m", config.spacing_m, 0.0, kInfinity);
  in_range("spacing_heading_rad", config.spacing_heading_rad, 0.0, kInfinity);
  in_range("sigma_map_m", config.sigma_map_m, 0.0, 1e3);
  in_range("sigma_map_rad", config.sigma_map_rad, 0.0, 10.0);
  in_range("standing_ranges", config.standing_ranges, 0.0, kInfinity);
  in_range("probability_ready", config.probability_ready, 0.5, 1.0);
  in_range("sigma_xy_ready_m", config.sigma_xy_ready_m, 0.0, kInfinity);
  in_range("sigma_heading_ready_rad", config.sigma_heading_ready_rad, 0.0, kInfinity);
  if (config.tag_conditioner) {
    conditioner_.emplace(*config.tag_conditioner, tags_);
  }
}

void Initializer::on(const Message& message) {
  std::visit([this](const auto& m) { on(m); }, message);
}

/// What fails leaves all as it was.
template <class Call>
void Initializer::attempt(const Call& call) {
  Initializer before = *this;
  try {
    call();
  } catch (...) {
    *this = std::move(before);
    throw;
  }
}

// Odometry ----------------------------------------------------------------------------------------

void Initializer::on(const Velocity& u) {
  validate(u);
  if (!is_plausible(u, config_.estimator.limits)) {
    return;
  }
  attempt([&] {
    const Velocity* last = control_ ? std::get_if<Velocity>(&*control_) : nullptr;
    if (last != nullptr && u.stamp > last->stamp) {
      const double seconds =
          std::min(seconds_between(last->stamp, u.stamp), config_.estimator.hold_s);
      moved(arc(last->forward * seconds, last->left * seconds, last->turn_rate * seconds));
    }
    drive(u);
  });
}

void Initializer::on(const Increment& u) {
  validate(u);
  if (!is_plausible(u, config_.estimator.limits)) {
    return;
  }
  attempt([&] {
    moved(u.motion);
    drive(u);
  });
}

template <class M>
void Initializer::drive(const M& u) {
  control_ = u;
  if (conditioner_) {
    conditioner_->on(u);
  }
  if (place_) {
    place_->driven.ekf.on(u);
  }
  for (Component& component : components_) {
    component.ekf.on(u);
  }
}

void Initializer::moved(const Pose2& motion) {
  since_scan_.for_each([&](Pose2& since) { since = since * motion; });
  since_sightings_ = since_sightings_ * motion;
  since_ranges_m_ += std::hypot(motion.x, motion.y);
  epoch_path_m_ += std::hypot(motion.x, motion.y);
  if (since_ranges_m_ > config_.spacing_m) {
    since_ranges_m_ = 0.0;
    links_.clear();
  }
}

/// Far enough that what is measured now errs by itself.
bool Initializer::moved_on(const Pose2& motion) const {
  return motion.position().norm() > config_.spacing_m ||
         std::abs(motion.heading) > config_.spacing_heading_rad;
}

// Ranges ------------------------------------------------------------------------------------------

void Initializer::on(const Range& z) {
  validate(z);
  if (!is_plausible(z, config_.estimator.limits)) {
    return;
  }
  attempt([&] {
    if (config_.method == StartMethod::kSrlsHeadings) {
      collect(z);
      return;
    }
    if (components_.empty() && ends_epoch(z)) {
      locate();
      epoch_.clear();
    }
    if (!components_.empty()) {
      weigh_range(z);
      check_noise(&Component::ranges, range_noise_);
    } else if (is_known(z)) {
      epoch_.push_back(widened(z));
    } else if (epoch_.empty()) {
      waiting_for_ = kNoneKnown;
    }
  });
}

bool Initializer::is_known(const Range& z) const {
  return anchors_->find(z.anchor) != nullptr &&
         std::any_of(tags_.begin(), tags_.end(), [&](const Tag& tag) { return tag.id == z.tag; });
}

bool Initializer::ends_epoch(const Range& z) const {
  const auto is_same_link = [&](const Range& other) {
    return other.tag == z.tag && other.anchor == z.anchor;
  };
  return !epoch_.empty() && (seconds_between(epoch_.front().stamp, z.stamp) > config_.epoch_s ||
                             std::any_of(epoch_.begin(), epoch_.end(), is_same_link));
}

void Initializer::weigh_range(const Range& z) {
  if (is_adrift()) {
    follow_place();
  }
  // What a radio reads wrong while it stands is wrong again next time: it is evidence once, and
  // averaging has an end, unless it may have moved for all that anybody knows.
  const int before = counted_before(z);
  if (before < config_.standing_ranges || is_adrift()) {
    const bool fits =
        weigh(widened(z),
              before == 0 ? std::optional(log_anything(z, config_.wrong_span_m)) : std::nullopt);
    if (Link* link = link_of(z)) {
      link->fits = fits;
    }
    reduce();
  }
}

/// Without odometry the likeliest component shows that the body has moved on.
void Initializer::follow_place() {
  const PoseEstimate here = components_.front().ekf.current();
  const double least = config_.spacing_m + InitializerTuning::kMovedSigmas * here.sigma_position();
  if ((here.pose.position() - ranged_at_).norm() > least) {
    ranged_at_ = here.pose.position();
    links_.clear();
  }
}

/// With the noise by which ranges were found to scatter.
Range Initializer::widened(Range z) const {
  if (range_noise_ > 1.0) {
    const RangeModel::Config& noise = config_.estimator.range;
    const double sigma = std::hypot(noise.sigma_m, noise.sigma_relative * z.range);
    z.sigma = std::sqrt(range_noise_) * z.sigma.value_or(sigma);
  }
  return z;
}

/// Begins anew with more noise where the best component does not explain how measurements scatter:
/// then its weight and its covariance are not to be believed. docs/start.md, eq. (3).
void Initializer::check_noise(Scatter Component::*of, double& factor) {
  const Scatter& scatter = components_.front().*of;
  if (exceeds(scatter, InitializerTuning::kUsualScatter)) {
    factor *= scatter.nis / scatter.rows;
    begin_anew();
  }
}

/// Forgets what was measured, but not the odometry and how measurements scatter.
void Initializer::begin_anew() {
  components_.clear();
  epoch_.clear();
  sightings_.clear();
  log_before_ = 0.0;
  log_nowhere_ = -std::numeric_limits<double>::infinity();
  links_.clear();
  since_sightings_ = {};
  most_sightings_ = 0;
  named_.clear();
  since_ranges_m_ = 0.0;
  since_scan_.clear();
  waiting_for_ = "measurements scatter more than their sigmas say";
}

int Initializer::counted_before(const Range& z) {
  if (!is_known(z)) {
    return 0;
  }
  if (Link* link = link_of(z)) {
    return std::exchange(link->count, std::min(link->count, InitializerTuning::kMaxLinkCount) + 1);
  }
  links_.push_back({z.tag, z.anchor, 1});
  return 0;
}

Initializer::Link* Initializer::link_of(const Range& z) {
  const auto link = std::find_if(links_.begin(), links_.end(), [&](const Link& one) {
    return one.tag == z.tag && one.anchor == z.anchor;
  });
  return link != links_.end() ? &*link : nullptr;
}

// Positions, poses, scans -------------------------------------------------------------------------

void Initializer::on(const PositionFix& received) {
  validate(received);
  if (config_.method == StartMethod::kSrlsHeadings ||
      !is_plausible(received, config_.estimator.limits)) {
    return;
  }
  attempt([&] {
    const std::optional<PositionFix> conditioned =
        conditioner_ ? conditioner_->conditioned(received) : received;
    if (!conditioned) {
      return;
    }
    const PositionFix& z = *conditioned;
    const PositionModel model(config_.estimator.position, tags_);
    const std::optional<Vector<2>> lever = model.lever(z.tag);
    const ReportedNoise<2> noise = model.noise(z);
    if (lever && noise.rows == 2) {
      best_fix_ = std::min(best_fix_, std::sqrt(noise.noise.diagonal().maxCoeff()));
    }
    if (!components_.empty()) {
      (void)weigh(widened(z), log_anything(z, config_.wrong_span_m));
      reduce();
      check_noise(&Component::positions, position_noise_);
    } else if (lever && noise.rows == 2) {
      add_positions(z.position, position_noise_ * noise.noise, *lever, 0.0, z.stamp);
    }
  });
}

/// With the noise by which fixes were found to scatter.
PositionFix Initializer::widened(PositionFix z) const {
  if (position_noise_ > 1.0) {
    const ReportedNoise<2> noise = PositionModel(config_.estimator.position, tags_).noise(z);
    if (noise.rows == 2) {
      z.covariance = position_noise_ * noise.noise;
    }
  }
  return z;
}

void Initializer::on(const PoseObservation& z) {
  validate(z);
  if (config_.method == StartMethod::kSrlsHeadings || config_.watch_poses ||
      !is_plausible(z, config_.estimator.limits)) {
    return;
  }
  attempt([&] {
    if (!components_.empty()) {
      (void)weigh(z, log_anything(z, config_.wrong_span_m));
      reduce();
      return;
    }
    const Pose2 pose{z.pose.x, z.pose.y, wrap_angle(z.pose.heading)};
    if (const ReportedNoise<3> noise = PoseModel(config_.estimator.pose).noise(z);
        noise.rows == 3) {
      components_.push_back(component({z.stamp, pose, noise.noise}, 0.0));
    }
  });
}

void Initializer::on(const Heading& z) {
  validate(z);
  attempt([&] {
    if (!components_.empty()) {
      (void)weigh(z, log_anything(z, config_.wrong_span_m));
      reduce();
    }
  });
}

void Initializer::on(const RangeBearing& z) {
  validate(z);
  if (config_.method == StartMethod::kGaussianSum && is_plausible(z, config_.estimator.limits) &&
      (!z.landmark || prototype_.landmark_map().find(*z.landmark) != nullptr)) {
    attempt([&] { see(z); });
  }
}

void Initializer::see(const RangeBearing& z) {
  if (!sightings_.empty() && sightings_.front().stamp != z.stamp) {
    sightings_.clear();
  }
  if (sightings_.size() == InitializerTuning::kMaxSightings) {
    return;
  }
  if (sightings_.empty()) {
    if (moved_on(since_sightings_)) {
      since_sightings_ = {};
      most_sightings_ = 0;
      named_.clear();
    }
    log_before_ = components_.empty() ? 0.0 : components_.front().log_weight;
  }
  sightings_.push_back(z);
  // What is seen again from the same place errs the same way, so it is evidence once.
  const bool is_news =
      z.landmark ? named_.insert(*z.landmark).second : sightings_.size() > most_sightings_;
  if (!is_news) {
    return;
  }
  (void)weigh(z, log_anything(z, config_.wrong_span_m));
  log_nowhere_ += log_by_chance(z);
  add_constellations();
  if (!components_.empty()) {
    most_sightings_ = sightings_.size();
    reduce();
  }
}

/// Log density of a sighting if no component is right: eq. (2) of docs/start.md. One without a name
/// may be of any landmark.
double Initializer::log_by_chance(const RangeBearing& z) const {
  const std::size_t landmarks = prototype_.landmark_map().landmarks().size();
  const double choices = z.landmark || landmarks == 0 ? 1.0 : static_cast<double>(landmarks);
  return log_anything(z, config_.wrong_span_m) + std::log(choices);
}

/// Adds the poses that the newest sighting allows with each of the same stamp before it, unless a
/// component is there already: eq. (2) of docs/start.md.
void Initializer::add_constellations() {
  const std::optional<Seen> newest = seen_by(prototype_.landmark_model(), sightings_.back());
  const double probability = std::min(config_.estimator.landmark.gate, 0.9999);
  const double anywhere = -2.0 * std::log(config_.wrong_span_m) - std::log(2.0 * kPi);
  const double prior =
      components_.empty() ? anywhere : log_before_ + std::log(config_.wrong_share) + anywhere;
  std::vector<Component> found;
  for (std::size_t i = 0; newest && i + 1 < sightings_.size(); ++i) {
    const std::optional<Seen> other = seen_by(prototype_.landmark_model(), sightings_[i]);
    if (!other) {
      continue;
    }
    const double log_area = other->log_area + newest->log_area;
    for (const ConstellationMatch& match : match_constellation(
             other->landmark, newest->landmark, prototype_.landmark_map(), probability)) {
      const PoseEstimate estimate{sightings_.back().stamp, match.pose, match.covariance};
      const auto tells_it = [&](const Component& known) {
        return internal::are_within(InitializerTuning::kSamePositionDistance, known.ekf.current(),
                                    estimate, true);
      };
      if (std::any_of(components_.begin(), components_.end(), tells_it) ||
          std::any_of(found.begin(), found.end(), tells_it)) {
        continue;
      }
      found.push_back(component(estimate, prior + match.log_evidence + log_area));
      for (std::size_t k = 0; k + 1 < sightings_.size(); ++k) {
        if (k != i) {
          (void)weigh(found.back(), sightings_[k],
                      log_anything(sightings_[k], config_.wrong_span_m));
        }
      }
    }
  }
  if (components_.empty() && !found.empty()) {
    log_nowhere_ = std::log(config_.wrong_share);
    for (const RangeBearing& z : sightings_) {
      log_nowhere_ += log_by_chance(z);
    }
  }
  components_.insert(components_.end(), std::make_move_iterator(found.begin()),
                     std::make_move_iterator(found.end()));
}

/// Whether the likeliest component took it.
template <class M>
bool Initializer::weigh(const M& z, const std::optional<double>& log_outlier) {
  bool fits = false;
  for (std::size_t i = 0; i < components_.size(); ++i) {
    const bool is_fused = weigh(components_[i], z, log_outlier);
    fits = i == 0 ? is_fused : fits;
  }
  return fits;
}

template <class M>
bool Initializer::weigh(Component& component, const M& z,
                        const std::optional<double>& log_outlier) const {
  const Outcome outcome = component.ekf.on(z);
  if (log_outlier && outcome.dof > 0) {
    component.log_weight += log_density(outcome, config_.wrong_share, *log_outlier);
  }
  if constexpr (std::is_same_v<M, Range> || std::is_same_v<M, PositionFix>) {
    if (outcome.dof > 0 &&
        is_inlier(outcome, config_.wrong_share, log_anything(z, config_.wrong_span_m))) {
      add(component.all, outcome);
      if (log_outlier) {
        add(std::is_same_v<M, Range> ? component.ranges : component.positions, outcome);
      }
    }
  }
  return outcome.verdict == Verdict::kFused;
}

Initializer::Component Initializer::component(const PoseEstimate& start, double log_weight) const {
  PoseEkf ekf = started(prototype_, start);
  if (!control_ && !moves_) {  // one that is switched on stands
    ekf.on(Velocity{start.stamp, 0.0, 0.0});
  }
  return {std::move(ekf), log_weight};
}

PoseEstimate Initializer::about(const Vector<2>& tag_in_world, const Matrix<2, 2>& covariance,
                                const Vector<2>& tag_in_body, double heading, double sigma,
                                Stamp stamp) {
  Matrix<2, 2> known = covariance;  // no better than a state may be, or nothing of it is left in P
  known.diagonal() = known.diagonal().cwiseMax(kMinVariance);
  const Vector<2> arm = Pose2{0.0, 0.0, heading}.act(tag_in_body);
  const Vector<2> body = tag_in_world - arm;
  const Vector<2> swing(arm.y(), -arm.x());  // d body / d heading
  Matrix<3, 3> P;
  P.topLeftCorner<2, 2>() = known + sigma * sigma * swing * swing.transpose();
  P.topRightCorner<2, 1>() = sigma * sigma * swing;
  P.bottomLeftCorner<1, 2>() = sigma * sigma * swing.transpose();
  P(2, 2) = sigma * sigma;
  return {stamp, {body.x(), body.y(), heading}, P};
}

void Initializer::add_positions(const Vector<2>& tag_in_world, const Matrix<2, 2>& covariance,
                                const Vector<2>& tag_in_body, double log_weight, Stamp stamp) {
  const double step = 2.0 * kPi / config_.headings;
  const double sigma = InitializerTuning::kHeadingSigmaSteps * step;
  std::vector<Component> added;
  added.reserve(static_cast<std::size_t>(config_.headings));
  for (int k = 0; k < config_.headings; ++k) {
    added.push_back(
        component(about(tag_in_world, covariance, tag_in_body, wrap_angle(k * step), sigma, stamp),
                  log_weight));
  }
  components_.insert(components_.end(), std::make_move_iterator(added.begin()),
                     std::make_move_iterator(added.end()));
}

/// Adds the poses that the epoch's ranges allow. They were taken before: an epoch that makes
/// trouble is forgotten.
void Initializer::locate() {
  try {
    attempt([&] { locate_by(epoch_); });
    return;
  } catch (const std::invalid_argument&) {
  } catch (const NumericalError&) {
  }
  epoch_.clear();
  waiting_for_ = "ranges that no position is found of";
}

void Initializer::locate_by(const std::vector<Range>& epoch) {
  const TagRanges epoch_ranges = most_ranges(epoch, tags_, *anchors_, config_.estimator.range);
  if (epoch_ranges.rows() < 2) {
    waiting_for_ = epoch_ranges.rows() == 0 ? kNoneKnown : "ranges to one anchor only";
    return;
  }
  std::vector<Fit> fits = positions(epoch_ranges, -1);
  for (int left_out = 0; epoch_ranges.rows() > 2 && left_out < epoch_ranges.rows(); ++left_out) {
    for (Fit& fit : positions(epoch_ranges, left_out)) {  // any range may be wrong
      fit.cost -= 2.0 * std::log(config_.wrong_share);
      if (std::none_of(fits.begin(), fits.end(),
                       [&](const Fit& other) { return is_same_place(fit, other); })) {
        fits.push_back(fit);
      }
    }
  }
  waiting_for_ = "ranges to anchors in one place only";
  double least = std::numeric_limits<double>::infinity();
  for (const Fit& fit : fits) {
    least = std::min(least, fit.cost);
  }
  for (const Fit& fit : fits) {
    add_positions(fit.position, fit.covariance, epoch_ranges.tag_in_body, -0.5 * (fit.cost - least),
                  epoch.back().stamp);
  }
  for (const Range& z : epoch) {
    if (z.tag == epoch_ranges.tag) {
      (void)counted_before(z);
    } else if (!components_.empty()) {  // another tag of the body shows the heading
      weigh_range(z);
    }
  }
}

// SR-LS and headings ------------------------------------------------------------------------------

void Initializer::use_gaussian_sum() { config_.method = StartMethod::kGaussianSum; }

void Initializer::collect(const Range& z) {
  if (!is_known(z)) {
    return;
  }
  if (ends_epoch(z)) {
    (void)place_by_squares();
    epoch_.clear();
  }
  epoch_path_m_ = epoch_.empty() ? 0.0 : epoch_path_m_;
  epoch_.push_back(z);
}

/// The newest position that ranges determine; where they do not, false, and the one before stays.
bool Initializer::place_by_squares() {
  const TagRanges ranges = most_ranges(epoch_, tags_, *anchors_, config_.estimator.range);
  if (ranges.rows() < 3) {
    waiting_for_ = ranges.rows() == 0
                       ? kNoneKnown
                       : "ranges of a tag to fewer than three anchors within epoch_s";
    return false;
  }
  const RangePosition<2> found = located(ranges);
  if (found.status != PositionStatus::kUnique) {
    waiting_for_ = found.status == PositionStatus::kAmbiguous
                       ? "two positions fit the ranges: their anchors are in one line"
                       : "ranges that no position is found of";
    return false;
  }
  // While the epoch's ranges were measured the tag was anywhere on this way.
  const double smeared = epoch_path_m_ * epoch_path_m_ / 3.0;
  place_ = Place{
      found.position, found.covariance + smeared * Matrix<2, 2>::Identity(), ranges.tag_in_body,
      component({epoch_.back().stamp, {}, kMinVariance * Matrix<3, 3>::Identity()}, 0.0)};
  waiting_for_ = "no scan since ranges gave a position";
  return true;
}

/// The headings at which a scan fits the map about the tag. A position is used once: another scan
/// there would err the same way.
void Initializer::turn(const LaserScan& z) {
  if (epoch_.size() > 2 && place_by_squares()) {
    epoch_.clear();
  }
  if (matcher_ == nullptr || !place_ || z.stamp < place_->driven.ekf.belief().stamp) {
    return;
  }
  place_->driven.ekf.advance_to(z.stamp);
  const PoseEstimate driven = place_->driven.ekf.current();
  const Vector<2> tag = inverse(driven.pose).act(place_->tag_in_body);
  const double drift = driven.sigma_position();
  const Matrix<2, 2> covariance = place_->covariance + drift * drift * Matrix<2, 2>::Identity();
  const double sigma = about(place_->position, covariance, tag, 0.0, 0.0, z.stamp).sigma_position();
  const HeadingStart found = start_by_headings(
      *matcher_, z, {place_->position, std::hypot(sigma, config_.sigma_map_m), tag});
  components_.clear();
  components_.reserve(found.headings.size());
  for (const double heading : found.headings) {
    components_.push_back(component(about(place_->position, covariance, tag, heading,
                                          std::hypot(found.sigma, config_.sigma_map_rad), z.stamp),
                                    0.0));
  }
  waiting_for_ = why_none(found);
  headings_ = found.search;
  place_.reset();
}

void Initializer::on(const LaserScan& z) {
  validate(z);
  attempt([&] { config_.method == StartMethod::kSrlsHeadings ? turn(z) : match(z); });
}

void Initializer::match(const LaserScan& z) {
  if (components_.empty() && epoch_.size() > 2) {
    locate();
  }
  const Pose2* since = since_scan_.find(z);
  const bool is_news = since == nullptr || moved_on(*since);
  if (matcher_ == nullptr || components_.empty() || !is_news ||
      z.stamp < components_.front().ekf.belief().stamp) {
    return;
  }
  for (Component& component : components_) {
    component.ekf.advance_to(z.stamp);
  }
  std::vector<Component> matched;
  for (const internal::GaussianCluster& place : internal::clusters(components_, false)) {
    const Vector<2> position = place.estimate.pose.position();
    const Matrix<2, 2> covariance = place.estimate.covariance.topLeftCorner<2, 2>();
    const ScanSearch found = matcher_->search(z, position, covariance);
    if (found.status == ScanSearch::Status::kNone) {
      continue;
    }
    for (const ScanHypothesis& fit : found.hypotheses) {
      // The search weighs by the place as well, which the components do themselves.
      const Vector<2> off = fit.match.pose.position() - position;
      match(z.stamp, fit.match, 0.5 * off.dot(covariance.llt().solve(off)) - fit.cost, matched);
    }
  }
  if (!matched.empty()) {
    components_ = std::move(matched);
    since_scan_.set(z, {});
    reduce();
  }
}

void Initializer::match(Stamp stamp, const ScanMatch& fit, double log_likelihood,
                        std::vector<Component>& matched) const {
  const double sigma = config_.sigma_map_m;
  const double sigma_turn = config_.sigma_map_rad;
  const Matrix<3, 3> map =
      Vector<3>(sigma * sigma, sigma * sigma, sigma_turn * sigma_turn).asDiagonal();
  double best = -std::numeric_limits<double>::infinity();
  for (const Component& old : components_) {
    best = std::max(best, old.log_weight);
    Component fused = old;
    const Outcome outcome = fused.ekf.fuse(stamp, pose_rows(fit, old.ekf.pose(), map), gate_);
    if (outcome.verdict == Verdict::kFused) {
      fused.log_weight += log_likelihood + outcome.log_likelihood();
      matched.push_back(std::move(fused));
    }
  }
  if (fit.covariance) {
    // Ranges may put the robot where it is not; the scan then stands alone.
    const double log_area = 2.0 * std::log(config_.wrong_span_m) + std::log(2.0 * kPi);
    matched.push_back(component({stamp, fit.pose, *fit.covariance + map},
                                best + log_likelihood + std::log(config_.wrong_share) - log_area));
  }
}

void Initializer::reduce() {
  const double best = internal::reduce(
      components_, [this](const PoseEstimate& start) { return component(start, 0.0).ekf; });
  log_before_ -= best;
  log_nowhere_ -= best;
}

Initializer::State Initializer::state() const {
  State state;
  if (components_.empty()) {
    const bool lacks_map = config_.method == StartMethod::kSrlsHeadings && matcher_ == nullptr;
    state.reason = lacks_map ? "no map to compare a scan with" : waiting_for_;
    state.headings = headings_;
    return state;
  }
  state = state_of(internal::clusters(components_, true));
  state.headings = headings_;
  if (state.status == StartStatus::kReady &&
      state.hypotheses.front().estimate.sigma_heading() > sigma_heading_ready()) {
    state.status = StartStatus::kWaiting;
    state.reason = config_.method == StartMethod::kSrlsHeadings
                       ? "the heading is not known well enough: the position of ranges is too vague"
                   : matcher_ == nullptr
                       ? "the heading is not known yet: drive on, or give a map and scans"
                       : "the heading is not known yet: no scan that fits the map; drive on";
  }
  return state;
}

Initializer::State Initializer::place() const {
  const auto fit = static_cast<std::size_t>(
      std::count_if(links_.begin(), links_.end(), [](const Link& link) { return link.fits; }));
  if (components_.empty() || fit < InitializerTuning::kPlaceLinks || 2 * fit <= links_.size()) {
    State state;
    state.reason = waiting_for_;
    return state;
  }
  return state_of(internal::clusters(components_, false));
}

/// What is known of `all` but of their headings.
Initializer::State Initializer::state_of(const std::vector<internal::GaussianCluster>& all) const {
  State state;
  const double noise = excess(components_.front().all);
  double total = log_nowhere_ / noise;
  for (const internal::GaussianCluster& one : all) {
    total = log_sum(total, one.log_weight / noise);
  }
  for (const internal::GaussianCluster& one : all) {
    const double probability = std::exp(one.log_weight / noise - total);
    if (probability >= InitializerTuning::kMinProbability) {
      state.hypotheses.push_back({one.estimate, probability});
      state.hypotheses.back().estimate.covariance *= noise;
    }
  }
  if (state.hypotheses.empty()) {
    state.reason = "no pose explains the landmarks that are seen";
    return state;
  }
  const Hypothesis& best = state.hypotheses.front();
  if (best.probability < config_.probability_ready) {
    state.status = StartStatus::kAmbiguous;
    state.reason = state.hypotheses.size() == 1
                       ? "one pose fits, perhaps by chance"
                       : std::to_string(state.hypotheses.size()) + " poses fit";
  } else if (best.estimate.sigma_position() > sigma_xy_ready()) {
    std::ostringstream reason;
    reason << "the position is not known well enough yet: its sigma is " << std::setprecision(2)
           << best.estimate.sigma_position() << " m, more than " << sigma_xy_ready()
           << " m (initializer.sigma_xy_ready_m)";
    state.reason = reason.str();
  } else {
    state.status = StartStatus::kReady;
  }
  return state;
}

/// A source of positions that are far off one by one cannot give what is asked of better ones: then
/// a start as good as one of them, and true to its covariance, is what there is.
double Initializer::sigma_xy_ready() const {
  return std::isfinite(best_fix_)
             ? std::max(config_.sigma_xy_ready_m, std::sqrt(position_noise_) * best_fix_)
             : config_.sigma_xy_ready_m;
}

/// Odometry and fixes of sigma s end at a heading whose sigma grows with the fourth root of s.
double Initializer::sigma_heading_ready() const {
  return config_.sigma_heading_ready_rad *
         std::sqrt(std::sqrt(sigma_xy_ready() / config_.sigma_xy_ready_m));
}

std::optional<Message> Initializer::odometry_from(Stamp stamp) const {
  return control_ ? from(*control_, stamp) : std::nullopt;
}

PoseEkf Initializer::started_at(const PoseEstimate& start) const {
  return started(tracker_, start);
}

PoseEkf Initializer::started(const PoseEkf& prototype, const PoseEstimate& start) const {
  PoseEkf ekf = prototype.restarted(start);
  if (const std::optional<Message> rest = odometry_from(start.stamp)) {
    ekf.on(*rest);
  } else if (control_) {  // which has ended: it stands until odometry says more
    ekf.on(Velocity{start.stamp, 0.0, 0.0});
  }
  return ekf;
}

PoseEkf Initializer::estimator() const {
  const State now = state();
  if (now.status != StartStatus::kReady) {
    throw std::invalid_argument("the start is not ready: " + now.reason);
  }
  return started_at(now.hypotheses.front().estimate);
}

}  // namespace locfuse
