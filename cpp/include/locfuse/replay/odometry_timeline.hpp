// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "locfuse/estimators/odometer.hpp"
#include "locfuse/replay/made_motion.hpp"
#include "locfuse/replay/message_log.hpp"
#include "locfuse/replay/timeline.hpp"

namespace locfuse {

/// Feeds an Odometer in order of stamps, whatever order messages arrive in, and says which motions
/// that makes, and makes again.
///
/// What only helps, such as a sample of a gyro, waits until a message that ends a motion has come
/// that far: a gyro with another clock than the wheels makes none of them late. After a late
/// message the motions from it on are made again; an estimator that takes them by a Timeline, Live
/// or LiveMcl then has, bit for bit, those of the sorted log.
class OdometryTimeline {
 public:
  /// `history` [ns] is how late a message may be. With ClockJump::kContinue the odometer starts
  /// anew after a jump. Throws std::invalid_argument as a Timeline.
  OdometryTimeline(const Odometer& odometer, Stamp history, TimelineOptions options = {});

  /// Takes the next message; returns what it changes, which holds until the next call: the motion
  /// that it ends, if it does, then those that are made again, in order of their stamps. Throws
  /// std::invalid_argument if the message is not valid, and forgets it.
  const std::vector<MadeMotion>& on(const Message& message);

  /// What became of the last message: kFused, kIgnored if it waits or is of no use, or kStale if it
  /// was too late.
  [[nodiscard]] const Outcome& outcome() const { return outcome_; }

 private:
  using Entry = internal::TimelineEntry;

  void help(const Entry& entry);
  [[nodiscard]] bool do_wheels_reach(Stamp stamp) const;
  void take_helpers(Stamp until);
  void feed(const Entry& entry);
  void note(std::size_t origin);
  void change(const MadeMotion& made);
  void forget_old();

  Timeline<Odometer> timeline_;
  Stamp history_;
  std::vector<Entry> samples_;  // of a gyro, which wait; sorted
  std::vector<Entry> wheels_;   // the same beside scans
  std::size_t arrivals_ = 0;
  std::size_t jumps_ = 0;
  Outcome outcome_;
  std::vector<MadeMotion> made_;  // those that may be made again, sorted by origin
  std::vector<MadeMotion> changed_;
};

/// A motion that is made of a log, and when.
struct ArrivedMotion {
  Stamp arrival;  ///< [ns]
  MadeMotion made;
};

/// What an OdometryTimeline makes of a log that is sorted by arrival.
[[nodiscard]] std::vector<ArrivedMotion> odometry_of(OdometryTimeline& timeline,
                                                     const MessageLog& log);

}  // namespace locfuse
