// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/messages/message.hpp"

namespace locfuse {

/// Recorded messages in the order in which they arrived.
class MessageLog {
 public:
  struct Arrival {
    Stamp arrival;  ///< when the estimator hears of it [ns]
    Message message;
  };

  /// Adds a message that arrives when it takes effect. Throws std::invalid_argument if not valid.
  void add(const Message& message) { add(message, effective_stamp(message)); }
  /// Adds a message that arrives at `arrival` [ns]. Throws std::invalid_argument if not valid.
  void add(const Message& message, Stamp arrival);

  void reserve(std::size_t n) { arrivals_.reserve(n); }

  /// Sorts by arrival; messages of one instant stay in the order in which they were added.
  void sort();

  [[nodiscard]] const std::vector<Arrival>& arrivals() const { return arrivals_; }

 private:
  std::vector<Arrival> arrivals_;
};

}  // namespace locfuse
