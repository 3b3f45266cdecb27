// SPDX-License-Identifier: Apache-2.0
#include "locfuse/replay/odometry_timeline.hpp"

#include <algorithm>

namespace locfuse {
namespace {

constexpr std::size_t kMinForgotten = 256;  // motions that are forgotten at a time

TimelineOptions anew_after_a_jump(TimelineOptions options) {
  if (options.clock_jump == ClockJump::kContinue) {
    options.clock_jump = ClockJump::kReset;
  }
  return options;
}

bool are_same(const Increment& a, const Increment& b) {
  return a.begin == b.begin && a.stamp == b.stamp && a.motion.x == b.motion.x &&
         a.motion.y == b.motion.y && a.motion.heading == b.motion.heading &&
         a.variance == b.variance;
}

}  // namespace

OdometryTimeline::OdometryTimeline(const Odometer& odometer, Stamp history, TimelineOptions options)
    : timeline_(odometer, history, anew_after_a_jump(options)), history_(history) {}

const std::vector<MadeMotion>& OdometryTimeline::on(const Message& message) {
  changed_.clear();
  const std::size_t index_of_message = arrivals_++;
  timeline_.on(message, [&](std::size_t index, const Outcome& outcome) {
    if (index == index_of_message) {
      outcome_ = outcome;
    }
    if (outcome.verdict == Verdict::kFused) {
      note(index);
    }
  });
  forget_old();
  return changed_;
}

/// Notes the motion that the odometer has just made, unless it is what it was.
void OdometryTimeline::note(std::size_t origin) {
  if (timeline_.jumps() > jumps_) {
    jumps_ = timeline_.jumps();
    made_.clear();
  }
  const auto& motion = timeline_.estimator().made();
  if (!motion) {
    return;
  }
  MadeMotion made{origin, false, motion->verdict == GyroOdometry::Verdict::kSlipped,
                  motion->increment};
  const auto place = std::lower_bound(
      made_.begin(), made_.end(), origin,
      [](const MadeMotion& before, std::size_t number) { return before.origin < number; });
  if (place == made_.end() || place->origin != origin) {
    made_.insert(place, made);
    changed_.push_back(made);
  } else if (!are_same(place->increment, made.increment) || place->slipped != made.slipped) {
    *place = made;
    made.again = true;
    changed_.push_back(made);
  }
}

/// Forgets what no message in the history can change any more.
void OdometryTimeline::forget_old() {
  if (made_.size() < 2 * kMinForgotten) {
    return;
  }
  const Stamp horizon = timeline_.newest() - history_;
  const auto first = std::find_if(made_.begin(), made_.end(), [&](const MadeMotion& made) {
    return made.increment.stamp >= horizon;
  });
  if (first - made_.begin() >= static_cast<std::ptrdiff_t>(kMinForgotten)) {
    made_.erase(made_.begin(), first);
  }
}

std::vector<ArrivedMotion> odometry_of(OdometryTimeline& timeline, const MessageLog& log) {
  std::vector<ArrivedMotion> motions;
  for (const MessageLog::Arrival& arrival : log.arrivals()) {
    for (const MadeMotion& made : timeline.on(arrival.message)) {
      motions.push_back({arrival.arrival, made});
    }
  }
  return motions;
}

}  // namespace locfuse
