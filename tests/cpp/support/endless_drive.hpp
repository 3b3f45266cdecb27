// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "locfuse/recovery/recovering_ekf.hpp"
#include "locfuse/replay/timeline.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

#ifdef __has_feature
#define LOCFUSE_ADDRESS_SANITIZER __has_feature(address_sanitizer)  // Clang
#elif defined(__SANITIZE_ADDRESS__)
#define LOCFUSE_ADDRESS_SANITIZER 1  // GCC
#else
#define LOCFUSE_ADDRESS_SANITIZER 0
#endif

#if LOCFUSE_ADDRESS_SANITIZER
// Of sanitizer/allocator_interface.h, which GCC does not install.
extern "C" std::size_t __sanitizer_get_current_allocated_bytes();
#endif

namespace locfuse::testing {

/// Bytes of the heap in use.
[[nodiscard]] inline std::size_t held_bytes() {
#if LOCFUSE_ADDRESS_SANITIZER
  return __sanitizer_get_current_allocated_bytes();
#elif __GLIBC_PREREQ(2, 33)
  const struct mallinfo2 heap = mallinfo2();
  return heap.uordblks + heap.hblkhd;
#else
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"  // its successor is not there yet
  const struct mallinfo heap = mallinfo();
#pragma GCC diagnostic pop
  return static_cast<std::size_t>(heap.uordblks) + static_cast<std::size_t>(heap.hblkhd);
#endif
}

/// A robot that circles in the hall without end: odometry at 100 Hz, ranges to four anchors at 10
/// Hz each, a fix per second. Some ranges are too long, some fixes far off, one range in 100 is 0.3
/// s late, one in 1000 later than any history. There is only odometry for 5 s every five minutes,
/// and for 75 s every `round`, during which the robot is kidnapped to the other side of the hall.
class EndlessDrive {
 public:
  /// It is kidnapped every `round` [s].
  explicit EndlessDrive(std::uint64_t seed, double round = 1800.0) : rng_(seed), round_(round) {}

  [[nodiscard]] static PoseEstimate start() {
    return {0, {kRadius, 0.0, 0.5 * kPi}, Vector<3>(0.01, 0.01, 0.0025).asDiagonal()};
  }

  [[nodiscard]] double seconds() const { return 0.01 * static_cast<double>(step_); }
  [[nodiscard]] Pose2 truth() const { return pose_at(seconds()); }
  [[nodiscard]] bool is_blackout() const {
    const double now = seconds();
    return std::fmod(now, 300.0) > 295.0 || std::fmod(now, round_) > round_ - 75.0;
  }
  /// Whether there is aid, and the last kidnapping was half a minute ago.
  [[nodiscard]] bool is_known() const {
    return !is_blackout() && (seconds() < round_ || std::fmod(seconds(), round_) > 30.0);
  }

  /// Advances by 10 ms: each message that arrives is passed to `take`.
  template <class Take>
  void step(const Take& take) {
    ++step_;
    const Stamp stamp = step_ * (kSecond / 100);
    take(Message(Velocity{stamp, kSpeed * (1.0 + normal(rng_, 0.02)),
                          kSpeed / kRadius + normal(rng_, 0.002)}));
    if (step_ % 2 == 0 && step_ % 10 < 8 && !is_blackout()) {
      range(static_cast<Id>(step_ % 10 / 2), stamp, take);
    }
    if (step_ % 100 == 50 && !is_blackout()) {
      PositionFix fix{stamp, truth().position(), 0.09 * Matrix<2, 2>::Identity(), {}};
      const double far = uniform(rng_, 0.0, 1.0) < 0.01 ? 30.0 : 0.0;
      fix.position += Vector<2>{far + normal(rng_, 0.3), normal(rng_, 0.3)};
      take(Message(fix));
    }
    for (std::size_t i = 0; i < delayed_.size(); ++i) {
      if (delayed_[i].arrival <= stamp) {
        take(Message(delayed_[i].range));
        delayed_.erase(delayed_.begin() + static_cast<std::ptrdiff_t>(i));
        --i;
      }
    }
  }

 private:
  static constexpr double kRadius = 6.0;  // [m]
  static constexpr double kSpeed = 0.8;   // [m/s]

  struct Delayed {
    Stamp arrival;
    Range range;
  };

  [[nodiscard]] Pose2 pose_at(double seconds) const {
    const double phase = kSpeed / kRadius * seconds + kPi * std::floor(seconds / round_);
    return {kRadius * std::cos(phase), kRadius * std::sin(phase), wrap_angle(phase + 0.5 * kPi)};
  }

  template <class Take>
  void range(Id anchor, Stamp stamp, const Take& take) {
    const double reflected = uniform(rng_, 0.0, 1.0) < 0.03 ? uniform(rng_, 0.5, 8.0) : 0.0;
    const Range z = range_to(anchor, truth(), stamp, normal(rng_, 0.1) + reflected);
    const double chance = uniform(rng_, 0.0, 1.0);
    if (chance < 0.011) {
      delayed_.push_back({stamp + (chance < 0.001 ? 5 * kSecond : 3 * kSecond / 10), z});
    } else {
      take(Message(z));
    }
  }

  Rng rng_;
  double round_;
  Stamp step_ = 0;
  std::vector<Delayed> delayed_;
};

/// Settings for an endless drive: a second of history, and relocalization after a blackout.
[[nodiscard]] inline Timeline<RecoveringEkf> endless_timeline(Stamp history = kSecond) {
  RecoveringEkf::Config config;
  config.start.estimator.range.noise = NoiseKind::kOneSided;
  RecoveringEkf robot(config, {hall(), one_tag()});
  robot.start_at(EndlessDrive::start());
  return Timeline<RecoveringEkf>(robot, history);
}

}  // namespace locfuse::testing
