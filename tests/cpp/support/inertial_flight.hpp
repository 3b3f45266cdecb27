// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <vector>

#include "locfuse/estimators/air_ekf.hpp"
#include "support/flight.hpp"
#include "support/random.hpp"

namespace locfuse::testing {

/// A body that swings about in a hall and rolls, pitches and turns, as given functions of time: by
/// Eigen's rotations, independent of locfuse's.
class Swing {
 public:
  explicit Swing(Rng& rng) {
    for (int axis = 0; axis < 3; ++axis) {
      phase_(axis) = uniform(rng, 0.0, 6.28);
      turn_phase_(axis) = uniform(rng, 0.0, 6.28);
      frequency_(axis) = uniform(rng, 0.5, 1.2);
    }
    spin_ = uniform(rng, -0.6, 0.6);
  }

  [[nodiscard]] Vector<3> position(double t) const {
    Vector<3> p;
    for (int axis = 0; axis < 3; ++axis) {
      p(axis) = (axis < 2 ? 2.0 : 1.0) * std::sin(frequency_(axis) * t + phase_(axis));
    }
    return p + Vector<3>(1.0, -2.0, 3.0);
  }
  [[nodiscard]] Vector<3> velocity(double t) const {
    return (position(t + kStep) - position(t - kStep)) / (2.0 * kStep);
  }
  [[nodiscard]] Matrix<3, 3> attitude(double t) const {
    const double roll = 0.6 * std::sin(0.9 * t + turn_phase_(0));
    const double pitch = 0.5 * std::sin(0.7 * t + turn_phase_(1));
    const double yaw = turn_phase_(2) + spin_ * t;
    return (Eigen::AngleAxisd(yaw, Vector<3>::UnitZ()) *
            Eigen::AngleAxisd(pitch, Vector<3>::UnitY()) *
            Eigen::AngleAxisd(roll, Vector<3>::UnitX()))
        .toRotationMatrix();
  }
  /// Mean angular rate, in body, and specific force at a time.
  [[nodiscard]] Vector<3> rate(double t) const {
    const Eigen::AngleAxisd turn(
        Matrix<3, 3>(attitude(t - kStep).transpose() * attitude(t + kStep)));
    return turn.angle() * turn.axis() / (2.0 * kStep);
  }
  [[nodiscard]] Vector<3> force(double t) const {
    const Vector<3> acceleration =
        (position(t + kStep) - 2.0 * position(t) + position(t - kStep)) / (kStep * kStep);
    return attitude(t).transpose() * (acceleration + Vector<3>(0.0, 0.0, 9.80665));
  }

