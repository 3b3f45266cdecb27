// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "locfuse/maps/distance_field.hpp"

namespace locfuse {

namespace internal {
class KdTree;
}

/// Map prepared for laser scans. Immutable; share it by std::shared_ptr<const ScanMap>.
///
/// Two distance fields: of the occupied cells, for the heading search, and of the surface cells,
/// those occupied cells that touch a free one, which a beam can hit; and a wall line through each
/// surface cell and its neighbours. docs/models/scans.md eq. (1.3).
class ScanMap {
 public:
  /// Line n (p - point) = 0 in the field frame [cells]. The normal is zero where the cells around
  /// are not on a line: at a thin pole, and at a corner, which also has no run.
  struct WallLine {
    Vector<2> point = Vector<2>::Zero();
    Vector<2> normal = Vector<2>::Zero();
    /// Length of wall that shares one rounding error [cells]: the cells that the line is fitted to,
    /// or the straight run of cells it is in.
    double run = 0.0;
  };

  /// WallLine in half the memory, for loops over beams.
  struct CompactLine {
    float x, y, nx, ny, run;
  };

  /// Maximum distance of a used end point from a wall, and from the map [m].
  static constexpr double kMargin = 1.0;

  /// Throws std::invalid_argument if there is no map or it has no occupied cell.
  explicit ScanMap(const std::shared_ptr<const OccupancyGrid>& grid);
  ~ScanMap();
  ScanMap(const ScanMap&) = delete;
  ScanMap& operator=(const ScanMap&) = delete;

  [[nodiscard]] const OccupancyGrid& grid() const { return occupied_.grid(); }
  [[nodiscard]] const DistanceField& occupied() const { return occupied_; }
  [[nodiscard]] const DistanceField& surface() const { return surface_; }

  /// One for each target of surface().
  [[nodiscard]] const std::vector<WallLine>& lines() const { return lines_; }
  [[nodiscard]] const std::vector<CompactLine>& compact_lines() const { return compact_lines_; }

  /// Distance [m] from a point in world to the centre of the nearest occupied cell, by a
  /// kd-tree in single precision: exact to a micrometre on maps of 100 m.
  [[nodiscard]] double nearest_by_kdtree(const Vector<2>& p_world) const;

 private:
  DistanceField occupied_;
  DistanceField surface_;
  std::vector<WallLine> lines_;
  std::vector<CompactLine> compact_lines_;
  std::unique_ptr<internal::KdTree> tree_;
};

}  // namespace locfuse
