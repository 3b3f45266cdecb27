// SPDX-License-Identifier: Apache-2.0
#include "smoothing/pose_chain.hpp"

#include <algorithm>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/estimators/held_motion.hpp"

namespace locfuse::internal {
namespace {

/// Variance that a motion has at the least, [m^2] and [rad^2], so that standing is no division by
/// 0.
constexpr double kLeastVariance = 1e-10;

/// The models of a PoseEkf.
struct Models {
  Models(const SmootherConfig& config, const World& world)
      : estimator(config.estimator),
        odometry(estimator.odometry),
        lost(lost_motion(estimator)),
        range(estimator.range, anchors_of(world), world.tags),
        position(estimator.position, world.tags),
        pose(estimator.pose),
        landmark(estimator.landmark, world.landmarks.T_body_sensor),
        landmarks(landmarks_of(world)),
        range_gate(estimator.range.gate),
        position_gate(estimator.position.gate),
        pose_gate(estimator.pose.gate),
        landmark_gate(estimator.landmark.gate),
        hold(hold_of(estimator)) {}

  PoseEkf::Config estimator;
  OdometryMotion odometry;
  OdometryMotion lost;
  RangeModel range;
  PositionModel position;
  PoseModel pose;
  RangeBearingModel landmark;
  std::shared_ptr<const LandmarkMap> landmarks;
  Gate range_gate;
  Gate position_gate;
  Gate pose_gate;
  Gate landmark_gate;
  Stamp hold;
};

using Values = Measurement::Values;

template <class Lin>
std::optional<MeasuredRows> rows_of(const std::optional<Lin>& lin) {
  if (!lin) {
    return std::nullopt;
  }
  MeasuredRows rows;
  rows.by_pose = {lin->residual, lin->jacobian.template leftCols<3>(), lin->noise};
  rows.by_shared.setZero(lin->residual.size(), kMaxShared);
  return rows;
}

/// Of a range's variables the place in the list of those that it has, or -1.
struct RangeVariables {
  SharedPlaces places = kNothingShared;  ///< by RangeVariable
  SharedPlaces listed = kNothingShared;  ///< in the chain
  Anchor anchor;                         ///< as the map has them
  Vector<3> tag = Vector<3>::Zero();

  bool climbs;

  RangeVariables(const Anchor& of_anchor, const SharedPlaces& radio, const Tag& of_tag,
                 const SharedPlaces& arm, bool has_climb)
      : anchor(of_anchor), tag(of_tag.position), climbs(has_climb) {
    int count = 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const int variable = i == kForward ? arm[0] : i == kLeft ? arm[1] : radio[i];
      if (variable >= 0) {
        listed[static_cast<std::size_t>(count)] = variable;
        places[i] = count++;
      }
    }
  }
  [[nodiscard]] bool has(RangeVariable one) const { return places[one] >= 0; }
  [[nodiscard]] bool is_exact() const { return listed[0] < 0; }
  [[nodiscard]] double value(RangeVariable one, const Values& values, double otherwise) const {
    return has(one) ? values[static_cast<std::size_t>(places[one])] : otherwise;
  }

