// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse {

/// Nearest target cell of each cell of a map, exact, by two passes of linear time.
///
/// The targets are the occupied cells, or others that are given. The field reaches `margin` beyond
/// the map on each side, so that an end point behind the last wall is seen as far from it.
/// Distances are between centres of cells; docs/models/scan_matching.md eq. (1) and (2).
class DistanceField {
 public:
  /// A target, counted row by row, and how far away its centre is [m].
  struct Neighbour {
    int target = 0;
    double distance = 0.0;
  };

  /// Throws std::invalid_argument if no cell is occupied or if `margin` [m] is not in [0, 1e4].
  explicit DistanceField(const std::shared_ptr<const OccupancyGrid>& grid, double margin = 1.0);

  /// The targets are the cells where `is_target` (row by row) is not 0.
  DistanceField(std::shared_ptr<const OccupancyGrid> grid,
                const std::vector<std::uint8_t>& is_target, double margin);

  [[nodiscard]] const OccupancyGrid& grid() const { return *grid_; }
  [[nodiscard]] int targets() const { return static_cast<int>(centers_.size()); }

  /// Centre of a target in the field frame: the grid frame shifted by `margin_cells`.
  [[nodiscard]] const Vector<2>& center(int target) const {
    return centers_[static_cast<std::size_t>(target)];
  }

  /// Distance [m] to the nearest target, from the centre of the cell that holds the point: within
  /// half a cell's diagonal. Beyond the field the distance is exact.
  [[nodiscard]] double distance(const Vector<2>& p_world) const;

  /// The target nearest to the point, exact anywhere.
  [[nodiscard]] Neighbour nearest(const Vector<2>& p_world) const;

  /// The same in the field frame, in cells.
  [[nodiscard]] Neighbour nearest_in_field(double x, double y) const;

  /// Point in the field frame, in cells.
  [[nodiscard]] Vector<2> to_field(const Vector<2>& p_world) const {
    return grid_->to_grid(p_world) + Vector<2>::Constant(margin_cells_);
  }

  // For loops over many points: the field row by row, with its margin.
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] int margin_cells() const { return margin_cells_; }
  /// [cells]; after the field come its surroundings, which are as wide and as high as it is on each
  /// side: row by row, one value for kFarCells x kFarCells cells, right within three cells.
  [[nodiscard]] const std::vector<float>& distances() const { return distances_; }
  static constexpr int kFarCells = 4;
  [[nodiscard]] int far_width() const { return 3 * width_ / kFarCells + 1; }
  [[nodiscard]] int far_height() const { return 3 * height_ / kFarCells + 1; }
  [[nodiscard]] const std::vector<std::int32_t>& nearest_targets() const { return nearest_; }

 private:
  void fill_rows(const std::vector<std::uint8_t>& is_target);
  void fill_columns();
  void fill_far();

  std::shared_ptr<const OccupancyGrid> grid_;
  int margin_cells_;
  int width_;
  int height_;
  std::vector<Vector<2>> centers_;
  std::vector<std::int32_t> target_of_;   // grid cell -> target, -1 for none
  std::vector<std::int32_t> row_offset_;  // columns to the nearest target in the same row
  std::vector<std::int32_t> nearest_;
  std::vector<float> distances_;
};

}  // namespace locfuse
