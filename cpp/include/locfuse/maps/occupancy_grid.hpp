// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "locfuse/geometry/pose2.hpp"

namespace locfuse {

/// State of a cell; the numbers are those of ROS.
enum class Cell : std::int8_t { kUnknown = -1, kFree = 0, kOccupied = 100 };

/// Grid of free, occupied and unknown square cells. Immutable; share it by
/// std::shared_ptr<const OccupancyGrid>.
///
/// The grid frame has its origin in the outer corner of cell (column 0, row 0), x along the
/// columns, y along the rows, and the cell as its unit: cell (c, r) covers [c, c + 1) x [r, r + 1).
class OccupancyGrid {
 public:
  /// `cells` row by row, row 0 at the lowest y; `resolution` [m] per cell; `origin` is
  /// T_world_grid, in metres. Throws std::invalid_argument on an empty grid, on sizes that do not
  /// match, unless `resolution` is 1e-6 to 1e6, and unless the numbers of `origin` are within 1e9.
  OccupancyGrid(int width, int height, double resolution, const Pose2& origin,
                std::vector<Cell> cells);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] double resolution() const { return resolution_; }
  [[nodiscard]] const Pose2& origin() const { return origin_; }
  [[nodiscard]] const std::vector<Cell>& cells() const { return cells_; }

  [[nodiscard]] bool contains(int column, int row) const {
    return column >= 0 && column < width_ && row >= 0 && row < height_;
  }

  /// Unknown outside the grid.
  [[nodiscard]] Cell at(int column, int row) const {
    return contains(column, row)
               ? cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                        static_cast<std::size_t>(column)]
               : Cell::kUnknown;
  }

  /// The cell at a point in world; unknown outside the grid.
  [[nodiscard]] Cell at(const Vector<2>& p_world) const;

  /// Whether a point in world lies on the grid.
  [[nodiscard]] bool contains(const Vector<2>& p_world) const;

  /// Point in the grid frame, in cells.
  [[nodiscard]] Vector<2> to_grid(const Vector<2>& p_world) const;

  /// Point in world of a point in the grid frame, in cells.
  [[nodiscard]] Vector<2> to_world(const Vector<2>& p_grid) const;

  /// Centre of a cell in world.
  [[nodiscard]] Vector<2> center(int column, int row) const {
    return to_world({column + 0.5, row + 0.5});
  }

 private:
  int width_;
  int height_;
  double resolution_;
  Pose2 origin_;
  Pose2 grid_from_world_;
  std::vector<Cell> cells_;
};

}  // namespace locfuse
