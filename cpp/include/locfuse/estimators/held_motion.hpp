// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/messages/limits.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// What odometry said last: a motion, or a velocity that holds until it says more.
class HeldMotion {
 public:
  /// No odometry yet: standing from `start` on, as far as anybody knows.
  explicit HeldMotion(Stamp start) : begin_(start), end_(start) {}

  /// Standing from `start` on, by the same odometry.
  [[nodiscard]] HeldMotion restarted(Stamp start) const {
    HeldMotion other(start);
    other.is_received_ = is_received_;
    return other;
  }

  /// Whether there ever was odometry. Without any there is nothing to hold.
  [[nodiscard]] bool is_received() const { return is_received_; }

  void take(const Velocity& u) {
    is_received_ = true;
    begin_ = end_ = u.stamp;
    motion_ = {u.forward, u.left, u.turn_rate};
    variance_.reset();
    is_velocity_ = true;
  }
  void take(const Increment& u, const Limits& limits) {
    is_received_ = true;
    begin_ = u.begin;
    end_ = u.stamp;
    motion_ = u.motion;
    variance_ = u.variance;
    is_velocity_ = false;
    const double seconds = seconds_between(begin_, end_);
    has_rate_ = motion_.position().norm() <= limits.speed_mps * seconds &&
                std::abs(motion_.heading) <= limits.turn_rate_radps * seconds && seconds > 0.0;
  }

  /// End of the last motion; of a velocity, when it was measured.
  [[nodiscard]] Stamp end() const { return end_; }

  /// The last velocity by odometry, in the body's frame per second; a displacement without
  /// duration, or in less time than `limits` allow, has no rate.
  [[nodiscard]] Pose2 rate() const {
    if (is_velocity_) {
      return motion_;
    }
    if (!has_rate_) {
      return {};
    }
    const Vector<3> twist = arc_twist(motion_) / seconds_between(begin_, end_);
    return {twist.x(), twist.y(), twist.z()};
  }

  /// Goes from `from` to `to`: drive(motion, until, variance) for the received motion, which is
  /// held for `hold` beyond its end, lost(until) for the rest.
  template <class Drive, class Lost>
  void advance(Stamp from, Stamp to, Stamp hold, const Drive& drive, const Lost& lost) const {
    const Stamp driven = std::min(to, end_ + hold);
    if (driven > from) {
      if (!is_velocity_ && from < end_ && driven > end_) {
        drive(motion(from, end_), end_, variance(from, end_));
        from = end_;
      }
      drive(motion(from, driven), driven, variance(from, driven));
      from = driven;
    }
    if (to > from) {
      lost(to);
    }
  }

 private:
  /// The share of the variance that the motion brought; beyond its end nobody measured it.
  [[nodiscard]] std::optional<Vector<3>> variance(Stamp from, Stamp to) const {
    if (!variance_ || to > end_ || begin_ == end_) {
      return std::nullopt;
    }
    return *variance_ * (seconds_between(from, to) / seconds_between(begin_, end_));
  }

  [[nodiscard]] Pose2 motion(Stamp from, Stamp to) const {
    if (is_velocity_) {
      const double seconds = seconds_between(from, to);
      return arc(motion_.x * seconds, motion_.y * seconds, motion_.heading * seconds);
    }
    if (from == begin_ && to == end_) {
      return motion_;
    }
    if (begin_ == end_ || (to > end_ && !has_rate_)) {
      return {};
    }
    return arc_share(motion_, seconds_between(from, to) / seconds_between(begin_, end_));
  }

  Stamp begin_;
  Stamp end_;     // of the last motion; of a held velocity: when it was measured
  Pose2 motion_;  // over begin to end; for a velocity per second
  std::optional<Vector<3>> variance_;  // over begin to end
  bool is_velocity_ = true;
  bool is_received_ = false;
  bool has_rate_ = false;  // of an increment: it may go on like that
};

}  // namespace locfuse