 private:
  static constexpr double kStep = 1e-3;
  Vector<3> phase_;
  Vector<3> turn_phase_;
  Vector<3> frequency_;
  double spin_;
};

/// How noisy its sensors are.
struct InertialNoise {
  double turn = 0.005;      ///< [rad / sqrt(s)]
  double velocity = 0.05;   ///< [m/s / sqrt(s)]
  double rate_bias = 0.01;  ///< [rad/s]
  double force_bias = 0.1;  ///< [m/s^2]
};

struct InertialFlight {
  AirEstimate start;
  std::vector<Message> messages;  ///< in order of stamps
  Swing swing;
};

/// A flight of `seconds`: the inertial sensor at 100 Hz, ranges to all corners at 5 Hz between its
/// samples, and at 1 Hz a fix, an altitude, the pose of another localizer and two sightings. The
/// first tenth of a second the body is held still, in its attitude.
[[nodiscard]] inline InertialFlight swing_about(std::uint64_t seed, double seconds,
                                                const InertialNoise& noise = {},
                                                bool has_all = true) {
  Rng rng(seed);
  Swing swing(rng);
  const auto vector_of = [&](double sigma) {
    return Vector<3>(normal(rng, sigma), normal(rng, sigma), normal(rng, sigma));
  };
  const Vector<3> rate_bias = vector_of(noise.rate_bias);
  const Vector<3> force_bias = vector_of(noise.force_bias);
  const Vector<4> sigma(0.2, 0.2, 0.1, 0.2);
  const Matrix<3, 3> R0 = swing.attitude(0.0);
  const Vector<3> p0 = swing.position(0.0);
  InertialFlight flight{{0, {}, 0.0, sigma.cwiseAbs2().asDiagonal()}, {}, swing};
  flight.start.pose = {p0.x() + normal(rng, 0.2), p0.y() + normal(rng, 0.2),
                       std::atan2(R0(1, 0), R0(0, 0)) + normal(rng, 0.1)};
  flight.start.height = p0.z() + normal(rng, 0.2);
  const Stamp tick = kSecond / 100;
  const double rate_sigma = noise.turn * 10.0;  // of a sample at 100 Hz
  const double force_sigma = noise.velocity * 10.0;
  for (Stamp i = 0; i <= static_cast<Stamp>(seconds * 100.0); ++i) {
    const double t = static_cast<double>(i) * 0.01;
    const Vector<3> still = R0.transpose() * Vector<3>(0.0, 0.0, 9.80665);
    flight.messages.push_back(Imu{
        i * tick, swing.rate(t) + rate_bias + vector_of(rate_sigma),
        (i == 0 ? still : swing.force(t)) + force_bias + vector_of(i == 0 ? 0.05 : force_sigma)});
    if (i % 20 != 10) {
      continue;
    }
    const Stamp stamp = i * tick + tick / 2;
    const double then = t + 0.005;
    const Vector<3> p = swing.position(then);
    const Matrix<3, 3> R = swing.attitude(then);
    const Vector<3> tag = p + R * Vector<3>(0.3, -0.2, -0.1);
    for (const Anchor& a : corners()) {
      flight.messages.push_back(
          Range{stamp, 0, a.id, (tag - a.position).norm() + normal(rng, 0.1), {}});
    }
    if (i % 100 != 50 || !has_all) {
      continue;
    }
    const Vector<3> antenna = p + R * Vector<3>(-0.4, 0.5, 0.0);
    flight.messages.push_back(
        PositionFix{stamp,
                    {antenna.x() + normal(rng, 0.3), antenna.y() + normal(rng, 0.3)},
                    0.09 * Matrix<2, 2>::Identity()});
    flight.messages.push_back(
        PoseObservation{stamp,
                        {p.x() + normal(rng, 0.3), p.y() + normal(rng, 0.3),
                         wrap_angle(std::atan2(R(1, 0), R(0, 0)) + normal(rng, 0.05))},
                        Vector<3>(0.09, 0.09, 0.0025).asDiagonal()});
    for (const Landmark& l : beacons()) {
      const Vector<3> seen =
          R.transpose() * (Vector<3>(l.position.x(), l.position.y(), l.height) - p) -
          Vector<3>(0.0, 0.0, 0.2);
      RangeBearing z;
      z.stamp = stamp;
      z.landmark = l.id;
      z.range = seen.norm() + normal(rng, 0.1);
      z.bearing = wrap_angle(std::atan2(seen.y(), seen.x()) + normal(rng, 0.02));
      z.elevation = std::atan2(seen.z(), seen.head<2>().norm()) + normal(rng, 0.03);
      flight.messages.push_back(z);
    }
    flight.messages.push_back(Altitude{stamp, (p + 0.05 * R.col(2)).z() + normal(rng, 0.2), 0.2});
  }
  return flight;
}

/// A filter with the true noise of such flights, without gates, whose errors are independent.
[[nodiscard]] inline AirEkf::Config inertial_config(const InertialNoise& noise = {}) {
  AirEkf::Config config = well_informed(AirMotion::kInertial);
  config.inertial.sigma_turn_per_sqrt_s = noise.turn;
  config.inertial.sigma_velocity_per_sqrt_s = noise.velocity;
  config.inertial.sigma_bias_radps = noise.rate_bias;
  config.inertial.sigma_bias_mps2 = noise.force_bias;
  config.inertial.sigma_scale = 1e-6;
  config.sigma_start_velocity_mps = 1.2;  // swings at 1 to 2.4 m/s
  config.sigma_start_climb_mps = 0.7;
  config.position.antenna_forward_m = -0.4;
  config.position.antenna_left_m = 0.5;
  config.position.gate = config.pose.gate = 1.0;
  config.correlation_s = 0.0;
  return config;
}

}  // namespace locfuse::testing