  [[nodiscard]] std::optional<MeasuredRows> linearize(const RangeModel& model, const Pose2& pose,
                                                      const Range& z, const Values& values) const {
    const double offset = value(kOffset, values, 0.0);
    const double scale = value(kScale, values, 0.0);
    const double z_of_anchor = climbs ? tag.z() : value(kZ, values, anchor.position.z());
    const Anchor at{anchor.id,
                    {value(kX, values, anchor.position.x()), value(kY, values, anchor.position.y()),
                     z_of_anchor},
                    anchor.offset + offset,
                    anchor.scale + scale};
    const Vector<3> arm(value(kForward, values, tag.x()), value(kLeft, values, tag.y()), tag.z());
    auto lin = model.linearize_with_places(pose, z, at, arm);
    double by_climb = 0.0;
    if (lin && climbs) {  // of the distance in the plane until here
      const double flat = (z.range - lin->residual(0) - at.offset) / at.scale;
      const double squared = flat * flat + value(kZ, values, 0.0);
      constexpr double kLeast = 1e-6;
      if (!(squared > kLeast)) {
        return std::nullopt;
      }
      const double distance = std::sqrt(squared);
      lin->residual(0) = z.range - at.scale * distance - at.offset;
      lin->jacobian *= flat / distance;
      by_climb = 0.5 * at.scale / distance;
    }
    auto rows = rows_of(lin);
    if (!rows) {
      return rows;
    }
    const auto put = [&](RangeVariable one, double derivative) {
      if (has(one)) {
        rows->by_shared(0, places[one]) = derivative;
      }
    };
    put(kX, lin->jacobian(3));
    put(kY, lin->jacobian(4));
    put(kZ, climbs ? by_climb : lin->jacobian(5));
    put(kForward, lin->jacobian(6));
    put(kLeft, lin->jacobian(7));
    put(kOffset, 1.0);
    put(kScale, (z.range - lin->residual(0) - at.offset) / at.scale);
    return rows;
  }
};

/// A list of uncertain places by id, each of which the map has.
template <class Map>
std::vector<const UncertainPlace*> places_of(const char* what, const Map& known,
                                             const std::vector<UncertainPlace>& uncertain) {
  std::vector<const UncertainPlace*> found(known.size(), nullptr);
  for (const UncertainPlace& place : uncertain) {
    const auto at = std::find_if(known.begin(), known.end(),
                                 [&](const auto& one) { return one.id == place.id; });
    if (at == known.end() || !place.mean.allFinite() || !place.sigma_m.allFinite() ||
        !(place.sigma_m.minCoeff() >= 0.0) || !(place.guess_sigma_m >= 0.0)) {
      throw std::invalid_argument(std::string(what) + " " + std::to_string(place.id) +
                                  " is not in the world, or its mean or sigmas are not finite "
                                  "numbers, sigmas >= 0");
    }
    found[static_cast<std::size_t>(at - known.begin())] = &place;
  }
  return found;
}

double dof_of(NoiseKind kind, const PoseEkf::Config& config) {
  return kind == NoiseKind::kStudentT ? config.robust_dof : kind == NoiseKind::kCauchy ? 1.0 : 0.0;
}

/// Builds a chain from messages in order of fusion.
class Builder {
 public:
  Builder(const SmootherConfig& config, const World& world, const PoseEstimate& start)
      : models_(std::make_shared<const Models>(config, world)),
        keyframe_(keyframe_of(config)),
        guess_(config.estimator, world, start),
        odometry_(start.stamp),
        at_(start.stamp) {
    chain_.stamps.push_back(start.stamp);
    chain_.guess.push_back(start.pose);
    segment_ = {{}, Matrix<3, 3>::Zero()};
    const Calibration::Config& errors = config.estimator.calibration;
    if (errors.anchor_offset_correlation_s > 0.0) {  // noise that lasts, not a variable
      wandering_ = errors.sigma_anchor_offset_m * errors.sigma_anchor_offset_m;
    }
    const double sigma_offset =
        errors.anchor_offset_correlation_s > 0.0 ? 0.0 : errors.sigma_anchor_offset_m;
    const std::vector<Anchor>& anchors = models_->range.anchors().anchors();
    anchor_places_ = places_of("anchor", anchors, config.anchors);
    for (std::size_t i = 0; i < anchors.size(); ++i) {
      SharedPlaces radio = kNothingShared;
      const UncertainPlace* place = anchor_places_[i];
      Vector<3> guess = anchors[i].position;
      if (place != nullptr && place->climbs) {
        const double climb = guess.z() - height_of_tags();
        guess.z() = climb * climb;
      }
      share(place, guess, 3, radio);
      radio[kOffset] = share({0.0, 0.0, sigma_offset});
      radio[kScale] = share({0.0, 0.0, errors.sigma_anchor_scale});
      chain_.radios.push_back(radio);
    }
    const std::vector<Tag>& tags = models_->range.tags();
    const auto tag_places = places_of("tag", tags, config.tags);
    for (std::size_t i = 0; i < tags.size(); ++i) {
      chain_.tags.push_back(kNothingShared);
      share(tag_places[i], tags[i].position, 2, chain_.tags.back());
    }
    const std::vector<Landmark>& landmarks = models_->landmarks->landmarks();
    landmark_places_ = places_of("landmark", landmarks, config.landmarks);
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      chain_.landmarks.push_back(kNothingShared);
      const Vector<2>& at = landmarks[i].position;
      share(landmark_places_[i], {at.x(), at.y(), 0.0}, 2, chain_.landmarks.back());
    }
  }

