// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

#include "locfuse/messages/message.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::testing {

/// True noise.
struct SimulatedNoise {
  double range = 0.1;             ///< [m]
  double longitudinal = 0.03;     ///< [m / sqrt(m)]
  double lateral = 0.01;          ///< [m / sqrt(m)]
  double heading_per_m = 0.02;    ///< [rad / sqrt(m)]
  double heading_per_rad = 0.03;  ///< [rad / sqrt(rad)]
  double start_xy = 0.1;          ///< [m]
  double start_heading = 0.05;    ///< [rad]
};

struct Simulation {
  PoseEstimate start;             ///< start of the filter
  std::vector<Message> messages;  ///< in order of effective stamp
  double x;                       ///< true pose at the end
  double y;
  double heading;
};

/// A robot winds through the hall for `seconds`: increments at 20 Hz, ranges to all anchors at 5
/// Hz. In plain scalars, independent of locfuse's poses and models.
[[nodiscard]] inline Simulation simulate(std::uint64_t seed, double seconds,
                                         const SimulatedNoise& noise = {}) {
  constexpr double kAnchors[4][3] = {
      {-10.0, -10.0, 2.0}, {10.0, -10.0, 3.0}, {10.0, 10.0, 2.5}, {-10.0, 10.0, 2.0}};
  Rng rng(seed);
  Simulation run;
  run.x = 2.0 + normal(rng, noise.start_xy);
  run.y = -1.0 + normal(rng, noise.start_xy);
  run.heading = 0.4 + normal(rng, noise.start_heading);
  const double start_variance = noise.start_xy * noise.start_xy;
  const Vector<3> variances(start_variance, start_variance,
                            noise.start_heading * noise.start_heading);
  run.start = {0, {2.0, -1.0, 0.4}, variances.asDiagonal()};
  const Stamp step = kSecond / 20;
  const Stamp steps = static_cast<Stamp>(seconds * 20.0);
  for (Stamp i = 0; i < steps; ++i) {
    const double distance = 0.04;
    const double turn = 0.03 + 0.03 * std::sin(0.05 * static_cast<double>(i));
    // It drives along its heading, then turns; odometry adds noise.
    run.x += distance * std::cos(run.heading);
    run.y += distance * std::sin(run.heading);
    run.heading += turn;
    const double heading_sigma = std::sqrt(noise.heading_per_m * noise.heading_per_m * distance +
                                           noise.heading_per_rad * noise.heading_per_rad * turn);
    run.messages.push_back(Increment{
        i * step,
        (i + 1) * step,
        {distance + normal(rng, noise.longitudinal * std::sqrt(distance)),
         normal(rng, noise.lateral * std::sqrt(distance)), turn + normal(rng, heading_sigma)}});
    if (i % 4 != 3) {
      continue;
    }
    const double tag_x = run.x + 0.3 * std::cos(run.heading) + 0.2 * std::sin(run.heading);
    const double tag_y = run.y + 0.3 * std::sin(run.heading) - 0.2 * std::cos(run.heading);
    for (Id anchor = 0; anchor < 4; ++anchor) {
      const double* a = kAnchors[anchor];
      const double distance_to = std::hypot(tag_x - a[0], tag_y - a[1], 1.0 - a[2]);
      run.messages.push_back(
          Range{(i + 1) * step, 0, anchor, distance_to + normal(rng, noise.range), {}});
    }
  }
  return run;
}

}  // namespace locfuse::testing
