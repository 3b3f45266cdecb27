// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <variant>
#include <vector>

#include "locfuse/estimators/initializer.hpp"
#include "locfuse/replay/message_log.hpp"

namespace locfuse {

/// Feeds an Initializer in order of effective stamps, whatever order messages and scans arrive in.
///
/// What arrives waits until something has come that is `patience` younger: so an increment, which
/// tells of a motion that has ended, is driven before the ranges that were taken on the way. At
/// equal stamps odometry comes first and scans last, and the Initializer is asked when all of a
/// stamp has been heard: what is of one instant belongs together. A message that the Initializer
/// cannot use is left out. Of a clock that stands kMostWaiting messages are used, and what comes
/// then is late until it goes on.
class StartSearch {
 public:
  /// `patience` [ns]; 0 for what comes in order. Throws std::invalid_argument if it is negative.
  explicit StartSearch(Initializer initializer, Stamp patience = kPatience);

  /// Throw std::invalid_argument for a message that is not valid. What comes after its turn is left
  /// out, and what comes when it is ready only waits.
  void on(const Message& message);
  void on(const LaserScan& scan);
  /// Nothing more comes: what waits is used.
  void finish();

  /// Whether a message would be left out since it comes after its turn.
  [[nodiscard]] bool is_late(const Message& message) const;
  [[nodiscard]] bool is_ready() const { return state_.status == StartStatus::kReady; }
  /// As it was when it was asked last, and after what stamp.
  [[nodiscard]] const Initializer::State& state() const { return state_; }
  [[nodiscard]] Stamp asked() const { return asked_; }
  /// What takes effect up to this stamp has been used.
  [[nodiscard]] Stamp used_until() const { return used_until_; }
  [[nodiscard]] const Initializer& initializer() const { return initializer_; }
  /// Messages that have not been used, in order of arrival.
  [[nodiscard]] std::vector<Message> waiting() const;

  static constexpr Stamp kPatience = 250'000'000;
  static constexpr std::size_t kMostWaiting = 10'000;

 private:
  struct Entry {
    Stamp stamp;
    std::size_t arrival;
    std::variant<Message, LaserScan> heard;
    [[nodiscard]] bool is_scan() const { return heard.index() == 1; }
    [[nodiscard]] int turn() const;  // among those of one stamp
    bool operator<(const Entry& other) const;
  };

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

/// How a start went.
struct StartRun {
  struct Step {
    Stamp stamp;
    Initializer::State state;
  };
  Stamp used_until = 0;     ///< messages that take effect up to this stamp were used
  std::vector<Step> steps;  ///< whenever status or number of hypotheses changed
};

/// Feeds a log and scans, in order of their stamps, until the initializer is ready or both end.
[[nodiscard]] StartRun find_start(Initializer& initializer, const MessageLog& log,
                                  const std::vector<LaserScan>& scans);

}  // namespace locfuse