  Outcome on(const Velocity& u, std::size_t /*message*/) { return drive(u, u.stamp); }
  Outcome on(const Increment& u, std::size_t /*message*/) {
    const Outcome outcome = drive(u, u.begin);
    if (outcome.verdict == Verdict::kFused && u.begin == u.stamp) {
      move(models_->odometry, u.motion, u.stamp, u.variance);
    }
    return outcome;
  }
  Outcome on(const Range& z, std::size_t message) {
    const std::vector<Anchor>& anchors = models_->range.anchors().anchors();
    const std::vector<Tag>& tags = models_->range.tags();
    const std::size_t anchor = place_in(anchors, z.anchor);
    const std::size_t tag = place_in(tags, z.tag);
    Measurement made{message, 0, Source::kRanges, z.anchor};
    if (anchor == anchors.size() || tag == tags.size()) {
      made.linearize = [](const Pose2&, const Values&) { return std::nullopt; };
      return measure(z, z, std::move(made), models_->range_gate, models_->estimator.range.noise);
    }
    const bool climbs = anchor_places_[anchor] != nullptr && anchor_places_[anchor]->climbs;
    const RangeVariables variables(anchors[anchor], chain_.radios[anchor], tags[tag],
                                   chain_.tags[tag], climbs);
    made.shared = variables.listed;
    made.linearize = [models = models_, z, variables, more = wandering_](const Pose2& pose,
                                                                         const Values& values) {
      auto rows = variables.is_exact() ? rows_of(models->range.linearize(pose, z))
                                       : variables.linearize(models->range, pose, z, values);
      if (rows) {
        rows->by_pose.noise(0) += more;
      }
      return rows;
    };
    Range first = z;  // for the guess
    if (const double off = guess_sigma(anchor_places_[anchor]); off > 0.0) {
      const double sigma = z.sigma.value_or(models_->estimator.range.sigma_m);
      first.sigma = std::hypot(sigma, off);
    }
    return measure(z, first, std::move(made), models_->range_gate, models_->estimator.range.noise);
  }
  Outcome on(const PositionFix& z, std::size_t message) {
    Measurement made{message, 0, Source::kPositions, 0};
    made.linearize = [models = models_, z](const Pose2& pose, const Values& /*values*/) {
      return rows_of(models->position.linearize(pose, z));
    };
    return measure(z, z, std::move(made), models_->position_gate,
                   models_->estimator.position.noise);
  }
  Outcome on(const PoseObservation& z, std::size_t message) {
    Measurement made{message, 0, Source::kPoses, 0};
    made.linearize = [models = models_, z](const Pose2& pose, const Values& /*values*/) {
      return rows_of(models->pose.linearize(pose, z));
    };
    return measure(z, z, std::move(made), models_->pose_gate, models_->estimator.pose.noise);
  }
  Outcome on(const RangeBearing& z, std::size_t message) {
    validate(z);
    if (!z.landmark) {
      return {Verdict::kIgnored, Reason::kUnnamed};
    }
    const Landmark* landmark = models_->landmarks->find(*z.landmark);
    if (landmark == nullptr) {
      return {Verdict::kNotModelled, Reason::kUnknownLandmark};
    }
    const std::size_t place = place_in(models_->landmarks->landmarks(), *z.landmark);
    Measurement made{message, 0, Source::kSightings, *z.landmark};
    made.shared = chain_.landmarks[place];
    RangeBearing first = z;  // for the guess
    if (made.shared[0] < 0) {
      made.linearize = [models = models_, z, at = landmark->position](const Pose2& pose,
                                                                      const Values& /*values*/) {
        return rows_of(models->landmark.linearize(pose, at, z));
      };
    } else {
      made.linearize = [models = models_, z](const Pose2& pose, const Values& values) {
        const auto lin = models->landmark.linearize_with_landmark(pose, {values[0], values[1]}, z);
        auto rows = rows_of(lin);
        if (rows) {
          rows->by_shared.leftCols<2>() = lin->jacobian.rightCols<2>();
        }
        return rows;
      };
      const double off = guess_sigma(landmark_places_[place]);
      Matrix<2, 2> more = models_->landmark.noise(z);
      more(0, 0) += off * off;
      more(1, 1) += off * off / std::max(z.range.value_or(1.0) * z.range.value_or(1.0), 1e-2);
      first.covariance = more;
    }
    return measure(z, first, std::move(made), models_->landmark_gate, NoiseKind::kGaussian);
  }
  Outcome on(const Altitude& z, std::size_t /*message*/) { return ignored(z); }
  Outcome on(const Heading& z, std::size_t /*message*/) { return ignored(z); }
  Outcome on(const LaserScan& z, std::size_t /*message*/) { return ignored(z); }
  Outcome on(const Imu& z, std::size_t /*message*/) { return ignored(z); }

