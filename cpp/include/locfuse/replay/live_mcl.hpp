// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "locfuse/particles/mcl.hpp"
#include "locfuse/particles/switching_mcl.hpp"
#include "locfuse/replay/timeline.hpp"

namespace locfuse {

/// An Mcl, or a SwitchingMcl, fed live, with messages and scans as they arrive.
///
/// What arrives waits until odometry has come that far, or for kPatience: then a scan finds the
/// motion up to it. Scans come when their turn is over, which odometry does not wait for: so all
/// wait as long as the latest of the last kRecentScans scans, up to `history`. What comes later
/// still is fused where it belongs by a Timeline, to the same bits as if it had been in time.
class LiveMcl {
 public:
  struct Options {
    Stamp history = 2'000'000'000;  ///< how late a message may be [ns]
    TimelineOptions timeline = {};
  };

  /// What becomes of what arrives. Either may be empty.
  struct Observer {
    /// Outcome of a message, by its place among all that arrived; again where a late one before it
    /// has changed it.
    std::function<void(std::size_t, const Outcome&)> fused;
    /// A scan has taken its turn: the estimate is as it leaves it.
    std::function<void(const LaserScan&, const Outcome&)> scanned;
  };

  /// Throws std::invalid_argument if options are out of range.
  explicit LiveMcl(Mcl mcl) : LiveMcl(std::move(mcl), Options{}) {}
  LiveMcl(Mcl mcl, const Options& options);
  explicit LiveMcl(SwitchingMcl mcl) : LiveMcl(std::move(mcl), Options{}) {}
  LiveMcl(SwitchingMcl mcl, const Options& options);

  /// Throws std::invalid_argument for a message that is not valid, and forgets it.
  void on(const Message& message, const Observer& observer = {});
  /// Takes the motions that one message changed, of an OdometryTimeline. Where one that was there
  /// before is no longer in the history, nothing changes, and all are kStale.
  void on(const std::vector<MadeMotion>& motions, const Observer& observer = {});
  /// Gives all that waits its turn: nothing more arrives.
  void finish(const Observer& observer = {});
  /// Takes what waits for its turn in another, whose pose this one has.
  void go_on_from(const LiveMcl& before, const Observer& observer = {});

  /// How many have arrived, and how many of them wait for their turn.
  [[nodiscard]] std::size_t arrivals() const { return arrivals_; }
  [[nodiscard]] std::size_t waiting() const { return waiting_.size(); }

  /// Estimate of the particles, carried to where odometry ends.
  [[nodiscard]] PoseEstimate estimate() const { return mcl().estimate(); }
  [[nodiscard]] const Mcl& mcl() const;
  /// Null if UWB takes no part.
  [[nodiscard]] const SwitchingMcl* switching() const;
  /// Clock jumps after which it restarted or continued.
  [[nodiscard]] std::size_t jumps() const;
  /// See Timeline::dropped_messages.
  [[nodiscard]] std::size_t dropped_messages() const;

  static constexpr Stamp kPatience = 250'000'000;

 private:
  static constexpr std::size_t kRecentScans = 20;
  static constexpr std::size_t kMaxWaiting = 10'000;

  using Entry = internal::TimelineEntry;

  void take(Entry entry, const Observer& observer);
  [[nodiscard]] const Increment* find_fused(std::size_t origin) const;
  template <class Call>
  Outcome fuse_by(std::size_t index, const Observer& observer, const Call& call);
  void watch_time(const Message& message, Stamp stamp);
  [[nodiscard]] Stamp lateness() const;
  [[nodiscard]] Stamp due() const;
  void take_turns(Stamp until, const Observer& observer);
  void fuse(const Entry& entry, const Observer& observer);
  void follow_clock(std::size_t jumps_before, std::size_t index);
  [[nodiscard]] Stamp newest_fused() const;

  std::variant<Timeline<Mcl>, Timeline<SwitchingMcl>> timeline_;
  Stamp history_;
  std::vector<Entry> waiting_;  // sorted
  std::size_t arrivals_ = 0;
  Stamp newest_ = std::numeric_limits<Stamp>::min();
  std::optional<Stamp> odometry_end_;           // of the newest motion
  std::optional<Stamp> odometry_begin_;         // where it begins
  std::array<Stamp, kRecentScans> lateness_{};  // of the last scans behind that
  std::size_t scans_ = 0;                       // of which the lateness is known
};

}  // namespace locfuse
