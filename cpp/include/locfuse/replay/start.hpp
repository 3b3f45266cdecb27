// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <variant>
#include <vector>

#include "locfuse/recovery/initializer.hpp"
#include "locfuse/replay/clock_jump.hpp"
#include "locfuse/replay/made_motion.hpp"
#include "locfuse/replay/message_log.hpp"

namespace locfuse {

/// Feeds an Initializer in order of effective stamps, whatever order messages and scans arrive in.
///
/// Messages wait until one arrives that is `patience` newer: so an increment, which takes effect
/// at its begin but arrives at its end, precedes the ranges measured during it. At equal stamps
/// odometry comes first and scans last, and the Initializer's state is read once all messages of a
/// stamp are in. A message that the Initializer refuses is skipped. If the clock stands still,
/// kMaxWaiting messages of that stamp are used; later ones are late until it goes on.
class StartSearch {
 public:
  /// `patience` [ns]; 0 for messages in order. Throws std::invalid_argument if it is negative.
  explicit StartSearch(Initializer initializer, Stamp patience = kPatience);

  /// Throws std::invalid_argument for a message that is not valid. Late messages are skipped; once
  /// it is ready, messages only wait.
  void on(const Message& message);
  /// The same of the motions that one message changed, of an OdometryTimeline. Where one that was
  /// there before does not wait any more, all are skipped.
  void on(const std::vector<MadeMotion>& motions);
  /// Uses all messages that wait: the log has ended.
  void finish();

  /// Whether a message would be skipped as late.
  [[nodiscard]] bool is_late(const Message& message) const;
  [[nodiscard]] bool is_ready() const { return state_.status == StartStatus::kReady; }
  /// State of the Initializer when it was last read, and the stamp that was complete then [ns].
  [[nodiscard]] const Initializer::State& state() const { return state_; }
  [[nodiscard]] Stamp asked() const { return asked_; }
  /// Messages that take effect up to this stamp have been used [ns].
  [[nodiscard]] Stamp used_until() const { return used_until_; }
  [[nodiscard]] const Initializer& initializer() const { return initializer_; }
  /// Messages that have not been used, without scans, in order of arrival.
  [[nodiscard]] std::vector<internal::TimelineEntry> waiting() const;

  static constexpr Stamp kPatience = 250'000'000;
  static constexpr std::size_t kMaxWaiting = 10'000;

 private:
  using Entry = internal::TimelineEntry;

  void wait(Entry entry);
  void use_until(Stamp stamp);
  void use(const std::vector<Entry>& instant);

  Initializer initializer_;
  Stamp patience_;
  Initializer::State state_;
  Stamp newest_ = std::numeric_limits<Stamp>::min();
  Stamp used_until_ = std::numeric_limits<Stamp>::min();
  Stamp asked_ = std::numeric_limits<Stamp>::min();
  std::size_t arrivals_ = 0;
  std::vector<Entry> waiting_;  // sorted
};

/// Results of a search for the start.
struct StartRun {
  struct Step {
    Stamp stamp;
    Initializer::State state;
  };
  Stamp used_until = 0;     ///< messages that take effect up to this stamp were used [ns]
  std::vector<Step> steps;  ///< at each change of status or number of hypotheses
};

/// Feeds a log and scans, in order of stamps, until the initializer is ready or both end.
[[nodiscard]] StartRun find_start(Initializer& initializer, const MessageLog& log,
                                  const std::vector<LaserScan>& scans);

}  // namespace locfuse
