// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include "locfuse/messages/message.hpp"
#include "locfuse/replay/made_motion.hpp"

namespace locfuse {

/// Recorded messages in the order in which they arrived.
class MessageLog {
 public:
  struct Arrival {
    Stamp arrival;  ///< when the estimator receives it [ns]
    Message message;
  };

  /// Adds a message that arrives when it takes effect. Throws std::invalid_argument if not valid.
  void add(const Message& message) { add(message, effective_stamp(message)); }
  /// Adds a message that arrives at `arrival` [ns]. Throws std::invalid_argument if not valid.
  void add(const Message& message, Stamp arrival);

  /// Adds make(0) to make(rows - 1), each an Arrival. If one is not valid, adds none and throws
  /// std::invalid_argument with its row.
  template <class Make>
  void add_rows(std::size_t rows, const Make& make) {
    const std::size_t before = arrivals_.size();
    arrivals_.reserve(before + rows);
    for (std::size_t row = 0; row < rows; ++row) {
      try {
        const Arrival arrival = make(row);
        validate_in_space(arrival.message);
        arrivals_.push_back(arrival);
      } catch (const std::invalid_argument& error) {
        arrivals_.resize(before);
        throw std::invalid_argument("row " + std::to_string(row) + ": " + error.what());
      }
    }
  }

  /// Sorts by arrival; messages of equal arrival stay in the order in which they were added.
  void sort();

  [[nodiscard]] const std::vector<Arrival>& arrivals() const { return arrivals_; }
  /// For each message whether a later one is in place of it, (n,); empty if that is so for none.
  [[nodiscard]] std::vector<bool> replaced() const;
  /// The motions that one message changed, which arrive together from `begin` on; empty if nothing
  /// was made of the message there.
  [[nodiscard]] std::vector<MadeMotion> motions_from(std::size_t begin) const;

 private:
  std::vector<Arrival> arrivals_;
};

}  // namespace locfuse
