// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "frontends/beams.hpp"
#include "frontends/pose_information.hpp"
#include "locfuse/frontends/scan_matcher.hpp"

namespace locfuse::internal {

/// Number of end points of range `r` on a run of wall, which share one error; at least 1.
[[nodiscard]] inline double beams_per_run(double r, double step, double run) {
  const double spacing = r * step;
  return spacing < run ? run / spacing : 1.0;
}

/// A refined pose in the field frame, in cells.
struct Fit {
  Pose2 pose;
  ScanMatch::Reason reason = ScanMatch::Reason::kNoConvergence;
  int iterations = 0;
  double offset = 0.0;  ///< from the wall lines to the surfaces, towards the laser
  double sigma = 0.0;   ///< standard deviation of an end point about its surface
  double explained = 0.0;
  double rms = 0.0;
  Matrix<3, 3> information = Matrix<3, 3>::Zero();
  std::optional<Vector<3>> weak;
};

/// Gauss-Newton from `start`, whose error may be up to `capture` cells.
[[nodiscard]] Fit refine(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
                         const Pose2& start, const Prior& prior, double capture);

/// Fit from the prior's mean; if that explains little, also from headings to both sides.
[[nodiscard]] Fit refine_around(const ScanMap& map, const ScanMatcherConfig& config,
                                const Beams& beams, const Prior& prior, double capture);

/// A fit in world and metres.
[[nodiscard]] ScanMatch to_match(const Fit& fit, const OccupancyGrid& grid, int margin_cells,
                                 const Pose2& guess, const Prior& prior);

}  // namespace locfuse::internal
