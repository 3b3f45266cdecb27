// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

struct CylinderDetectorConfig {
  double sigma_range_m = 0.01;     ///< noise of one beam
  double sigma_bearing_rad = 0.0;  ///< of its direction: width of the beam, quantization
  double radius_m = 0.0;           ///< of all cylinders; 0: each has its own, found by the fit
  double radius_min_m = 0.03;      ///< if it is found
  double radius_max_m = 1.5;       ///< likewise
  int least_beams = 7;             ///< on a cylinder
  /// A depth step between two beams is an edge from six sigma and so many gaps between beams on.
  double jump_gaps = 6.0;
  double misfit_probability = 0.99999;  ///< that the arc of a cylinder passes the chi-square gate
  /// By how much the chi-square of a straight wall must be larger. What is too small to tell is a
  /// cylinder if it stands alone and `radius_m` says its width; with 0 of any width in bounds.
  double least_evidence = 25.0;
  /// By how much that of a right-angled corner must be larger. Thin cylinders look like the corners
  /// of boxes as small as they; -20 takes them all, for places without boxes.
  double least_corner_evidence = 4.0;
  double leg_radius_m = 0.12;    ///< a cylinder up to this next to anything as thin is a leg
  double leg_distance_m = 0.0;   ///< between the two; 0: nobody walks here
  double least_intensity = 0.0;  ///< one beam must be that bright; 0: of any brightness
};

/// An upright cylinder in the plane of a laser.
struct Cylinder {
  double range = 0.0;    ///< of the centre, from the laser [m]
  double bearing = 0.0;  ///< of the centre, in the laser's frame [rad]
  double radius = 0.0;   ///< [m]
  /// Of (range, bearing, radius). Zero in row and column of a radius that was given.
  Matrix<3, 3> covariance = Matrix<3, 3>::Zero();
  int first = 0;        ///< beam of its arc where the bearing is least; above `last` across the cut
  int last = 0;         ///< beam where it is largest
  int beams = 0;        ///< that the fit used
  double misfit = 0.0;  ///< chi-square by degree of freedom; 0 if there is none
};

/// Finds cylinders in single scans. docs/models/cylinders.md.
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
