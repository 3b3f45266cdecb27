// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "locfuse/error.hpp"
#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/estimators/world.hpp"
#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/kalman.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/filters/robust.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/models/measurement/position.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/motion/odometry.hpp"

/// What the recipes of estimators have in common.
namespace locfuse::internal {

/// The anchors and the landmarks of a world, empty maps of one that has none; never null.
inline std::shared_ptr<const AnchorMap> anchors_of(const World& world) {
  return world.anchors ? world.anchors : std::make_shared<const AnchorMap>();
}
inline std::shared_ptr<const LandmarkMap> landmarks_of(const World& world) {
  return world.landmarks.map ? world.landmarks.map : std::make_shared<const LandmarkMap>();
}

inline double positive(const char* name, double value) {
  if (!(std::isfinite(value) && value > 0.0)) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                                ", expected a finite number > 0");
  }
  return value;
}

inline Stamp stamps_of(const char* name, double seconds) {
  constexpr double kMaxSeconds = 1e9;  // 32 years: with any clock's time it fits in a Stamp
  return static_cast<Stamp>(std::min(positive(name, seconds), kMaxSeconds) * kNanosecondsPerSecond);
}

template <class Config>
Stamp hold_of(const Config& config) {
  return stamps_of("hold_s", config.hold_s);
}

/// What the noise of a kind of measurement looks like.
template <class Config>
NoiseShape noise_of(const char* name, NoiseKind kind, const Config& config) {
  if (kind == NoiseKind::kOneSided && std::string(name) != "range.noise") {
    throw std::invalid_argument(std::string(name) +
                                " is one_sided, expected gaussian, student_t or cauchy: only "
                                "ranges have a long side");
  }
  return NoiseShape({kind, config.robust_dof, config.robust_late_share});
}

/// Names the errors of one row of what a source measures; those of its next rows follow.
inline std::uint64_t source_of(Source kind, Id id) {
  return ((static_cast<std::uint64_t>(kind) << kBitsOfId) | static_cast<std::uint32_t>(id))
         << kBitsOfRow;
}

/// Names an anchor and a tag together: what stands between the two, and the antennas of both, make
/// their errors. Another tag of a body sees another part of it.
inline Id link_of(const Range& z) {
  constexpr unsigned kBitsOfAnchor = 20;
  return z.anchor ^ static_cast<Id>(static_cast<std::uint32_t>(z.tag) << kBitsOfAnchor);
}

/// Says of a measurement of whose errors its own are the next.
template <class Config, class Lin>
void name_source(const Config& config, std::optional<Lin>& lin, Source kind, Id id) {
  if (lin) {
    lin->correlation.time_s = config.correlation_s;
    static_assert(static_cast<std::size_t>(Source::kImu) <= kErrorKinds);  // the last: no error
    lin->correlation.kind = static_cast<std::size_t>(kind);
    std::iota(lin->correlation.sources.begin(), lin->correlation.sources.end(),
              source_of(kind, id));
  }
}

/// The same measurement with its source named.
template <class Config, class Lin>
std::optional<Lin> of_source(const Config& config, std::optional<Lin> lin, Source kind, Id id = 0) {
  name_source(config, lin, kind, id);
  return lin;
}

/// Makes room for what correlated errors add to a belief that has all its variables.
inline void expect_correlated(GaussianBelief& belief, double correlation_s) {
  if (!(correlation_s >= 0.0 && std::isfinite(correlation_s))) {
    throw std::invalid_argument("correlation_s is " + std::to_string(correlation_s) +
                                ", expected 0 for independent errors, or more");
  }
  if (correlation_s > 0.0) {
    belief.correlated.reserve(belief.dimension());
  }
}

/// Whether an estimator takes an Imu itself, and not an Odometer before it.
template <class Estimator, class = void>
constexpr bool kTakesImu = false;
template <class Estimator>
constexpr bool kTakesImu<Estimator, std::void_t<decltype(Estimator::kTakesImu)>> = true;

