// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse::internal {

/// A beam in the laser's frame.
struct Ray {
  Vector<2> along;     ///< unit vector
  double range = 0.0;  ///< NaN without return
  int beam = 0;        ///< number in the scan
  bool bright = false;

  [[nodiscard]] bool returned() const { return range == range; }
  [[nodiscard]] Vector<2> end() const { return range * along; }
};

/// Beams in order of their bearing. Around a full turn numbers go on beyond both ends, once.
struct Sweep {
  std::vector<Ray> rays;
  bool closed = false;  ///< a full turn
  double step = 0.0;    ///< between two beams [rad]

  [[nodiscard]] int size() const { return static_cast<int>(rays.size()); }
  [[nodiscard]] bool has(int j) const {
    return closed ? j >= -size() && j < 2 * size() : j >= 0 && j < size();
  }
  [[nodiscard]] const Ray& operator[](int j) const {
    return rays[static_cast<std::size_t>(j < 0 ? j + size() : j < size() ? j : j - size())];
  }
};

/// A run of beams, both ends included.
struct Run {
  int first;
  int last;

  [[nodiscard]] int beams() const { return last - first + 1; }
};

/// What two neighbours must differ by to lie on two things.
struct Jump {
  double range;  ///< [m]
  double gaps;   ///< and so many gaps between beams
};

/// Between a beam and the next, a thing ends: a jump, no return, the border of what is bright.
[[nodiscard]] bool is_edge(const Sweep& sweep, int j, const Jump& jump);

/// A scan in order. What a laser sees twice, beyond a full turn, comes once; a full turn begins
/// after an edge, so that no thing is cut in two. With a `least_intensity` above 0 some are bright.
/// Throws std::invalid_argument if the scan is not valid.
[[nodiscard]] Sweep sweep_of(const LaserScan& scan, double least_intensity, const Jump& jump);

}  // namespace locfuse::internal
