// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "locfuse/estimators/recovering_ekf.hpp"
#include "locfuse/replay/start.hpp"
#include "locfuse/replay/timeline.hpp"

namespace locfuse {

/// A RecoveringEkf on a robot: messages as they arrive, from the first one on.
///
/// It searches with a StartSearch until one place is left; from there a Timeline fuses, late
/// messages where they belong. With the messages of a log in its order of arrival the estimates are
/// those of `find_start` and `replay`, bit for bit, if none came later than `patience` while it
/// searched.
class Live {
 public:
  struct Options {
    Stamp history = 2'000'000'000;  ///< how late a message may be once it tracks [ns]
    TimelineOptions timeline = {};
    Stamp patience = StartSearch::kPatience;  ///< likewise while it searches [ns]
  };

  /// Searches, or tracks if `estimator` has started. Throws std::invalid_argument on options out of
  /// range.
  explicit Live(RecoveringEkf estimator) : Live(std::move(estimator), Options{}) {}
  Live(RecoveringEkf estimator, const Options& options);

  /// What became of it: kIgnored while it searches and from a source that is off, kStale if it is
  /// too late. Throws std::invalid_argument for a message that is not valid, which is forgotten.
  Outcome on(const Message& message);
  /// Of use while it searches.
  void on(const LaserScan& scan);

  /// Tracks from `start` on, whatever was known before. Throws std::invalid_argument as PoseEkf.
  void start_at(const PoseEstimate& start);
  /// Forgets the pose and searches anew.
  void relocalize();
  /// As it was made.
  void reset();
  /// Switches a source off, or on again: while it is off its messages are kIgnored.
  void enable(Source source, bool enabled);

  [[nodiscard]] bool is_tracking() const { return timeline_.has_value(); }
  /// While it searches: one that has not started.
  [[nodiscard]] const RecoveringEkf& estimator() const {
    return timeline_ ? timeline_->estimator() : initial_;
  }
  /// While it searches: how far that has come.
  [[nodiscard]] const Initializer::State& search() const { return search_.state(); }
  /// How often the clock went back and it started anew or went on.
  [[nodiscard]] std::size_t jumps() const { return jumps_; }
  /// As of Timeline.
  [[nodiscard]] std::size_t fallen_out() const;

 private:
  Outcome track(const Message& message);
  void follow_clock();
  void look();
  void track_from(RecoveringEkf estimator);

  RecoveringEkf initial_;
  Options options_;
  StartSearch search_;
  std::optional<Timeline<RecoveringEkf>> timeline_;
  bool found_ = false;  // by the search: a clock that jumps begins another
  std::array<bool, kSources> disabled_{};
  std::size_t told_ = 0;  // to the timeline
  std::size_t late_in_a_row_ = 0;
  std::size_t jumps_ = 0;
  std::size_t jumps_seen_ = 0;  // of the timeline
  std::size_t fallen_out_ = 0;  // of timelines before
};

}  // namespace locfuse