/// Passes a message on to `on` of its kind; one of the kinds `Ignored` is kIgnored if it is valid,
/// and so is an Imu that an estimator does not take.
template <class... Ignored, class Estimator>
Outcome dispatch(Estimator& estimator, const Message& message) {
  return std::visit(
      [&](const auto& m) -> Outcome {
        using M = std::decay_t<decltype(m)>;
        constexpr bool kNoImu = std::is_same_v<M, Imu> && !kTakesImu<Estimator>;
        if constexpr (kNoImu || (std::is_same_v<M, Ignored> || ...)) {
          validate(m);
          return {Verdict::kIgnored, Reason::kNotUsed};
        } else {
          return estimator.on(m);
        }
      },
      message);
}

/// Checks a message that an estimator has no use for.
template <class M>
Outcome not_used(const M& z) {
  validate(z);
  return {Verdict::kNotModelled, Reason::kNotUsed};
}

/// Stands for noise that no config can make anything but Gaussian.
struct AlwaysGaussian {};
inline constexpr AlwaysGaussian kGaussian;

template <class Lin>
Outcome fuse(GaussianBelief& belief, const Lin& lin, Slots slots, const Gate& gate,
             const NoiseShape& noise) {
  return update(belief, lin, slots, gate, noise);
}
template <class Lin>
Outcome fuse(GaussianBelief& belief, const Lin& lin, Slots slots, const Gate& gate,
             AlwaysGaussian /*noise*/) {
  return update(belief, lin, slots, gate);
}

/// Standing where nothing is known of the motion any more.
template <class Config>
OdometryMotion lost_motion(const Config& config) {
  OdometryMotion::Config lost = config.odometry;
  lost.sigma_xy_per_sqrt_s = positive("sigma_lost_xy_per_sqrt_s", config.sigma_lost_xy_per_sqrt_s);
  lost.sigma_heading_per_sqrt_s =
      positive("sigma_lost_heading_per_sqrt_s", config.sigma_lost_heading_per_sqrt_s);
  return OdometryMotion(lost);
}

/// Throws std::invalid_argument unless all are valid and of one stamp.
template <class M, class Validate>
void validate_together(const char* what, const std::vector<M>& messages, const Validate& check) {
  for (const M& message : messages) {
    check(message);
    if (message.stamp != messages.front().stamp) {
      throw std::invalid_argument(std::string(what) + " have stamps " +
                                  std::to_string(messages.front().stamp) + " and " +
                                  std::to_string(message.stamp) + " ns, expected one stamp");
    }
  }
}

template <class M>
void validate_together(const char* what, const std::vector<M>& messages) {
  validate_together(what, messages, [](const M& message) { validate(message); });
}

template <class M>
bool are_plausible(const std::vector<M>& messages, const Limits& limits) {
  return std::all_of(messages.begin(), messages.end(),
                     [&](const M& message) { return is_plausible(message, limits); });
}

/// What `on` makes of the plausible ones of some messages, kImplausible for the others.
template <class M, class On>
std::vector<Outcome> plausible_only(const std::vector<M>& messages, const Limits& limits,
                                    const On& on) {
  std::vector<M> rest;
  rest.reserve(messages.size());
  std::copy_if(messages.begin(), messages.end(), std::back_inserter(rest),
               [&](const M& message) { return is_plausible(message, limits); });
  const std::vector<Outcome> of_rest = on(rest);
  std::vector<Outcome> outcomes(messages.size(),
                                Outcome{Verdict::kImplausible, Reason::kBeyondLimits});
  std::size_t next = 0;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    if (is_plausible(messages[i], limits)) {
      outcomes[i] = of_rest[next++];
    }
  }
  return outcomes;
}

