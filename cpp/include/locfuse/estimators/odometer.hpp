// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/estimators/gyro_odometry.hpp"
#include "locfuse/estimators/scan_drive.hpp"
#include "locfuse/filters/outcome.hpp"
#include "locfuse/messages/message.hpp"

namespace locfuse {

/// Makes the odometry of an estimator of what measures motion: of the wheels with a gyro, of a
/// laser's scans, or of both.
///
/// Feed messages in order of stamps; at equal ones samples of the gyro come first and scans last. A
/// value: copying it is a snapshot.
class Odometer {
 public:
  struct Config {
    std::optional<ScanDrive::Config> scans;    ///< wheels only show where each fit begins
    std::optional<GyroOdometry::Config> gyro;  ///< a turn is by the gyro, too
  };

  /// Throws std::invalid_argument on a setting out of bounds, or if it has neither.
  explicit Odometer(const Config& config);

  /// kFused, or kIgnored for a kind that it does not take. Throws std::invalid_argument if the
  /// message is not valid.
  Outcome on(const Message& message);
  /// The motion that the last message ended, if it did.
  [[nodiscard]] const std::optional<GyroOdometry::Motion>& made() const { return made_; }

  /// Whether a message may end a motion: a scan where scans make the odometry, else one of wheels.
  /// The others only help, and a Timeline does not follow their clocks.
  [[nodiscard]] bool leads(const Message& message) const {
    return source_of(message) == (scans_ ? Source::kScans : Source::kOdometry);
  }

  /// How a Timeline feeds it.
  static constexpr bool kInOrderOfStamps = true;
  /// The order at one stamp.
  [[nodiscard]] static bool precedes(const Message& a, const Message& b);
  /// Whether a Timeline keeps a snapshot after this message, as it would cost to fuse it again.
  [[nodiscard]] static bool is_costly(const Message& message) {
    return std::holds_alternative<LaserScan>(message);
  }

 private:
  template <class Wheels>
  void drive(const Wheels& u);
  void scan(const LaserScan& z);

  std::optional<ScanDrive> scans_;
  std::optional<GyroOdometry> gyro_;
  std::optional<GyroOdometry::Motion> made_;
};

}  // namespace locfuse
