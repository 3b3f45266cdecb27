// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/single_beam_landmarks.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

#include "frontends/closest_beam.hpp"
#include "locfuse/math/angle.hpp"

namespace locfuse {
namespace {

void require_radius(double radius) {
  if (!std::isfinite(radius) || radius < 0.0) {
    std::ostringstream text;
    text << "radius of a landmark is " << radius << " m, expected a finite number >= 0";
    throw std::invalid_argument(text.str());
  }
}

void require_finite(const char* what, double x, double y, double heading) {
  if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(heading)) {
    std::ostringstream text;
    text << what << " is (" << x << ", " << y << ", " << heading << "), expected finite numbers";
    throw std::invalid_argument(text.str());
  }
}

void require_beam(const char* what, int beam, int beams) {
  if (beam < 0 || beam >= beams) {
    throw std::invalid_argument(std::string(what) + " is beam " + std::to_string(beam) +
                                ", expected one of the " + std::to_string(beams) + " of the scan");
  }
}

/// A beam of a scan; its range is -1 without return.
BeamLandmark beam_of(const LaserScan& scan, int beam) {
  const LaserGeometry& geometry = *scan.geometry;
  const double range = scan.ranges[static_cast<std::size_t>(beam)];
  return {beam, geometry.is_return(range) ? range : -1.0,
          wrap_angle(geometry.angle_min + beam * geometry.angle_increment)};
}

void keep_nearer(BeamLandmark& nearest, const BeamLandmark& beam) {
  if (beam.range >= 0.0 && (nearest.beam < 0 || beam.range < nearest.range)) {
    nearest = beam;
  }
}

BeamLandmark recognize(const LaserScan& scan, const Pose2& laser, const Landmark& landmark) {
  const Vector<2> to = inverse(laser).act(landmark.position);
  const double distance = to.norm();
  if (distance <= landmark.radius) {
    return {};
  }
  const double bearing = std::atan2(to.y(), to.x());
  const internal::Cone cone = internal::cone_of(distance, landmark.radius);
  BeamLandmark nearest;
  for (int i = 0; i < static_cast<int>(scan.ranges.size()); ++i) {
    const BeamLandmark beam = beam_of(scan, i);
    if (std::abs(angle_difference(beam.bearing, bearing)) <= cone.half_angle &&
        cone.has(beam.range)) {
      keep_nearer(nearest, beam);
    }
  }
  return nearest;
}

}  // namespace

BeamLandmark closest_beam(const LaserScan& scan, int first, int last, double radius) {
  validate(scan);
  const int beams = static_cast<int>(scan.ranges.size());
  require_beam("first", first, beams);
  require_beam("last", last, beams);
  require_radius(radius);
  BeamLandmark nearest;
  const int count = (last - first + beams) % beams + 1;
  for (int k = 0; k < count; ++k) {
    keep_nearer(nearest, beam_of(scan, (first + k) % beams));
  }
  if (nearest.beam >= 0) {
    nearest.range += radius;
  }
  return nearest;
}

std::vector<BeamLandmark> recognize_landmarks(const LaserScan& scan, const Pose2& predicted,
                                              const LandmarkMap& landmarks) {
  validate(scan);
  require_finite("predicted pose", predicted.x, predicted.y, predicted.heading);
  const Pose2 laser = predicted * scan.geometry->pose_in_body;
  std::vector<BeamLandmark> seen;
  for (const Landmark& landmark : landmarks.landmarks()) {
    seen.push_back(recognize(scan, laser, landmark));
  }
  return seen;
}

}  // namespace locfuse
