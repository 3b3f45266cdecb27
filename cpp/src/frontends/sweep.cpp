// SPDX-License-Identifier: Apache-2.0
#include "frontends/sweep.hpp"

#include <algorithm>
#include <cmath>

#include "frontends/beams.hpp"
#include "locfuse/math/angle.hpp"

namespace locfuse::internal {
namespace {

// Maximum number of beams of a turn, and the deviation of a closed turn from 2 pi [steps].
constexpr double kMaxBeamsAround = 1e6;
constexpr double kMaxClosureSteps = 0.1;

/// Number of beams of a full turn; 0 if the step does not divide it.
std::size_t beams_around(double step) {
  const double beams = std::round(2.0 * kPi / step);
  return beams < kMaxBeamsAround && std::abs(beams * step - 2.0 * kPi) < kMaxClosureSteps * step
             ? static_cast<std::size_t>(beams)
             : 0;
}

void begin_after_an_edge(Sweep& sweep, const Jump& jump) {
  for (int j = 0; j < sweep.size(); ++j) {
    if (is_edge(sweep, j, jump)) {
      std::rotate(sweep.rays.begin(), sweep.rays.begin() + (j + 1) % sweep.size(),
                  sweep.rays.end());
      return;
    }
  }
}

/// Sets the directions of all beams.
void aim(std::vector<Ray>& rays, const LaserGeometry& geometry) {
  const double turn_c = std::cos(geometry.angle_increment);
  const double turn_s = std::sin(geometry.angle_increment);
  Vector<2> along(1.0, 0.0);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (i % kExactDirections == 0) {
      const double angle = geometry.angle_min + static_cast<double>(i) * geometry.angle_increment;
      along << std::cos(angle), std::sin(angle);
    }
    rays[i].along = along;
    along =
        Vector<2>(along.x() * turn_c - along.y() * turn_s, along.y() * turn_c + along.x() * turn_s);
  }
}

}  // namespace

bool is_edge(const Sweep& sweep, int j, const Jump& jump) {
  if (!sweep.has(j + 1)) {
    return true;
  }
  const Ray& a = sweep[j];
  const Ray& b = sweep[j + 1];
  const double step = jump.range + jump.gaps * sweep.step * std::min(a.range, b.range);
  return !(std::abs(a.range - b.range) <= step) || a.bright != b.bright;  // NaN is an edge
}

Sweep sweep_of(const LaserScan& scan, double min_intensity, const Jump& jump) {
  validate(scan);
  const LaserGeometry& geometry = *scan.geometry;
  Sweep sweep;
  sweep.step = std::abs(geometry.angle_increment);
  const std::size_t around = beams_around(sweep.step);
  sweep.closed = around > 0 && scan.ranges.size() >= around;
  sweep.rays.resize(sweep.closed ? around : scan.ranges.size());
  aim(sweep.rays, geometry);
  for (std::size_t i = 0; i < sweep.rays.size(); ++i) {
    const double range = scan.ranges[i];
    const bool returned = range > 0.0 && geometry.is_return(range);
    sweep.rays[i].range = returned ? range : std::nan("");
    sweep.rays[i].beam = static_cast<int>(i);
    sweep.rays[i].bright = min_intensity > 0.0 && returned && scan.intensities[i] >= min_intensity;
  }
  if (geometry.angle_increment < 0.0) {
    std::reverse(sweep.rays.begin(), sweep.rays.end());
  }
  if (sweep.closed) {
    begin_after_an_edge(sweep, jump);
  }
  return sweep;
}

}  // namespace locfuse::internal