/// What `on` makes of sightings of one instant in the order of `precedes`, for each where it
/// stands.
template <class On>
std::vector<Outcome> in_order(const std::vector<RangeBearing>& sightings, const On& on) {
  std::vector<std::size_t> order(sightings.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return precedes(sightings[a], sightings[b]);
  });
  std::vector<RangeBearing> sorted(sightings.size());
  std::transform(order.begin(), order.end(), sorted.begin(),
                 [&](std::size_t place) { return sightings[place]; });
  const std::vector<Outcome> of_sorted = on(sorted);
  std::vector<Outcome> outcomes(sightings.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    outcomes[order[i]] = of_sorted[i];
  }
  return outcomes;
}

/// What `fuse` makes of one message of several: where its numbers leave no finite result it is
/// kNotModelled, as an exception would hide that others have changed the belief already.
template <class Fuse>
Outcome one_of_several(const Fuse& fuse) {
  try {
    return fuse();
  } catch (const NumericalError&) {
    return {Verdict::kNotModelled, Reason::kNumerical};
  }
}

inline bool has_tag(const std::vector<Tag>& tags, Id id) {
  return std::any_of(tags.begin(), tags.end(), [id](const Tag& tag) { return tag.id == id; });
}

/// Why a model has nothing to say of a measurement.
inline Reason why_not(const RangeModel& model, const Range& z) {
  if (model.anchors().find(z.anchor) == nullptr) {
    return Reason::kUnknownAnchor;
  }
  return has_tag(model.tags(), z.tag) ? Reason::kNoDirection : Reason::kUnknownTag;
}
inline Reason why_not(const PositionModel& model, const PositionFix& z) {
  return !z.tag || has_tag(model.tags(), *z.tag) ? Reason::kNoSigma : Reason::kUnknownTag;
}
inline Reason why_not(const LandmarkMap& landmarks, const RangeBearing& z) {
  const bool is_known =
      z.landmark ? landmarks.find(*z.landmark) != nullptr : !landmarks.landmarks().empty();
  return is_known ? Reason::kNoDirection : Reason::kUnknownLandmark;
}

/// Throws std::invalid_argument if an estimate is asked for before the belief.
inline void check_not_before(Stamp belief, Stamp stamp) {
  if (stamp < belief) {
    throw std::invalid_argument("an estimate was asked for " + std::to_string(stamp) +
                                " ns, before the belief at " + std::to_string(belief) + " ns");
  }
}

/// A copy of a belief, in memory of an earlier one: after the first of a size none is allocated.
class KeptBelief {
 public:
  explicit KeptBelief(const GaussianBelief& belief) : kept_(copy_of(belief)) {}
  KeptBelief(const KeptBelief&) = delete;
  KeptBelief& operator=(const KeptBelief&) = delete;
  ~KeptBelief() {
    if (std::vector<GaussianBelief>& free = unused(); free.size() < free.capacity()) {
      free.push_back(std::move(kept_));
    }
  }
  [[nodiscard]] const GaussianBelief& belief() const { return kept_; }

 private:
  static GaussianBelief copy_of(const GaussianBelief& belief) {
    std::vector<GaussianBelief>& free = unused();
    if (free.empty()) {
      return belief;
    }
    GaussianBelief copy = std::move(free.back());
    free.pop_back();
    copy = belief;
    return copy;
  }
  static std::vector<GaussianBelief>& unused() {
    constexpr std::size_t kMost = 4;
    thread_local std::vector<GaussianBelief> beliefs = [] {
      std::vector<GaussianBelief> none;
      none.reserve(kMost);
      return none;
    }();
    return beliefs;
  }

  GaussianBelief kept_;
};

