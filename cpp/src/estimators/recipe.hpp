// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "locfuse/estimators/held_motion.hpp"
#include "locfuse/filters/belief.hpp"
#include "locfuse/filters/kalman.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/models/motion/odometry.hpp"

/// What the recipes of estimators have in common.
namespace locfuse::internal {

inline double positive(const char* name, double value) {
  if (!(std::isfinite(value) && value > 0.0)) {
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                                ", expected a finite number > 0");
  }
  return value;
}

inline Stamp stamps_of(const char* name, double seconds) {
  constexpr double kForever = 1e9;  // 32 years: end of a hold and any clock's time fit in a Stamp
  return static_cast<Stamp>(std::min(positive(name, seconds), kForever) * kNanosecondsPerSecond);
}

template <class Config>
Stamp hold_of(const Config& config) {
  return stamps_of("hold_s", config.hold_s);
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
template <class M>
void validate_together(const char* what, const std::vector<M>& messages) {
  for (const M& message : messages) {
    validate(message);
    if (message.stamp != messages.front().stamp) {
      throw std::invalid_argument(std::string(what) + " have stamps " +
                                  std::to_string(messages.front().stamp) + " and " +
                                  std::to_string(message.stamp) + " ns, expected one stamp");
    }
  }
}

/// Throws std::invalid_argument if an estimate is asked for before the belief.
inline void check_not_before(Stamp belief, Stamp stamp) {
  if (stamp < belief) {
    throw std::invalid_argument("an estimate was asked for " + std::to_string(stamp) +
                                " ns, before the belief at " + std::to_string(belief) + " ns");
  }
}

/// Puts the first `Moving` of the `Rows` variables of a belief back, bit for bit, unless the
/// message that they were moved for was fused: a motion changes no more than the rows and columns
/// of what moves. That is the pose, or all there is (Eigen::Dynamic).
template <int Rows, int Moving = 3>
class Transaction {
 public:
  Transaction(GaussianBelief& belief, Stamp until)
      : belief_(until > belief.stamp ? &belief : nullptr), stamp_(belief.stamp) {
    if (belief_ != nullptr) {
      const Eigen::Index moving = moving_of(belief);
      x_ = belief.x.template head<Moving>(moving);
      P_ = belief.P.template leftCols<Moving>(moving);
    }
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  ~Transaction() {
    if (belief_ != nullptr) {
      const Eigen::Index moving = moving_of(*belief_);
      belief_->stamp = stamp_;
      belief_->x.template head<Moving>(moving) = x_;
      belief_->P.template topRows<Moving>(moving) = P_.transpose();
      belief_->P.template leftCols<Moving>(moving) = P_;
    }
  }
  [[nodiscard]] Outcome close(const Outcome& outcome) {
    if (outcome.verdict == Verdict::kFused) {
      belief_ = nullptr;
    }
    return outcome;
  }

 private:
  static Eigen::Index moving_of(const GaussianBelief& belief) {
    return Moving == Eigen::Dynamic ? belief.dimension() : Moving;
  }

  GaussianBelief* belief_;
  Stamp stamp_;
  Vector<Moving> x_;
  Matrix<Rows, Moving> P_;
};

/// Moves the body and its belief's stamp.
inline void move(GaussianBelief& belief, Slot body, const OdometryMotion& model,
                 const Pose2& motion, Stamp stamp) {
  const double seconds = seconds_between(belief.stamp, stamp);
  predict(belief, model.propagate(belief.pose(body), motion, seconds), body);
  belief.stamp = stamp;
}

/// Carries a belief to `stamp` with what odometry says. Earlier stamps change nothing.
template <class Recipe>
void advance(const Recipe& recipe, const HeldMotion& odometry, Slot body, GaussianBelief& belief,
             Stamp stamp) {
  check_stamp(stamp);
  if (stamp <= belief.stamp) {
    return;
  }
  odometry.advance(
      belief.stamp, stamp, recipe.hold,
      [&](const Pose2& motion, Stamp until) { move(belief, body, recipe.motion, motion, until); },
      [&](Stamp until) { move(belief, body, recipe.lost, Pose2{}, until); });
}

/// Carries a belief of `Rows` variables to where a motion begins that holds from then on.
template <int Rows, class Recipe, class Motion>
Outcome take(const Recipe& recipe, HeldMotion& odometry, Slot body, GaussianBelief& belief,
             const Motion& u) {
  validate(u);
  if (u.stamp < belief.stamp) {
    return {Verdict::kStale};
  }
  Transaction<Rows> transaction(belief, u.stamp);
  if constexpr (std::is_same_v<Motion, Increment>) {
    advance(recipe, odometry, body, belief, u.begin);
    if (u.begin == u.stamp) {  // a displacement without duration
      move(belief, body, recipe.motion, u.motion, u.stamp);
    }
  } else {
    advance(recipe, odometry, body, belief, u.stamp);
  }
  odometry.take(u);
  return transaction.close({Verdict::kFused});
}

}  // namespace locfuse::internal