  /// The last pose is where odometry ends.
  PoseChain finish(std::vector<Outcome> outcomes) {
    if (chain_.measurements.empty()) {
      throw std::invalid_argument("nothing to smooth: no message after the start measures a pose");
    }
    if (odometry_.is_received() && odometry_.end() > chain_.stamps.back()) {
      keyframe_at(odometry_.end());
    }
    if (models_->estimator.correlation_s > 0.0) {
      const CorrelatedErrors& errors = guess_.belief().correlated;
      for (std::size_t kind = 0; kind < kSources; ++kind) {
        chain_.lasting[kind] = {errors.share(kind), errors.common(kind), errors.factor(kind)};
      }
    }
    chain_.outcomes = std::move(outcomes);
    return std::move(chain_);
  }

 private:
  template <class M>
  static Outcome ignored(const M& z) {
    validate(z);
    return {Verdict::kIgnored, Reason::kNotUsed};
  }

  static Stamp keyframe_of(const SmootherConfig& config) {
    constexpr double kLeast = 1e-3;  // [s]
    if (!(config.keyframe_s >= kLeast)) {
      throw std::invalid_argument("keyframe_s is " + std::to_string(config.keyframe_s) +
                                  ", expected at least " + std::to_string(kLeast));
    }
    return stamps_of("keyframe_s", config.keyframe_s);
  }

  template <class Motion>
  Outcome drive(const Motion& u, Stamp begin) {
    validate(u);
    if (!is_plausible(u, models_->estimator.limits)) {
      return {Verdict::kImplausible, Reason::kBeyondLimits};
    }
    if (u.stamp < at_) {
      return {Verdict::kStale, Reason::kBeforeEstimate};
    }
    // As long as odometry is held; of what comes after nothing is known.
    const Stamp known = std::min(begin, odometry_.end() + models_->hold);
    while (odometry_.is_received() && known - chain_.stamps.back() > keyframe_) {
      keyframe_at(std::max(chain_.stamps.back() + keyframe_, at_));
    }
    advance(begin);
    (void)guess_.on(u);
    if constexpr (std::is_same_v<Motion, Increment>) {
      odometry_.take(u, models_->estimator.limits);
    } else {
      odometry_.take(u);
    }
    return {Verdict::kFused};
  }

  [[nodiscard]] Reason why(const Range& z) const { return why_not(models_->range, z); }
  [[nodiscard]] Reason why(const PositionFix& z) const { return why_not(models_->position, z); }
  [[nodiscard]] static Reason why(const PoseObservation& /*z*/) { return Reason::kNoSigma; }
  [[nodiscard]] Reason why(const RangeBearing& z) const { return why_not(*models_->landmarks, z); }