/// Puts the pose of a belief of `Rows` variables back, bit for bit, unless the message that it was
/// moved for was fused: a motion changes no more than the pose's rows and columns. Where more
/// moves, `Rows` is 3 and the belief has more: then it is kept whole.
template <int Rows>
class Transaction {
 public:
  Transaction(GaussianBelief& belief, Stamp until)
      : belief_(until > belief.stamp ? &belief : nullptr),
        counted_(belief),
        stamp_(belief.stamp),
        interventions_(belief.interventions) {
    if (belief_ == nullptr) {
      return;
    }
    if (Rows == 3 && belief.dimension() > 3) {
      whole_.emplace(belief);
    } else {
      x_ = belief.x.template head<3>();
      P_ = belief.P.template leftCols<3>();
      correlated_rows_ = belief.correlated.moving_rows();
      correlated_columns_ = belief.correlated.moving_columns();
      stood_ = belief.correlated.stood();
    }
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  ~Transaction() {
    if (belief_ != nullptr && whole_) {
      *belief_ = whole_->belief();
    } else if (belief_ != nullptr) {
      belief_->stamp = stamp_;
      belief_->interventions = interventions_;
      belief_->x.template head<3>() = x_;
      belief_->P.template topRows<3>() = P_.transpose();
      belief_->P.template leftCols<3>() = P_;
      belief_->correlated.restore(correlated_rows_, correlated_columns_, stood_);
    }
  }
  [[nodiscard]] Outcome close(Outcome outcome) {
    if (outcome.verdict == Verdict::kFused) {
      belief_ = nullptr;
      outcome.interventions = static_cast<int>(counted_.interventions - interventions_);
    }
    return outcome;
  }

 private:
  GaussianBelief* belief_;
  const GaussianBelief& counted_;
  Stamp stamp_;
  std::uint64_t interventions_;
  Vector<3> x_;
  Matrix<Rows, 3> P_;
  static constexpr int kMaxCorrelated =
      Rows == Eigen::Dynamic ? Eigen::Dynamic : Rows + int(CorrelatedErrors::kMaxRows);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 3, kMaxCorrelated>
      correlated_rows_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, Rows, 3>
      correlated_columns_;
  double stood_ = 0.0;
  std::optional<KeptBelief> whole_;
};

/// Moves the body and its belief's stamp.
inline void move(GaussianBelief& belief, Slot body, const OdometryMotion& model,
                 const Pose2& motion, Stamp stamp, const std::optional<Vector<3>>& variance = {}) {
  const double seconds = seconds_between(belief.stamp, stamp);
  predict(belief, model.propagate(belief.pose(body), motion, seconds, variance), body);
  belief.stamp = stamp;
}

/// How far a robot may go that never says how it moves; docs/filter.md.
struct UnknownMotionTuning {
  /// Sigma of its speed over sigma_lost_xy_per_sqrt_s: 1 m/s for the default of 0.5, so that one
  /// that walks or drives at 2 m/s is at two sigma [1 / sqrt(s)].
  static constexpr double kSpeedSigma = 2.0;
};

/// When what makes errors last changes; docs/models/updates.md.
struct StandingTuning {
  static constexpr double kSpeed = 0.1;  ///< [m/s + rad/s] of a robot that crawls
};

/// How far a body whose odometry was never received goes at an unknown speed, which lasts as long
/// as one that odometry reports: sigma of each axis [m].
template <class Config>
double unknown_way(const Config& config, Stamp hold, double seconds) {
  const double lasts = std::min(seconds, static_cast<double>(hold) / kNanosecondsPerSecond);
  return UnknownMotionTuning::kSpeedSigma * config.sigma_lost_xy_per_sqrt_s * lasts;
}

/// Moves a body whose odometry was never received: at an unknown speed, and by the random walk of a
/// body whose odometry is lost.
template <class Recipe>
void wander(const Recipe& recipe, GaussianBelief& belief, Slot body, Stamp stamp) {
  const double seconds = seconds_between(belief.stamp, stamp);
  const double way = unknown_way(recipe.config, recipe.hold, seconds);
  Propagation<Pose2, 3> step = recipe.lost.propagate(belief.pose(body), Pose2{}, seconds);
  step.noise(0, 0) += way * way;
  step.noise(1, 1) += way * way;
  predict(belief, step, body);
  belief.stamp = stamp;
}

/// Whether some errors of odometry may be states of that recipe.
template <class Recipe, class = void>
constexpr bool kCalibrates = false;
template <class Recipe>
constexpr bool kCalibrates<Recipe, std::void_t<decltype(Recipe::calibration)>> = true;

/// Moves the body, and the errors that are states, by odometry.
template <class Recipe>
void drive(const Recipe& recipe, GaussianBelief& belief, Slot body, const Pose2& motion,
           Stamp stamp, const std::optional<Vector<3>>& variance) {
  if (!(recipe.config.odometry.sigma_xy_per_sqrt_s > 0.0)) {  // or it may move at rest
    const double way =
        std::sqrt(motion.x * motion.x + motion.y * motion.y) + std::abs(motion.heading);
    belief.correlated.stand(
        std::max(0.0, seconds_between(belief.stamp, stamp) - way / StandingTuning::kSpeed));
  }
  if constexpr (kCalibrates<Recipe>) {
    if (recipe.calibration.has_odometry()) {
      const double seconds = seconds_between(belief.stamp, stamp);
      predict(belief,
              recipe.calibration.propagate(belief, recipe.motion, motion, seconds, variance),
              recipe.calibration.motion_slots());
      belief.stamp = stamp;
      return;
    }
  }
  move(belief, body, recipe.motion, motion, stamp, variance);
}

/// Carries a belief to `stamp` with what odometry says. Earlier stamps change nothing.
template <class Recipe>
void advance(const Recipe& recipe, const HeldMotion& odometry, Slot body, GaussianBelief& belief,
             Stamp stamp) {
  check_stamp(stamp);
  if (stamp <= belief.stamp) {
    return;
  }
  if constexpr (kCalibrates<Recipe>) {
    if (recipe.calibration.has_wandering()) {
      predict(belief, recipe.calibration.wander(belief, seconds_between(belief.stamp, stamp)),
              recipe.calibration.wandering_slots());
    }
    if (recipe.calibration.has_heading(belief)) {
      diffuse(belief, recipe.calibration.heading_slots().back(),
              recipe.calibration.heading_wander() * seconds_between(belief.stamp, stamp));
    }
  }
  if (!odometry.is_received()) {
    wander(recipe, belief, body, stamp);
    return;
  }
  odometry.advance(
      belief.stamp, stamp, recipe.hold,
      [&](const Pose2& motion, Stamp until, const std::optional<Vector<3>>& variance) {
        drive(recipe, belief, body, motion, until, variance);
      },
      [&](Stamp until) { move(belief, body, recipe.lost, Pose2{}, until); });
}

/// Carries a belief of `Rows` variables to where a motion begins that holds from then on.
template <int Rows, class Recipe, class Motion>
Outcome take(const Recipe& recipe, HeldMotion& odometry, Slot body, GaussianBelief& belief,
             const Motion& u) {
  validate(u);
  if (!is_plausible(u, recipe.config.limits)) {
    return {Verdict::kImplausible, Reason::kBeyondLimits};
  }
  if (u.stamp < belief.stamp) {
    return {Verdict::kStale, Reason::kBeforeEstimate};
  }
  Transaction<Rows> transaction(belief, u.stamp);
  if constexpr (std::is_same_v<Motion, Increment>) {
    advance(recipe, odometry, body, belief, u.begin);
    if (u.begin == u.stamp) {  // a displacement without duration
      drive(recipe, belief, body, u.motion, u.stamp, u.variance);
    }
    odometry.take(u, recipe.config.limits);
  } else {
    advance(recipe, odometry, body, belief, u.stamp);
    odometry.take(u);
  }
  return transaction.close({Verdict::kFused});
}

}  // namespace locfuse::internal
