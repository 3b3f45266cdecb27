// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/start.hpp"
#include "locfuse/replay/timeline.hpp"

namespace locfuse {

/// A RecoveringEkf fed live, with messages as they arrive.
///
/// A StartSearch runs until a single hypothesis remains; from then on a Timeline fuses messages,
/// late ones where they belong. Fed with a log in order of arrival, the estimates equal those of
/// `find_start` and `replay`, bit for bit, if no message was later than `patience` during the
/// search.
class Live {
 public:
  struct Options {
    Stamp history = 2'000'000'000;  ///< how late a message may be while tracking [ns]
    TimelineOptions timeline = {};
    Stamp patience = StartSearch::kPatience;  ///< how late it may be during the search [ns]
  };

  /// Searches, or tracks if `estimator` has started. Throws std::invalid_argument on options out
  /// of range.
  explicit Live(RecoveringEkf estimator) : Live(std::move(estimator), Options{}) {}
  Live(RecoveringEkf estimator, const Options& options);

  /// Returns kIgnored during the search, for a source that is off and for a scan, which is of use
  /// to the search alone; kStale for a message that is too late. Throws std::invalid_argument for a
  /// message that is not valid, and forgets it.
  Outcome on(const Message& message);

  /// Takes the motions that one message changed, of an OdometryTimeline; returns what became of the
  /// first. Those that were made again are kStale where they are no longer in the history, or have
  /// been used by the search.
  Outcome on(const std::vector<MadeMotion>& motions);

  /// Tracks from `start` on and forgets what was known before. Throws std::invalid_argument as
  /// PoseEkf does.
  void start_at(const PoseEstimate& start);
  /// Forgets the pose and searches anew.
  void relocalize();
  /// Back to the state after construction.
  void reset();
  /// Switches a source off or on: while it is off its messages are kIgnored.
  void enable(Source source, bool enabled);

  [[nodiscard]] bool is_tracking() const { return timeline_.has_value(); }
  /// During the search one that has not started.
  [[nodiscard]] const RecoveringEkf& estimator() const {
    return timeline_ ? timeline_->estimator() : initial_;
  }
  /// State of the search.
  [[nodiscard]] const Initializer::State& search() const { return search_.state(); }
  /// Clock jumps after which it restarted or continued.
  [[nodiscard]] std::size_t jumps() const { return jumps_; }
  /// See Timeline::dropped_messages.
  [[nodiscard]] std::size_t dropped_messages() const;

 private:
  Outcome search_or_track(const Message& message);
  Outcome track(const Message& message);
  Outcome track(const std::vector<MadeMotion>& motions);
  template <class Call>
  Outcome track_by(std::size_t messages, const Call& call);
  void follow_clock();
  void check_search();
  void track_from(RecoveringEkf estimator);

  RecoveringEkf initial_;
  Options options_;
  StartSearch search_;
  std::optional<Timeline<RecoveringEkf>> timeline_;
  bool is_from_search_ = false;  // a clock jump then begins another search
  std::array<bool, kSources> disabled_{};
  std::size_t delivered_ = 0;  // messages to the timeline
  std::size_t consecutive_late_ = 0;
  std::size_t jumps_ = 0;
  std::size_t timeline_jumps_ = 0;    // counted in jumps_
  std::size_t dropped_messages_ = 0;  // of earlier timelines
};

}  // namespace locfuse