  [[nodiscard]] double height_of_tags() const {
    return models_->range.tags().empty() ? 0.0 : models_->range.tags().front().position.z();
  }
  /// A new variable unless its sigma is 0; its number, or -1.
  int share(const SharedVariable& variable) {
    if (!(variable.sigma > 0.0)) {
      return -1;
    }
    chain_.shared.push_back(variable);
    return static_cast<int>(chain_.shared.size()) - 1;
  }
  void share(const UncertainPlace* place, const Vector<3>& guess, int axes, SharedPlaces& places) {
    for (int axis = 0; place != nullptr && axis < axes; ++axis) {
      places[static_cast<std::size_t>(axis)] =
          share({guess(axis), place->mean(axis), place->sigma_m(axis), axis == 2 && place->climbs});
    }
  }
  template <class Places>
  [[nodiscard]] static std::size_t place_in(const Places& all, Id id) {
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const auto& one) { return one.id == id; });
    return static_cast<std::size_t>(found - all.begin());
  }
  [[nodiscard]] static double guess_sigma(const UncertainPlace* place) {
    return place == nullptr ? 0.0 : place->guess_sigma_m;
  }

  /// `first` is what the guess takes in place of the message.
  template <class M>
  Outcome measure(const M& z, const M& first, Measurement made, const Gate& gate, NoiseKind kind) {
    validate(z);
    if (!is_plausible(z, models_->estimator.limits)) {
      return {Verdict::kImplausible, Reason::kBeyondLimits};
    }
    if (z.stamp < chain_.stamps.front()) {
      return {Verdict::kStale, Reason::kBeforeEstimate};
    }
    keyframe_at(z.stamp);
    Values values{};
    for (std::size_t i = 0; i < values.size() && made.shared[i] >= 0; ++i) {
      values[i] = chain_.shared[static_cast<std::size_t>(made.shared[i])].guess;
    }
    const auto found = made.linearize(chain_.guess.back(), values);
    if (!found) {
      return {Verdict::kNotModelled, why(z)};
    }
    (void)guess_.on(first);
    chain_.guess.back() = guess_.pose();
    const auto rows = static_cast<int>(found->by_pose.residual.size());
    Outcome outcome{Verdict::kFused, Reason::kNone, rows};
    outcome.limit = gate.limit(rows);
    made.pose = chain_.stamps.size() - 1;
    made.limit = outcome.limit;
    made.dof = dof_of(kind, models_->estimator);
    made.wanders = made.source == Source::kRanges ? wandering_ / found->by_pose.noise(0, 0) : 0.0;
    chain_.measurements.push_back(std::move(made));
    return outcome;
  }

  void move(const OdometryMotion& model, const Pose2& motion, Stamp until,
            const std::optional<Vector<3>>& variance) {
    const auto step =
        model.propagate(segment_.motion, motion, seconds_between(at_, until), variance);
    segment_.covariance =
        step.jacobian * segment_.covariance * step.jacobian.transpose() + step.noise;
    segment_.motion = step.moved;
    at_ = until;
  }

  /// Carries the motion since the last pose to `stamp`.
  void advance(Stamp stamp) {
    if (stamp <= at_) {
      return;
    }
    if (!odometry_.is_received()) {  // as a PoseEkf that was given none: it may move anyhow
      const double way =
          unknown_way(models_->estimator, models_->hold, seconds_between(at_, stamp));
      move(models_->lost, {}, stamp, {});
      segment_.covariance.topLeftCorner<2, 2>().diagonal().array() += way * way;
      return;
    }
    odometry_.advance(
        at_, stamp, models_->hold,
        [&](const Pose2& motion, Stamp until, const std::optional<Vector<3>>& variance) {
          move(models_->odometry, motion, until, variance);
        },
        [&](Stamp until) { move(models_->lost, {}, until, {}); });
  }

  /// Makes `stamp` the last pose, unless it is.
  void keyframe_at(Stamp stamp) {
    if (stamp <= chain_.stamps.back()) {
      return;
    }
    advance(stamp);
    guess_.advance_to(stamp);
    segment_.covariance.diagonal().array() += kLeastVariance;
    chain_.motions.push_back(segment_);
    segment_ = {{}, Matrix<3, 3>::Zero()};
    chain_.stamps.push_back(stamp);
    chain_.guess.push_back(guess_.pose());
  }

  std::shared_ptr<const Models> models_;
  Stamp keyframe_;
  PoseEkf guess_;
  HeldMotion odometry_;
  std::vector<const UncertainPlace*> anchor_places_;    // of each anchor of the map, or null
  std::vector<const UncertainPlace*> landmark_places_;  // of each landmark of the map, or null
  double wandering_ = 0.0;                              // variance of offsets that wander [m^2]
  Stamp at_;                                            // of what segment_ ends with
  RelativeMotion segment_;
  PoseChain chain_;
};

}  // namespace

PoseChain make_pose_chain(const SmootherConfig& config, const World& world,
                          const PoseEstimate& start, const std::vector<Message>& messages) {
  std::vector<std::size_t> order(messages.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return precedes(messages[a], messages[b]);
  });
  Builder builder(config, world, start);
  std::vector<Outcome> outcomes(messages.size());
  for (const std::size_t message : order) {
    outcomes[message] =
        std::visit([&](const auto& one) { return builder.on(one, message); }, messages[message]);
  }
  return builder.finish(std::move(outcomes));
}

}  // namespace locfuse::internal
