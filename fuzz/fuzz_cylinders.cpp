// SPDX-License-Identifier: Apache-2.0
#include "checks.hpp"
#include "locfuse/frontends/cylinder_detector.hpp"
#include "locfuse/frontends/single_beam_landmarks.hpp"
#include "worlds.hpp"

/// CylinderDetector with arbitrary settings on an arbitrary scan.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locfuse;
  fuzz::Reader io(data, size);
  CylinderDetectorConfig config;
  bool as_usual = true;
  code(io, as_usual);
  if (!as_usual) {
    code(io,
         {&config.sigma_range_m, &config.sigma_bearing_rad, &config.radius_m, &config.radius_min_m,
          &config.radius_max_m, &config.leg_radius_m, &config.leg_distance_m},
         0.0, 2.0);
    code(io,
         {&config.jump_gaps, &config.least_evidence, &config.least_corner_evidence,
          &config.least_intensity},
         -30.0, 30.0);
    code(io, config.misfit_probability, 0.0, 1.0);
    code(io, config.least_beams);
    std::uint8_t method = 0;
    code(io, method, 3);
    config.method = static_cast<CylinderMethod>(method);
  }
  Stamp now = 0;
  Pose2 predicted;
  code(io, predicted, 5.0);
  fuzz::returns([&] {
    const auto scan = fuzz::read<LaserScan>(io, now);
    fuzz::returns([&] {
      for (const BeamLandmark& beam : recognize_landmarks(scan, predicted, *fuzz::poles())) {
        fuzz::require(beam.beam < static_cast<int>(scan.ranges.size()),
                      "a beam is an index into the scan");
      }
    });
    const auto beams = static_cast<int>(scan.ranges.size());
    for (const Cylinder& found : CylinderDetector(config).detect(scan)) {
      fuzz::require(std::isfinite(found.range) && std::isfinite(found.bearing) &&
                        std::isfinite(found.radius) && std::isfinite(found.misfit),
                    "a cylinder is finite");
      fuzz::require(
          found.first >= 0 && found.first < beams && found.last >= 0 && found.last < beams,
          "its beams are indices into the scan");
      if (config.radius_m > 0.0) {
        fuzz::require_covariance(io, found.covariance.topLeftCorner<2, 2>());
      } else {
        fuzz::require_covariance(io, found.covariance);
      }
    }
  });
  return 0;
}
