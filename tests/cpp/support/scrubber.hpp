// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "locfuse/estimators/tag_triangle_ekf.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::testing {

/// A floor scrubber with three tags drives eights, as in celan2017: odometry at 7.5 Hz, fixes of
/// all tags at 1 Hz. In plain scalars, independent of locfuse's poses and models.
struct Scrubber {
  static constexpr double kTagX[3] = {0.6, -0.45, -0.45};
  static constexpr double kTagY[3] = {0.0, 0.25, -0.25};

  double sigma_fix = 0.15;           ///< [m]
  double sigma_forward = 0.02;       ///< [m/s], each message
  double sigma_turn_rate = 0.02;     ///< [rad/s]
  double sigma_start_xy = 0.1;       ///< [m]
  double sigma_start_heading = 0.1;  ///< [rad]

  std::vector<Message> messages = {};  ///< in order of stamp
  PoseEstimate start = {};             ///< start of the filter
  double x = 0.0;                      ///< true pose at the end
  double y = 0.0;
  double heading = 0.0;
  std::vector<std::array<double, 4>> truth = {};  ///< stamp [ns], x, y, heading after each message
};

[[nodiscard]] inline std::vector<Tag> triangle() {
  std::vector<Tag> tags;
  for (int i = 0; i < 3; ++i) {
    tags.push_back({10 + i, {Scrubber::kTagX[i], Scrubber::kTagY[i], 1.0}});
  }
  return tags;
}

inline void drive(Scrubber& run, std::uint64_t seed, double seconds) {
  Rng rng(seed);
  const double xy = run.sigma_start_xy;
  const double turned = run.sigma_start_heading;
  run.start = {0, {3.0, 4.0, 0.3}, Vector<3>(xy * xy, xy * xy, turned * turned).asDiagonal()};
  run.x = 3.0 + normal(rng, xy);
  run.y = 4.0 + normal(rng, xy);
  run.heading = 0.3 + normal(rng, turned);
  const auto note = [&](const Message& message) {
    run.messages.push_back(message);
    run.truth.push_back(
        {static_cast<double>(stamp_of(message)), run.x, run.y, wrap_angle(run.heading)});
  };
  constexpr double kRate = 7.5;
  Stamp now = 0;
  for (int step = 1; step <= static_cast<int>(seconds * kRate); ++step) {
    const Stamp next = static_cast<Stamp>(std::llround(1e9 * step / kRate));
    const double T = 1e-9 * static_cast<double>(next - now);
    now = next;
    const double forward = 0.33 + 0.1 * std::sin(0.3 * step / kRate);
    const double turn_rate = 0.25 * std::sin(0.2 * step / kRate);
    constexpr int kFine = 20;
    for (int i = 0; i < kFine; ++i) {
      run.x += forward * T / kFine * std::cos(run.heading + 0.5 * turn_rate * T / kFine);
      run.y += forward * T / kFine * std::sin(run.heading + 0.5 * turn_rate * T / kFine);
      run.heading += turn_rate * T / kFine;
    }
    note(Velocity{now, forward + normal(rng, run.sigma_forward),
                  turn_rate + normal(rng, run.sigma_turn_rate)});
    if (step % 15 != 0 && step % 15 != 7) {
      continue;
    }
    for (int i = 0; i < 3; ++i) {
      const double c = std::cos(run.heading);
      const double s = std::sin(run.heading);
      PositionFix z;
      z.stamp = now;
      z.tag = 10 + i;
      z.position.x() = run.x + c * Scrubber::kTagX[i] - s * Scrubber::kTagY[i];
      z.position.y() = run.y + s * Scrubber::kTagX[i] + c * Scrubber::kTagY[i];
      z.position += Vector<2>{normal(rng, run.sigma_fix), normal(rng, run.sigma_fix)};
      z.covariance = run.sigma_fix * run.sigma_fix * Matrix<2, 2>::Identity();
      note(z);
    }
  }
}

}  // namespace locfuse::testing
