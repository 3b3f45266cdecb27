// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/odometer.hpp"

#include <stdexcept>
#include <type_traits>
#include <variant>

namespace locfuse {
namespace {

int rank_at_stamp(const Message& message) {
  const Source source = source_of(message);
  return source == Source::kImu ? 0 : source == Source::kScans ? 2 : 1;
}

}  // namespace

Odometer::Odometer(const Config& config) {
  if (!config.scans && !config.gyro) {
    throw std::invalid_argument("Odometer.Config has neither scans nor gyro, expected one or both");
  }
  if (config.scans) {
    scans_.emplace(*config.scans);
  }
  if (config.gyro) {
    gyro_.emplace(*config.gyro);
  }
}

bool Odometer::precedes(const Message& a, const Message& b) {
  const int rank = rank_at_stamp(a);
  const int other_rank = rank_at_stamp(b);
  return rank != other_rank ? rank < other_rank : locfuse::precedes(a, b);
}

template <class Wheels>
void Odometer::drive(const Wheels& u) {
  if (scans_) {
    scans_->on(u);
  } else {
    made_ = gyro_->on(u);
  }
}

void Odometer::scan(const LaserScan& z) {
  if (!scans_) {
    return;
  }
  if (const std::optional<Increment> moved = scans_->on(z)) {
    made_ =
        gyro_ ? gyro_->on(*moved) : GyroOdometry::Motion{GyroOdometry::Verdict::kNoGyro, *moved};
  }
}

Outcome Odometer::on(const Message& message) {
  made_.reset();
  return std::visit(
      [this](const auto& m) -> Outcome {
        using M = std::decay_t<decltype(m)>;
        validate(m);
        if constexpr (std::is_same_v<M, Velocity> || std::is_same_v<M, Increment>) {
          drive(m);
        } else if constexpr (std::is_same_v<M, LaserScan>) {
          scan(m);
        } else if constexpr (std::is_same_v<M, Imu>) {
          if (gyro_) {
            gyro_->on(m);
          }
        } else {
          return {Verdict::kIgnored, Reason::kNotUsed};
        }
        return {Verdict::kFused};
      },
      message);
}

}  // namespace locfuse
