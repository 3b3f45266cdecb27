// SPDX-License-Identifier: Apache-2.0
#include "frontends/closest_beam.hpp"

#include <algorithm>
#include <cmath>

namespace locfuse::internal {
namespace {

/// Ranges over which the shortest is integrated, about the expected one [standard deviations].
constexpr double kReach = 6.0;
constexpr double kStep = 0.25;

struct Beam {
  double offset;  // [rad]
  double range;   // expected [m]
};

}  // namespace

Cone cone_of(double distance, double radius) {
  return {std::asin(radius / distance), distance - radius,
          std::sqrt(distance * distance - radius * radius)};
}

Matrix<2, 2> closest_beam_error(double distance, double radius, const std::vector<double>& offsets,
                                const BeamNoise& noise) {
  std::vector<Beam> beams;
  double shortest = distance;
  for (const double offset : offsets) {
    const double aside = distance * std::sin(offset);
    const double half = std::sqrt(std::max(radius * radius - aside * aside, 0.0));
    beams.push_back({offset, distance * std::cos(offset) - half});
    shortest = std::min(shortest, beams.back().range);
  }
  double weight = 0.0;
  Matrix<2, 2> error = Matrix<2, 2>::Zero();
  for (double at = -kReach; at <= kReach; at += kStep) {
    // Probability density of each beam to be the shortest, here: all others are longer.
    double longer = 1.0;
    double density = 0.0;
    double first = 0.0;
    double second = 0.0;
    for (const Beam& beam : beams) {
      const double z = at - (beam.range - shortest) / noise.range;
      const double survives = 0.5 * std::erfc(z / std::sqrt(2.0));
      if (z < -2.0 * kReach || survives <= 0.0) {
        longer *= survives;
        continue;
      }
      const double hazard = std::exp(-0.5 * z * z) / survives;
      longer *= survives;
      density += hazard;
      first += hazard * beam.offset;
      second += hazard * beam.offset * beam.offset;
    }
    const double off = shortest + at * noise.range - (distance - radius);
    weight += longer * density;
    error(0, 0) += longer * density * off * off;
    error(0, 1) += longer * first * off;
    error(1, 1) += longer * second;
  }
  error /= weight;
  error(1, 0) = error(0, 1);
  error(1, 1) += noise.bearing * noise.bearing;
  return error;
}

}  // namespace locfuse::internal
