// SPDX-License-Identifier: Apache-2.0
#include "locfuse/smoothing/survey.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/error.hpp"
#include "locfuse/frontends/locate.hpp"
#include "locfuse/geometry/rigid_fit.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "smoothing/range_unfolding.hpp"

namespace locfuse {
namespace {

/// Constants of a survey; docs/survey.md.
struct Tuning {
  static constexpr double kFirstPart_s = 20.0;  ///< of the drive, by which what is near is placed
  static constexpr double kGrowth = 1.4;        ///< of each further part
  static constexpr double kOptimistic = 0.25;   ///< of the sigma of a drive, as a last resort
  static constexpr int kSamples = 60;           ///< ranges by which an anchor is first placed
  static constexpr double kAnywhere_m = 1e4;    ///< sigma of a place of which nothing is known
  static constexpr double kClimb_m = 7.0;       ///< sigma of the height of an anchor over the tags
  static constexpr double kLevel_m = 1e-3;      ///< of tags at one height
  static constexpr std::size_t kMostRanges = 30000;
  static constexpr int kEpochs = 300;          ///< by which ranges are unfolded
  static constexpr double kGap_s = 1.0;        ///< between two ranges of an epoch
  static constexpr double kElsewhere_m = 1.0;  ///< this far off is another place in any case
  static constexpr double kUnfolded_m = 0.3;   ///< how far off an unfolded anchor may be
  /// Sigma in the plane up to which a first place is good enough to begin with: this, and a share
  /// of the distance.
  static constexpr double kRough_m = 0.5;
  static constexpr double kRoughShare = 0.1;
  /// Difference of squared residuals below which two places fit equally well: 1 in 100,000.
  static constexpr double kFitsToo = 23.0;
  /// Where the samples alone exclude the mirror image so clearly, the drive need not be asked.
  static constexpr double kClear = 200.0;
};

/// A tag at the time of a range.
struct Sample {
  Vector<3> tag;  ///< in the frame of the start
  double range;   ///< without the errors of the anchor that are known
  double sigma;
  double unsure;  ///< sigma of the tag, which is much the same in the next samples
};

/// Poses at increasing stamps.
class Track {
 public:
  explicit Track(std::vector<PoseEstimate> poses) : poses_(std::move(poses)) {}

  [[nodiscard]] PoseEstimate at(Stamp stamp) const {
    const auto next =
        std::lower_bound(poses_.begin(), poses_.end(), stamp,
                         [](const PoseEstimate& one, Stamp when) { return one.stamp < when; });
    if (next == poses_.end()) {
      return poses_.back();
    }
    if (next == poses_.begin() || next->stamp == stamp) {
      return *next;
    }
    const PoseEstimate& last = *(next - 1);
    const double share =
        seconds_between(last.stamp, stamp) / seconds_between(last.stamp, next->stamp);
    const Pose2& a = last.pose;
    const Pose2& b = next->pose;
    return {stamp,
            {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y),
             wrap_angle(a.heading + share * wrap_angle(b.heading - a.heading))},
            share < 0.5 ? last.covariance : next->covariance};
  }

