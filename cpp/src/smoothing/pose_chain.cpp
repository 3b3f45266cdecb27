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

template <class Linearize>
auto rows_of(const Linearize& linearize) {
  return [linearize](const Pose2& pose) -> std::optional<Measurement::Rows> {
    const auto lin = linearize(pose);
    if (!lin) {
      return std::nullopt;
    }
    return Measurement::Rows{lin->residual, lin->jacobian, lin->noise};
  };
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
    const Calibration::Config& offsets = config.estimator.calibration;
    if (offsets.anchor_offset_correlation_s > 0.0) {  // noise that lasts, not a variable
      wandering_ = offsets.sigma_anchor_offset_m * offsets.sigma_anchor_offset_m;
    } else if (offsets.sigma_anchor_offset_m > 0.0) {
      for (const Anchor& anchor : models_->range.anchors().anchors()) {
        chain_.anchors.push_back(anchor.id);
      }
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
    const auto found = std::find(chain_.anchors.begin(), chain_.anchors.end(), z.anchor);
    const int offset =
        found == chain_.anchors.end() ? -1 : static_cast<int>(found - chain_.anchors.begin());
    return measure(z, message, Source::kRanges, z.anchor, models_->range_gate,
                   models_->estimator.range.noise, offset,
                   rows_of([models = models_, z, more = wandering_](const Pose2& pose) {
                     auto lin = models->range.linearize(pose, z);
                     if (lin) {
                       lin->noise(0) += more;
                     }
                     return lin;
                   }));
  }
  Outcome on(const PositionFix& z, std::size_t message) {
    return measure(z, message, Source::kPositions, 0, models_->position_gate,
                   models_->estimator.position.noise, -1,
                   rows_of([models = models_, z](const Pose2& pose) {
                     return models->position.linearize(pose, z);
                   }));
  }
  Outcome on(const PoseObservation& z, std::size_t message) {
    return measure(z, message, Source::kPoses, 0, models_->pose_gate, models_->estimator.pose.noise,
                   -1, rows_of([models = models_, z](const Pose2& pose) {
                     return models->pose.linearize(pose, z);
                   }));
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
    return measure(z, message, Source::kSightings, *z.landmark, models_->landmark_gate,
                   NoiseKind::kGaussian, -1,
                   rows_of([models = models_, z, at = landmark->position](const Pose2& pose) {
                     return models->landmark.linearize(pose, at, z);
                   }));
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

  template <class M, class Linearize>
  Outcome measure(const M& z, std::size_t message, Source source, Id id, const Gate& gate,
                  NoiseKind kind, int offset, Linearize linearize) {
    validate(z);
    if (!is_plausible(z, models_->estimator.limits)) {
      return {Verdict::kImplausible, Reason::kBeyondLimits};
    }
    if (z.stamp < chain_.stamps.front()) {
      return {Verdict::kStale, Reason::kBeforeEstimate};
    }
    keyframe_at(z.stamp);
    const auto lin = linearize(chain_.guess.back());
    if (!lin) {
      return {Verdict::kNotModelled, why(z)};
    }
    (void)guess_.on(z);
    chain_.guess.back() = guess_.pose();
    const auto rows = static_cast<int>(lin->residual.size());
    Outcome outcome{Verdict::kFused, Reason::kNone, rows};
    outcome.limit = gate.limit(rows);
    chain_.measurements.push_back({message, chain_.stamps.size() - 1, source, id, outcome.limit,
                                   dof_of(kind, models_->estimator), offset,
                                   source == Source::kRanges ? wandering_ / lin->noise(0, 0) : 0.0,
                                   std::move(linearize)});
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
  double wandering_ = 0.0;  // variance of offsets that wander [m^2]
  Stamp at_;                // of what segment_ ends with
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
