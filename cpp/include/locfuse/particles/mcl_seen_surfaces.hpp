// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/models/measurement/likelihood_field.hpp"

namespace locfuse::internal {

/// Which surfaces scans have shown, in the frame of odometry, so that what is seen again counts as
/// what it is: no news. Eq. (2.10) of docs/models/particles.md.
class SeenSurfaces {
 public:
  /// Forgets all.
  void reset() { seen_.clear(); }
  /// Share of the end points on surfaces that no scan has shown; they have from now on. `here` is
  /// the pose of the body by odometry, in cells, of `resolution` [m].
  [[nodiscard]] double news(const EndPoints& points, const Pose2& here, double resolution);

 private:
  std::vector<std::uint32_t> seen_;  // a signature where a surface is; empty before the first scan
};

}  // namespace locfuse::internal
