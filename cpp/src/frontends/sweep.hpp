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

/// Beams in order of their bearing. Indices of a full turn may exceed both ends by one turn.
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

/// Minimum difference between the ranges of two neighbours on two objects: the sum of both.
struct Jump {
  double range;  ///< [m]
  double gaps;   ///< [gaps between beams]
};

/// Whether an object ends between a beam and the next: a jump, no return, a change of brightness.
[[nodiscard]] bool is_edge(const Sweep& sweep, int j, const Jump& jump);

/// Beams of a scan in order. Directions beyond a full turn are dropped; a full turn begins after an
/// edge, so that no object is cut in two. Beams are bright from a `min_intensity` above 0 on.
/// Throws std::invalid_argument if the scan is not valid.
[[nodiscard]] Sweep sweep_of(const LaserScan& scan, double min_intensity, const Jump& jump);

}  // namespace locfuse::internal
