// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <memory>
#include <variant>
#include <vector>

#include "locfuse/estimators/air_ekf.hpp"
#include "support/random.hpp"
#include "support/robot.hpp"

namespace locfuse::testing {

/// Four anchors, 0 to 3, in the corners of a hall, two of them on the floor.
[[nodiscard]] inline std::vector<Anchor> corners() {
  return {{0, {-10.0, -10.0, 0.2}},
          {1, {10.0, -10.0, 8.0}},
          {2, {10.0, 10.0, 0.4}},
          {3, {-10.0, 10.0, 7.0}}};
}

/// A lamp and a ball.
[[nodiscard]] inline std::vector<Landmark> beacons() {
  return {{0, {14.0, 3.0}, 0.0, 9.0}, {1, {-5.0, -16.0}, 0.0, 0.5}};
}

/// Odometry with a climb rate.
struct Driven {
  Increment motion;
  double climb_rate;
};

struct Flight {
  AirEstimate start;  ///< start of the filter
  std::vector<std::variant<Driven, Range, RangeBearing, Altitude>> messages;
  double x, y, heading, height;  ///< true pose at the end
};

/// One step of 0.05 s.
using Step = void (*)(Rng& rng, Flight& flight, Stamp begin, Stamp end, Vector<3>& velocity);

constexpr double kTwentieth = 0.05;  // [s]

/// The body moves by odometry plus noise; the velocity is not used.
inline void by_odometry(Rng& rng, Flight& flight, Stamp begin, Stamp end, Vector<3>& /*velocity*/) {
  const double ahead = 0.04;
  const double turn = 0.03;
  const double climb = 0.4 * std::cos(0.3 * static_cast<double>(end) * 1e-9);
  flight.x += ahead * std::cos(flight.heading);
  flight.y += ahead * std::sin(flight.heading);
  flight.heading += turn;
  flight.height += climb * kTwentieth + normal(rng, 0.1 * std::sqrt(kTwentieth));
  const double sigma_turn = std::sqrt(0.02 * 0.02 * ahead + 0.03 * 0.03 * turn);
  flight.messages.push_back(
      Driven{{begin,
              end,
              {ahead + normal(rng, 0.03 * std::sqrt(ahead)), normal(rng, 0.01 * std::sqrt(ahead)),
               turn + normal(rng, sigma_turn)}},
             climb});
}

/// Without odometry: white acceleration of 0.5 and, upwards, 0.3 m/s per sqrt(s), a heading
/// that walks by 0.2 rad per sqrt(s).
inline void by_itself(Rng& rng, Flight& flight, Stamp /*begin*/, Stamp /*end*/,
                      Vector<3>& velocity) {
  double* const place[] = {&flight.x, &flight.y, &flight.height};
  for (int axis = 0; axis < 3; ++axis) {
    const double sigma = axis == 2 ? 0.3 : 0.5;
    // Half of the displacement within the step is correlated with the velocity, the rest is new.
    const double kick = normal(rng, sigma * std::sqrt(kTwentieth));
    const double rest = normal(rng, sigma * std::sqrt(std::pow(kTwentieth, 3) / 12.0));
    *place[axis] += kTwentieth * (velocity(axis) + 0.5 * kick) + rest;
    velocity(axis) += kick;
  }
  flight.heading += normal(rng, 0.2 * std::sqrt(kTwentieth));
}

/// A flight of `seconds`: ranges to all corners at 4 Hz, an altitude and sightings at 1 Hz. In
/// plain scalars, independent of locfuse's models.
[[nodiscard]] inline Flight fly(std::uint64_t seed, double seconds, Step step) {
  Rng rng(seed);
  Flight flight;
  const Vector<4> sigma(0.2, 0.2, 0.05, 0.2);
  flight.start = {0, {2.0, -1.0, 0.4}, 3.0, sigma.cwiseAbs2().asDiagonal()};
  flight.x = 2.0 + normal(rng, sigma(0));
  flight.y = -1.0 + normal(rng, sigma(1));
  flight.heading = 0.4 + normal(rng, sigma(2));
  flight.height = 3.0 + normal(rng, sigma(3));
  Vector<3> velocity{normal(rng, 0.4), normal(rng, 0.4), normal(rng, 0.2)};
  const Stamp period = kSecond / 20;
  const Stamp steps = static_cast<Stamp>(seconds * 20.0);
  for (Stamp i = 1; i <= steps; ++i) {
    step(rng, flight, (i - 1) * period, i * period, velocity);
    if (i % 5 != 0) {
      continue;
    }
    const double c = std::cos(flight.heading);
    const double s = std::sin(flight.heading);
    const double tag_x = flight.x + 0.3 * c + 0.2 * s;
    const double tag_y = flight.y + 0.3 * s - 0.2 * c;
    for (const Anchor& a : corners()) {
      const double distance = std::hypot(tag_x - a.position.x(), tag_y - a.position.y(),
                                         flight.height - 0.1 - a.position.z());
      flight.messages.push_back(Range{i * period, 0, a.id, distance + normal(rng, 0.1), {}});
    }
    if (i % 20 != 0) {
      continue;
    }
    flight.messages.push_back(Altitude{i * period, flight.height + 0.05 + normal(rng, 0.2), 0.2});
    for (const Landmark& l : beacons()) {
      const double dx = l.position.x() - flight.x;
      const double dy = l.position.y() - flight.y;
      const double dz = l.height - (flight.height + 0.2);
      const double along = std::hypot(dx, dy);
      RangeBearing z;
      z.stamp = i * period;
      z.landmark = l.id;
      if (l.id == 0) {
        z.range = std::hypot(along, dz) + normal(rng, 0.1);
      }
      z.bearing = std::remainder(std::atan2(dy, dx) - flight.heading + normal(rng, 0.02),
                                 2.0 * std::acos(-1.0));
      z.elevation = std::atan2(dz, along) + normal(rng, 0.03);
      flight.messages.push_back(z);
    }
  }
  return flight;
}

/// A filter with the true noise of such flights, and without gates.
[[nodiscard]] inline AirEkf::Config well_informed(AirMotion motion) {
  AirEkf::Config config;
  config.motion = motion;
  config.odometry = {0.03, 0.01, 0.02, 0.03, 0.0, 0.0};
  config.sigma_height_per_sqrt_s = 0.1;
  config.constant_velocity = {0.5, 0.3, 0.2};
  config.sigma_start_velocity_mps = 0.4;
  config.sigma_start_climb_mps = 0.2;
  config.range.sigma_m = 0.1;
  config.altitude.altimeter_up_m = 0.05;
  config.landmark = {0.1, 0.02};
  config.landmark_in_space = {0.2, 0.03};
  config.range.gate = config.altitude.gate = config.landmark.gate = 1.0;
  return config;
}

[[nodiscard]] inline AirEkf air_ekf(const AirEkf::Config& config, const AirEstimate& start,
                                    std::vector<Anchor> anchors = corners()) {
  return {config,
          {std::make_shared<AnchorMap>(std::move(anchors)),
           {{0, {0.3, -0.2, -0.1}}},
           {std::make_shared<LandmarkMap>(beacons()), {}}},
          start};
}

inline Outcome feed(AirEkf& ekf, const Driven& driven) {
  return ekf.on(driven.motion, driven.climb_rate);
}
template <class Message>
Outcome feed(AirEkf& ekf, const Message& message) {
  return ekf.on(message);
}

}  // namespace locfuse::testing
