// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// How a cylinder is found in a scan, and its centre computed.
enum class CylinderMethod {
  kArcs,         ///< a circle is fitted to all its beams
  kClosestBeam,  ///< found as by kArcs; the centre is `radius_m` behind its shortest beam (wells)
  /// The shortest beam of a cone as wide as a cylinder of `radius_m` behind it (gadau2022, without
  /// a predicted pose). Shape is not tested: for places without walls and boxes.
  kCone,
};

/// `kClosestBeam` and `kCone` need `radius_m`. `kCone` refuses `least_evidence`,
/// `least_corner_evidence` and `leg_distance_m` that differ from their defaults: it has no use for
/// them.
struct CylinderDetectorConfig {
  CylinderMethod method = CylinderMethod::kArcs;
  double sigma_range_m = 0.01;     ///< noise of one beam
  double sigma_bearing_rad = 0.0;  ///< noise of its direction: width of the beam, quantization
  double radius_m = 0.0;           ///< of all cylinders; 0: estimated for each
  double radius_min_m = 0.03;      ///< minimum estimated radius
  double radius_max_m = 1.5;       ///< maximum estimated radius
  int least_beams = 7;             ///< minimum number of beams on a cylinder
  /// Minimum depth step of an edge between two objects, in gaps between beams, beside six sigma.
  double jump_gaps = 6.0;
  double misfit_probability = 0.99999;  ///< with which the arc of a cylinder passes its gate
  /// Minimum chi-square by which a straight wall fits worse. An arc too short for that is a
  /// cylinder if it is isolated and as wide as `radius_m`; with 0 if its width is within bounds.
  double least_evidence = 25.0;
  /// Minimum chi-square by which a right-angled corner fits worse. Thin cylinders look like corners
  /// of equally small boxes; -20 accepts them all, for places without boxes.
  double least_corner_evidence = 4.0;
  double leg_radius_m = 0.12;   ///< maximum radius of a leg: a cylinder next to another thin object
  double leg_distance_m = 0.0;  ///< maximum distance between the two; 0: no people
  double least_intensity = 0.0;  ///< minimum intensity of a beam; 0: any
};

/// An upright cylinder in the plane of a laser.
struct Cylinder {
  double range = 0.0;    ///< of the centre, from the laser [m]
  double bearing = 0.0;  ///< of the centre, in the laser's frame [rad]
  double radius = 0.0;   ///< [m]
  /// Of (range, bearing, radius); zero in row and column of a given radius. The mean squared error
  /// where the centre is that of a single beam, which has a bias: eq. (5.9).
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();
  int first =
      0;  ///< beam of its arc with the smallest bearing; above `last` across the end of the scan
  int last = 0;         ///< beam with the largest bearing
  int beams = 0;        ///< used by the fit
  double misfit = 0.0;  ///< chi-square per degree of freedom; 0 without any, and with kCone
};

/// Detects cylinders in single scans. docs/models/landmarks.md.
///
/// Immutable; `detect` may be called from several threads.
class CylinderDetector {
 public:
  /// Throws std::invalid_argument on a setting out of bounds.
  explicit CylinderDetector(const CylinderDetectorConfig& config = {});

  [[nodiscard]] const CylinderDetectorConfig& config() const { return config_; }

  /// Cylinders in order of `first`. Throws std::invalid_argument if the scan is not valid, has more
  /// than 100,000 beams, or no intensities where `least_intensity` asks for them.
  [[nodiscard]] std::vector<Cylinder> detect(const LaserScan& scan) const;

 private:
  CylinderDetectorConfig config_;
  std::vector<double> gates_;  // of chi-square, by degrees of freedom
};

}  // namespace locfuse