 private:
  std::vector<PoseEstimate> poses_;
};

/// Sum of squared residuals in sigmas.
double squares(const Smoothed& found) { return 2.0 * found.cost; }

class Surveyor {
 public:
  Surveyor(const SurveyConfig& config, const World& world, const PoseEstimate& start,
           const std::vector<Message>& messages, const SurveyProgress& progress)
      : config_(config),
        world_(world),
        start_(start),
        order_(messages.size()),
        messages_in_all_(messages.size()),
        progress_(progress),
        tags_(world.tags),
        sighting_(config.smoother.estimator.landmark, world.landmarks.T_body_sensor) {
    std::iota(order_.begin(), order_.end(), 0U);
    thin(messages);
    std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      return precedes(messages[a], messages[b]);
    });
    std::transform(order_.begin(), order_.end(), std::back_inserter(messages_),
                   [&](std::size_t i) { return messages[i]; });
    for (const Message& message : messages_) {
      if (stamp_of(message) < start.stamp) {
        continue;
      }
      end_ = std::max(end_, stamp_of(message));
      if (const auto* z = std::get_if<Range>(&message); z != nullptr && tags_.find(z->tag)) {
        validate(*z);
        ranges_[z->anchor].push_back(*z);
      } else if (const auto* seen = std::get_if<RangeBearing>(&message);
                 seen != nullptr && seen->landmark) {
        validate(*seen);
        sightings_[*seen->landmark].push_back(*seen);
      } else if (std::holds_alternative<PositionFix>(message) ||
                 std::holds_alternative<PoseObservation>(message)) {
        has_others_ = true;
      }
      has_odometry_ = has_odometry_ || source_of(message) == Source::kOdometry;
    }
    if (ranges_.empty() && sightings_.empty()) {
      throw std::invalid_argument(
          "nothing to survey: no range of a tag of the robot and no sighting by name after the "
          "start");
    }
  }

  Survey run() {
    if (!has_odometry_ && !has_others_ && sightings_.empty()) {
      unfold_ranges();
    }
    grow_on();
    if (placed_.size() < ranges_.size()) {
      // Wheels are often better than their noise says, and what is placed so is smoothed with it.
      share_unsure_ = Tuning::kOptimistic;
      grow_on();
    }
    Smoothed found = whole();
    if (place_anew(found)) {
      found = whole();
    }
    if (place_the_rest(found)) {
      found = whole();
    }
    share_unsure_ = 1.0;
    report(0.8);
    std::map<Id, Vector<3>> others;
    if (!is_alone()) {
      others = mirror_images(found);
    }
    report(1.0);
    return summed(std::move(found), others);
  }

 private:
  /// Leaves ranges out evenly where there are more than it takes: their errors last anyhow.
  void thin(const std::vector<Message>& messages) {
    const auto count = static_cast<std::size_t>(
        std::count_if(messages.begin(), messages.end(),
                      [](const Message& one) { return std::holds_alternative<Range>(one); }));
    const std::size_t step = (count + Tuning::kMostRanges - 1) / Tuning::kMostRanges;
    if (step <= 1) {
      return;
    }
    std::map<std::pair<Id, Id>, std::size_t> turn;  // of a tag and an anchor
    order_.erase(std::remove_if(order_.begin(), order_.end(),
                                [&](std::size_t i) {
                                  const auto* z = std::get_if<Range>(&messages[i]);
                                  return z != nullptr && turn[{z->tag, z->anchor}]++ % step != 0;
                                }),
                 order_.end());
  }

  /// Places anchors without odometry: from the ranges of a tag to all of them alone.
  void unfold_ranges() {
    std::map<Id, std::size_t> of_tag;
    for (const auto& [id, ranges] : ranges_) {
      for (const Range& z : ranges) {
        ++of_tag[z.tag];
      }
    }
    const Id most = std::max_element(of_tag.begin(), of_tag.end(), [](auto& a, auto& b) {
                      return a.second < b.second;
                    })->first;
    std::vector<Stamp> stamps;
    stamps.reserve(Tuning::kEpochs);
    for (int k = 0; k < Tuning::kEpochs; ++k) {
      stamps.push_back(start_.stamp + (end_ - start_.stamp) / Tuning::kEpochs * k);
    }
    std::map<Id, std::vector<std::optional<double>>> at;  // of anchors that are received mostly
    for (const auto& [id, ranges] : ranges_) {
      std::vector<std::optional<double>> row;
      row.reserve(stamps.size());
      for (const Stamp stamp : stamps) {
        row.push_back(range_at(id, most, stamp));
      }
      if (2 * std::count(row.begin(), row.end(), std::nullopt) < Tuning::kEpochs) {
        at[id] = std::move(row);
      }
    }
    std::vector<std::size_t> whole;  // epochs with a range to each
    for (std::size_t k = 0; k < stamps.size(); ++k) {
      if (std::all_of(at.begin(), at.end(), [k](const auto& one) { return one.second[k]; })) {
        whole.push_back(k);
      }
    }
    Eigen::MatrixXd ranges(static_cast<Eigen::Index>(at.size()),
                           static_cast<Eigen::Index>(whole.size()));
    Eigen::Index row = 0;
    for (const auto& [id, values] : at) {
      for (std::size_t k = 0; k < whole.size(); ++k) {
        ranges(row, static_cast<Eigen::Index>(k)) = *values[whole[k]];
      }
      ++row;
    }
    const auto found = internal::unfold(ranges);
    if (!found) {
      return;
    }
    const std::optional<Pose2> frame = body_in(*found, at, most);
    if (!frame) {
      return;
    }
    row = 0;
    for (const auto& [id, values] : at) {
      Vector<2> flat = found->anchors.row(row).transpose();
      flat.y() *= mirrored_;
      const std::optional<KnownHeight> height = height_of(id);
      const double climb = std::sqrt(std::max(found->climb_squared(row), 0.0));
      placed_[id] << (start_.pose * inverse(*frame)).act(flat),
          height ? height->height_m : height_of_tags() + climb;
      rough_[id] = Tuning::kUnfolded_m;
      ++row;
    }
  }

  /// Range of a tag at a stamp, between the two next to it; empty in a gap.
  [[nodiscard]] std::optional<double> range_at(Id anchor, Id tag, Stamp stamp) const {
    const Range* before = nullptr;
    for (const Range& z : ranges_.at(anchor)) {
      if (z.tag != tag) {
        continue;
      }
      if (z.stamp >= stamp) {
        const Anchor radio = radio_of(anchor);
        const auto clean = [&](const Range& one) {
          return (one.range - radio.offset) / radio.scale;
        };
        if (z.stamp == stamp || before == nullptr) {
          return z.stamp - stamp > stamps_from(Tuning::kGap_s) ? std::nullopt
                                                               : std::optional(clean(z));
        }
        const double gap = seconds_between(before->stamp, z.stamp);
        if (gap > Tuning::kGap_s) {
          return std::nullopt;
        }
        const double share = seconds_between(before->stamp, stamp) / gap;
        return (1.0 - share) * clean(*before) + share * clean(z);
      }
      before = &z;
    }
    return std::nullopt;
  }

  /// Where the body is first among unfolded anchors: by several tags, which say whether those are
  /// mirrored; by one, along the first of its way.
  std::optional<Pose2> body_in(const internal::Unfolded& found,
                               const std::map<Id, std::vector<std::optional<double>>>& at,
                               Id most) {
    if (world_.tags.size() < 2) {
      is_side_open_ = true;
      const Vector<2> first = found.tags.row(0).transpose();
      Vector<2> way = Vector<2>::Zero();
      for (Eigen::Index k = 1; k < found.tags.rows() && way.norm() < 1.0; ++k) {
        way = found.tags.row(k).transpose() - first;
      }
      const Pose2 heading{0.0, 0.0, std::atan2(way.y(), way.x())};
      const Vector<2> arm = heading.act(tags_.find(most)->position.head<2>());
      return Pose2{first.x() - arm.x(), first.y() - arm.y(), heading.heading};
    }
    std::optional<Pose2> best;
    double least = std::numeric_limits<double>::infinity();
    for (const double side : {1.0, -1.0}) {
      std::vector<Vector<2>> arms;
      std::vector<Vector<2>> places;
      for (const Tag& tag : world_.tags) {
        if (const auto place = first_of(tag.id, found, at, side)) {
          arms.push_back(tag.position.head<2>());
          places.push_back(*place);
        }
      }
      if (arms.size() < 2) {
        continue;
      }
      const auto count = static_cast<Eigen::Index>(arms.size());
      Matrix<2, Eigen::Dynamic> body(2, count);
      Matrix<2, Eigen::Dynamic> world(2, count);
      for (Eigen::Index k = 0; k < count; ++k) {
        body.col(k) = arms[static_cast<std::size_t>(k)];
        world.col(k) = places[static_cast<std::size_t>(k)];
      }
      const std::vector<Matrix<2, 2>> each(arms.size(), 0.01 * Matrix<2, 2>::Identity());
      const RigidFit fit = rigid_fit(body, world, each);
      if (std::isfinite(fit.pose.x + fit.pose.heading) && fit.nis < least) {
        least = fit.nis;
        best = fit.pose;
        mirrored_ = side;
      }
    }
    return best;
  }

  /// Where a tag is first, by the ranges of its first seconds to unfolded anchors.
  [[nodiscard]] std::optional<Vector<2>> first_of(
      Id tag, const internal::Unfolded& found,
      const std::map<Id, std::vector<std::optional<double>>>& at, double side) const {
    std::vector<Vector<3>> anchors;
    std::vector<double> ranges;
    Eigen::Index row = 0;
    for (const auto& [id, values] : at) {
      if (const auto range = range_at(id, tag, start_.stamp)) {
        const double climb = std::sqrt(std::max(found.climb_squared(row), 0.0));
        anchors.emplace_back(found.anchors(row, 0), side * found.anchors(row, 1), climb);
        ranges.push_back(*range);
      }
      ++row;
    }
    const auto count = static_cast<Eigen::Index>(ranges.size());
    if (count < 3) {
      return std::nullopt;
    }
    Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> rows(count, 3);
    Eigen::VectorXd measured(count);
    for (Eigen::Index k = 0; k < count; ++k) {
      rows.row(k) = anchors[static_cast<std::size_t>(k)].transpose();
      measured(k) = ranges[static_cast<std::size_t>(k)];
    }
    AnchorTable table{RowsView(rows.data(), count, 3)};
    table.height = 0.0;
    const PositionSolution solution =
        locate(table, measured, Eigen::VectorXd::Constant(count, Tuning::kUnfolded_m));
    return solution.hypotheses.empty()
               ? std::nullopt
               : std::optional<Vector<2>>(solution.hypotheses.front().position.head<2>());
  }

  /// Places what can be placed by longer and longer beginnings of the drive.
  void grow_on() {
    const double whole = seconds_between(start_.stamp, end_);
    double done = 0.0;
    for (double part = Tuning::kFirstPart_s; part < whole; part *= Tuning::kGrowth) {
      grow(start_.stamp + stamps_from(part));
      done += part;
      report(0.8 * done / (whole * Tuning::kGrowth / (Tuning::kGrowth - 1.0)));
    }
    grow(end_);
  }

  static Stamp stamps_from(double seconds) {
    return static_cast<Stamp>(seconds * kNanosecondsPerSecond);
  }
  void report(double share) const {
    if (progress_) {
      progress_(std::min(share, 1.0));
    }
  }

  [[nodiscard]] std::optional<KnownHeight> height_of(Id anchor) const {
    for (const KnownHeight& known : config_.heights) {
      if (known.anchor == anchor) {
        return known;
      }
    }
    return std::nullopt;
  }

  /// The anchor as the world has it, but for its place.
  [[nodiscard]] Anchor radio_of(Id id) const {
    const Anchor* known = world_.anchors ? world_.anchors->find(id) : nullptr;
    Anchor radio = known != nullptr ? *known : Anchor{id};
    radio.position = placed_.count(id) > 0 ? placed_.at(id) : Vector<3>::Zero();
    return radio;
  }

  [[nodiscard]] std::vector<Message> until(Stamp stamp) const {
    std::vector<Message> some;
    std::copy_if(messages_.begin(), messages_.end(), std::back_inserter(some),
                 [&](const Message& one) { return stamp_of(one) <= stamp; });
    return some;
  }

  /// Where the robot goes up to a stamp, by all that is placed.
  [[nodiscard]] Track track_to(Stamp stamp) {
    return Track(is_alone() ? dead_reckoned(stamp) : smooth_to(stamp).poses);
  }

  /// Whether odometry alone says where the robot is.
  [[nodiscard]] bool is_alone() const {
    return placed_.empty() && landmarks_.empty() && !has_others_;
  }

  [[nodiscard]] std::vector<PoseEstimate> dead_reckoned(Stamp stamp) const {
    PoseEkf alone(config_.smoother.estimator, {}, start_);
    std::vector<PoseEstimate> track{start_};
    for (const Message& message : messages_) {
      const Stamp at = stamp_of(message);
      if (at > stamp) {
        break;
      }
      if (source_of(message) == Source::kOdometry) {
        (void)alone.on(message);
      } else if (at > track.back().stamp) {
        alone.advance_to(at);
        track.push_back(alone.current());
      }
    }
    return track;
  }

  /// Smooths the drive up to a stamp, and takes over the places found.
  Smoothed smooth_to(Stamp stamp) {
    SmootherConfig config = config_.smoother;
    World world = world_;
    std::vector<Anchor> anchors;
    for (const auto& [id, place] : placed_) {
      anchors.push_back(radio_of(id));
      UncertainPlace uncertain{id, Vector<3>::Zero(), Vector<3>::Constant(Tuning::kAnywhere_m)};
      uncertain.guess_sigma_m = rough_.count(id) > 0 ? rough_.at(id) : 0.0;
      const std::optional<KnownHeight> height = height_of(id);
      uncertain.climbs = !height && is_level();
      uncertain.mean.z() = height ? height->height_m : uncertain.climbs ? 0.0 : height_of_tags();
      uncertain.sigma_m.z() = height             ? height->sigma_m
                              : uncertain.climbs ? Tuning::kClimb_m * Tuning::kClimb_m
                                                 : Tuning::kClimb_m;
      config.anchors.push_back(uncertain);
    }
    std::vector<Landmark> landmarks;
    for (const auto& [id, place] : landmarks_) {
      landmarks.push_back({id, place});
      config.landmarks.push_back(
          {id, Vector<3>::Zero(), Vector<3>::Constant(Tuning::kAnywhere_m), 0.3});
    }
    world.anchors = std::make_shared<const AnchorMap>(std::move(anchors));
    world.landmarks.map = std::make_shared<const LandmarkMap>(std::move(landmarks));
    Smoothed found = smooth(config, world, start_, until(stamp));
    take(found);
    return found;
  }

  /// Whether all tags are at one height, above which an anchor fits as below it.
  [[nodiscard]] bool is_level() const {
    const double level = height_of_tags();
    return std::all_of(world_.tags.begin(), world_.tags.end(), [&](const Tag& tag) {
      return std::abs(tag.position.z() - level) < Tuning::kLevel_m;
    });
  }

  void take(const Smoothed& found) {
    for (std::size_t i = 0; i < found.anchors.size(); ++i) {
      const Id id = found.anchors[i].id;
      const auto at = 3 * static_cast<Eigen::Index>(i);
      placed_[id] = found.anchors[i].position;
      // Of a turn of the whole nothing depends, however little is known of it.
      rough_[id] = std::min(std::sqrt(found.places_covariance.block<3, 3>(at, at).trace()),
                            Tuning::kElsewhere_m / 3.0);
    }
    for (const Landmark& landmark : found.landmarks) {
      landmarks_[landmark.id] = landmark.position;
    }
  }

  /// Places what can be placed by the drive up to a stamp, and smooths that.
  void grow(Stamp stamp) {
    if (placed_.size() == ranges_.size() && landmarks_.size() == sightings_.size()) {
      return;
    }
    const Track track = track_to(stamp);
    bool more = false;
    for (const auto& [id, ranges] : ranges_) {
      if (placed_.count(id) > 0) {
        continue;
      }
      const auto found = places(id, samples(id, track, stamp));
      if (found.size() == 1 && found.front().is_rough && found.front().is_followed) {
        placed_[id] = found.front().position;
        rough_[id] = found.front().sigma;
        more = true;
      }
    }
    for (const auto& [id, seen] : sightings_) {
      if (landmarks_.count(id) == 0) {
        if (const auto at = place_of(seen, track, stamp)) {
          landmarks_[id] = *at;
          more = true;
        }
      }
    }
    if (more) {
      (void)smooth_to(stamp);
    }
  }

  /// The whole drive, by all that is placed.
  Smoothed whole() {
    if (!is_alone()) {
      return smooth_to(end_);
    }
    Smoothed found;
    found.poses = dead_reckoned(end_);
    found.outcomes.resize(messages_.size());
    return found;
  }

  /// An anchor most of whose ranges are judged wrong was placed wrongly. Returns whether one was.
  bool place_anew(const Smoothed& found) {
    const Track track(found.poses);
    bool is_changed = false;
    for (const auto& [id, counts] : count(found)) {
      if (2 * counts.second > counts.first && placed_.count(id) > 0) {
        placed_.erase(id);
        rough_.erase(id);
        is_changed = true;
        const auto others = places(id, samples(id, track, end_));
        if (others.size() == 1 && others.front().is_rough) {
          placed_[id] = others.front().position;
          rough_[id] = others.front().sigma;
        }
      }
    }
    return is_changed;
  }

  /// Of what has two places the better one. Returns whether there was any.
  bool place_the_rest(const Smoothed& drive) {
    const Track track(drive.poses);
    bool is_changed = false;
    for (const auto& [id, ranges] : ranges_) {
      if (placed_.count(id) > 0) {
        continue;
      }
      const auto found = places(id, samples(id, track, end_));
      if (!found.empty() && found.front().is_rough) {
        placed_[id] = found.front().position;
        rough_[id] = found.front().sigma;
        is_changed = true;
      }
    }
    return is_changed;
  }

  /// Ranges and their tags, evenly along the way of the tags.
  [[nodiscard]] std::vector<Sample> samples(Id id, const Track& track, Stamp until) const {
    const Anchor radio = radio_of(id);
    const PoseEkf::Config& estimator = config_.smoother.estimator;
    std::vector<Sample> all;
    std::vector<double> way;
    for (const Range& z : ranges_.at(id)) {
      const double range = (z.range - radio.offset) / radio.scale;
      if (z.stamp > until || !(range > 0.0)) {
        continue;
      }
      const PoseEstimate at = track.at(z.stamp);
      const Vector<3>& arm = tags_.find(z.tag)->position;
      Vector<3> tag;
      tag << at.pose.act(arm.head<2>()), arm.z();
      const double own = z.sigma.value_or(
          std::hypot(estimator.range.sigma_m, estimator.range.sigma_relative * range));
      way.push_back(all.empty() ? 0.0 : way.back() + (tag - all.back().tag).norm());
      const double unsure = share_unsure_ * at.sigma_position();
      const double offset = estimator.calibration.sigma_anchor_offset_m;
      all.push_back({tag, range, std::hypot(own, unsure, offset), unsure});
    }
    if (static_cast<int>(all.size()) <= Tuning::kSamples) {
      return all;
    }
    std::vector<Sample> some;
    for (int k = 0; k < Tuning::kSamples; ++k) {
      const double wanted = way.back() * k / (Tuning::kSamples - 1);
      const auto found = std::lower_bound(way.begin(), way.end(), wanted);
      const auto place = std::min(static_cast<std::size_t>(found - way.begin()), all.size() - 1);
      some.push_back(all[place]);
    }
    return some;
  }

  struct Place {
    Vector<3> position;
    double sigma;      ///< in the plane
    bool is_rough;     ///< good enough to begin with
    bool is_followed;  ///< by a robot that knows its own place as well as that
  };

  /// Every place in the plane that fits the samples, the best one first.
  [[nodiscard]] std::vector<Place> places(Id id, const std::vector<Sample>& some) const {
    if (const std::optional<KnownHeight> known = height_of(id)) {
      return places_at(some, known->height_m);
    }
    std::vector<Place> found = places_at(some, std::nullopt);
    const auto is_rough = [](const Place& one) { return one.is_rough; };
    if (is_level() && std::none_of(found.begin(), found.end(), is_rough)) {
      // Of an anchor near the height of the tags, that says nothing of its place in the plane.
      found = places_at(some, height_of_tags());
    }
    return found;
  }

  [[nodiscard]] std::vector<Place> places_at(const std::vector<Sample>& some,
                                             const std::optional<double>& height) const {
    const auto count = static_cast<Eigen::Index>(some.size());
    if (count < 3) {
      return {};
    }
    Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> rows(count, 3);
    Eigen::VectorXd ranges(count);
    Eigen::VectorXd sigma(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Sample& one = some[static_cast<std::size_t>(i)];
      rows.row(i) = one.tag.transpose();
      ranges(i) = one.range;
      sigma(i) = one.sigma;
    }
    AnchorTable table{RowsView(rows.data(), count, 3)};
    if (height) {
      table.height = *height;
    }
    LocateOptions options;
    options.loss = {RangeLossKind::kCauchy, 0.0};
    double unsure = 0.0;
    for (const Sample& one : some) {
      unsure += one.unsure / static_cast<double>(some.size());
    }
    std::vector<Place> found;
    for (const PositionHypothesis& one : locate(table, ranges, sigma, options).hypotheses) {
      Place place{Vector<3>::Zero(), 0.0, false, false};
      place.position.head<2>() = one.position.head<2>();
      // Of the two heights that fit the upper one.
      place.position.z() =
          height ? *height : height_of_tags() + std::abs(one.position(2) - height_of_tags());
      const Matrix<2, 2> P = one.covariance.topLeftCorner<2, 2>();
      place.sigma = P.allFinite() ? std::sqrt(std::max(P.trace(), 0.0)) : Tuning::kAnywhere_m;
      const double rough = Tuning::kRough_m + Tuning::kRoughShare * ranges.mean();
      place.is_rough = place.sigma < rough;
      place.is_followed = unsure < rough;
      const bool is_twin = std::any_of(found.begin(), found.end(), [&](const Place& other) {
        return (other.position - place.position).head<2>().norm() < 3.0 * place.sigma;
      });
      if (!is_twin) {
        found.push_back(place);
      }
    }
    return found;
  }

  /// Where a landmark is seen, in the middle of the first sightings.
  [[nodiscard]] std::optional<Vector<2>> place_of(const std::vector<RangeBearing>& seen,
                                                  const Track& track, Stamp until) const {
    constexpr std::size_t kFirst = 15;
    std::vector<double> x;
    std::vector<double> y;
    for (const RangeBearing& z : seen) {
      if (z.stamp > until || x.size() == kFirst) {
        break;
      }
      if (const auto placed = sighting_.place(track.at(z.stamp).pose, z)) {
        x.push_back(placed->position.x());
        y.push_back(placed->position.y());
      }
    }
    if (x.empty()) {
      return std::nullopt;
    }
    const auto middle = [](std::vector<double>& values) {
      const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
      std::nth_element(values.begin(), half, values.end());
      return *half;
    };
    return Vector<2>(middle(x), middle(y));
  }

  [[nodiscard]] double height_of_tags() const {
    double sum = 0.0;
    for (const Tag& tag : world_.tags) {
      sum += tag.position.z() / static_cast<double>(world_.tags.size());
    }
    return sum;
  }

  /// Which anchors have a mirror image that fits the whole drive as well. A better one is taken.
  std::map<Id, Vector<3>> mirror_images(Smoothed& found) {
    std::map<Id, Vector<3>> others;
    const Track track(found.poses);
    std::vector<Id> near;  // to an image that fits
    for (const auto& [id, place] : std::map<Id, Vector<3>>(placed_)) {
      const std::vector<Sample> some = samples(id, track, end_);
      const auto line = line_of(some);
      if (!line) {
        continue;
      }
      Vector<3> image = place;
      image.head<2>() = mirrored(place.head<2>(), *line);
      if ((image - place).head<2>().norm() < 3.0 * rough_[id] ||
          misfit(some, image) - misfit(some, place) > Tuning::kClear) {
        continue;
      }
      near.push_back(id);
      compare({{id, image}}, found, others);
    }
    if (is_side_open_ || near.size() > 1 || (near.size() == 1 && placed_.size() > 1)) {
      // All together: about the line of the drive, whose curves go with them.
      std::vector<Sample> drive;
      for (const PoseEstimate& one : found.poses) {
        drive.push_back({{one.pose.x, one.pose.y, 0.0}, 0.0, 1.0, 0.0});
      }
      const Vector<2> ahead(std::cos(start_.pose.heading), std::sin(start_.pose.heading));
      const std::optional<Line> line =
          is_side_open_ ? Line{start_.pose.position(), ahead} : line_of(drive);
      if (line) {
        std::map<Id, Vector<3>> images = placed_;
        for (auto& [id, place] : images) {
          place.head<2>() = mirrored(place.head<2>(), *line);
        }
        compare(images, found, others);
      }
    }
    return others;
  }

  /// Smooths with anchors at other places. Keeps what fits better, and notes what fits too.
  void compare(const std::map<Id, Vector<3>>& images, Smoothed& found,
               std::map<Id, Vector<3>>& others) {
    const std::map<Id, Vector<3>> placed = placed_;
    const std::map<Id, double> rough = rough_;
    for (const auto& [id, image] : images) {
      placed_[id] = image;
    }
    Smoothed other;
    try {
      other = smooth_to(end_);
    } catch (const NumericalError&) {  // it fits nowhere
      placed_ = placed;
      rough_ = rough;
      return;
    }
    const double worse = squares(other) - squares(found);
    const bool is_better = worse < 0.0;
    for (const auto& [id, image] : images) {
      const Vector<3>& at = is_better ? placed.at(id) : placed_.at(id);
      const bool is_elsewhere =
          is_side_open_ || (placed_.at(id) - placed.at(id)).norm() > 3.0 * rough.at(id);
      if (is_elsewhere && std::abs(worse) < Tuning::kFitsToo) {
        others[id] = at;
      } else if (is_elsewhere && is_better) {
        others.erase(id);
      }
    }
    if (is_better) {
      found = std::move(other);
      return;
    }
    placed_ = placed;
    rough_ = rough;
  }

  struct Line {
    Vector<2> through;
    Vector<2> along;
  };
  /// The line along which samples lie; empty where they are one point.
  [[nodiscard]] static std::optional<Line> line_of(const std::vector<Sample>& some) {
    if (some.size() < 2) {
      return std::nullopt;
    }
    Vector<2> mean = Vector<2>::Zero();
    for (const Sample& one : some) {
      mean += one.tag.head<2>() / static_cast<double>(some.size());
    }
    Matrix<2, 2> moments = Matrix<2, 2>::Zero();
    for (const Sample& one : some) {
      const Vector<2> off = one.tag.head<2>() - mean;
      moments += off * off.transpose();
    }
    if (!(moments.trace() > 0.0)) {
      return std::nullopt;
    }
    return Line{mean, internal::principal_axes(moments).col(1)};
  }
  [[nodiscard]] static Vector<2> mirrored(const Vector<2>& point, const Line& line) {
    const Vector<2> off = point - line.through;
    return line.through + 2.0 * line.along.dot(off) * line.along - off;
  }
  /// Robust, so that ranges that are wrong anyhow do not count.
  [[nodiscard]] static double misfit(const std::vector<Sample>& some, const Vector<3>& place) {
    constexpr double kMost = 9.0;
    double sum = 0.0;
    for (const Sample& one : some) {
      const double off = ((one.tag - place).norm() - one.range) / one.sigma;
      sum += std::min(off * off, kMost);
    }
    return sum;
  }

  /// Ranges of each anchor, and how many of them are judged wrong.
  [[nodiscard]] std::map<Id, std::pair<int, int>> count(const Smoothed& found) const {
    std::map<Id, std::pair<int, int>> counts;
    for (std::size_t i = 0; i < messages_.size(); ++i) {
      const auto* z = std::get_if<Range>(&messages_[i]);
      if (z != nullptr && z->stamp >= start_.stamp) {
        auto& [all, wrong] = counts[z->anchor];
        ++all;
        wrong += found.outcomes[i].verdict == Verdict::kGated ? 1 : 0;
      }
    }
    return counts;
  }

  Survey summed(Smoothed found, const std::map<Id, Vector<3>>& others) const {
    Survey result;
    const auto counts = count(found);
    for (const auto& [id, ranges] : ranges_) {
      SurveyedAnchor one;
      one.anchor = radio_of(id);
      one.ranges = counts.at(id).first;
      one.rejected = counts.at(id).second;
      for (std::size_t i = 0; i < found.anchors.size(); ++i) {
        if (found.anchors[i].id == id) {
          const auto at = 3 * static_cast<Eigen::Index>(i);
          one.anchor = found.anchors[i];
          one.covariance = found.places_covariance.block<3, 3>(at, at);
          one.status =
              2 * one.rejected > one.ranges ? SurveyStatus::kNotPlaced : SurveyStatus::kPlaced;
        }
      }
      const auto other = others.find(id);
      if (other != others.end() && one.status == SurveyStatus::kPlaced) {
        one.status = SurveyStatus::kTwoPlaces;
        one.other = other->second;
      }
      result.anchors.push_back(one);
    }
    result.smoothed = std::move(found);
    std::vector<Outcome> outcomes(messages_in_all_);
    for (std::size_t i = 0; i < order_.size(); ++i) {
      outcomes[order_[i]] = result.smoothed.outcomes[i];
    }
    result.smoothed.outcomes = std::move(outcomes);
    return result;
  }

  const SurveyConfig& config_;
  const World& world_;
  const PoseEstimate& start_;
  std::vector<std::size_t> order_;  // of fusion, of those that are used
  std::size_t messages_in_all_;
  std::vector<Message> messages_;  // in that order
  const SurveyProgress& progress_;
  Tags tags_;
  RangeBearingModel sighting_;
  std::map<Id, std::vector<Range>> ranges_;            // from the start on
  std::map<Id, std::vector<RangeBearing>> sightings_;  // by name
  bool has_others_ = false;                            // positions or poses
  bool has_odometry_ = false;
  double share_unsure_ = 1.0;  // of the sigma of a drive by which anchors are first placed
  double mirrored_ = 1.0;      // -1 where unfolded anchors are
  bool is_side_open_ = false;  // as of a tag without odometry
  Stamp end_ = 0;
  std::map<Id, Vector<3>> placed_;
  std::map<Id, double> rough_;  // how far off those may be
  std::map<Id, Vector<2>> landmarks_;
};

}  // namespace

Survey survey(const SurveyConfig& config, const World& world, const PoseEstimate& start,
              const std::vector<Message>& messages, const SurveyProgress& progress) {
  return Surveyor(config, world, start, messages, progress).run();
}

}  // namespace locfuse
