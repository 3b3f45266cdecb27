// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse {

/// Distance of each cell of a map to the nearest target cell, exact, by two passes of linear time.
///
/// The targets are the occupied cells, or others that are given. The field reaches `margin` beyond
/// the map on each side, so that an end point behind the last wall is seen as far from it.
/// Distances are between centres of cells; docs/models/scan_matching.md eq. (1) and (2).
///
/// Beside the grid it takes 4 bytes a cell and 4 a target, and what is asked for besides.
class DistanceField {
 public:
  /// What a field holds beside its distances.
  enum class Extra {
    kNone,
    kNearestTargets,  ///< nearest_targets(): 4 bytes a cell more
    kSurroundings,    ///< distances far beyond the field: 2.25 bytes a cell more
  };

  /// A target, counted row by row, and how far away its centre is [m].
  struct Neighbour {
    int target = 0;
    double distance = 0.0;
  };

  /// Throws std::invalid_argument if there is no map or no cell of it is occupied, if `margin` [m]
  /// is not in [0, 1e4], or if a side of the field comes out longer than 2^24 cells or the field
  /// larger than 2^30.
  explicit DistanceField(const std::shared_ptr<const OccupancyGrid>& grid, double margin = 1.0,
                         Extra extra = Extra::kNone);

  /// The targets are the cells where `is_target` (row by row) is not 0.
  DistanceField(const std::shared_ptr<const OccupancyGrid>& grid,
                const std::vector<std::uint8_t>& is_target, double margin,
                Extra extra = Extra::kNone);

  [[nodiscard]] const OccupancyGrid& grid() const { return *grid_; }
  [[nodiscard]] int targets() const { return static_cast<int>(target_cells_.size()); }

  /// Centre of a target (0 to targets() - 1) in the field frame: the grid frame shifted by
  /// `margin_cells`.
  [[nodiscard]] Vector<2> center(int target) const {
    const int cell = target_cells_[static_cast<std::size_t>(target)];
    const int row = cell / width_;
    return {cell - row * width_ + 0.5, row + 0.5};
  }

  /// Distance [m] to the nearest target, from the centre of the cell that holds the point: within
  /// half a cell's diagonal. Beyond the field the distance is exact. Throws std::invalid_argument
  /// unless the point is less than 1e9 cells from the map.
  [[nodiscard]] double distance(const Vector<2>& p_world) const;

  /// The target nearest to the point, exact. Throws as distance() does.
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
  /// [cells]; kSurroundings come after the field, as wide and as high as it is on each side: row by
  /// row, one value for kFarCells x kFarCells cells, right within three cells.
  [[nodiscard]] const std::vector<float>& distances() const { return distances_; }
  static constexpr int kFarCells = 4;
  [[nodiscard]] int far_width() const { return 3 * width_ / kFarCells + 1; }
  [[nodiscard]] int far_height() const { return 3 * height_ / kFarCells + 1; }
  /// The target nearest to each cell; empty unless asked for.
  [[nodiscard]] const std::vector<std::int32_t>& nearest_targets() const { return nearest_; }

 private:
  class Envelope;
  void list_targets(const std::vector<std::uint8_t>& is_target);
  void fill_rows();
  void fill_columns();
  void fill_column(int column, float* distances, Envelope& envelope);
  void fill_far();
  [[nodiscard]] std::size_t far_cells() const {
    return static_cast<std::size_t>(far_width()) * static_cast<std::size_t>(far_height());
  }
  [[nodiscard]] int nearest_in_row(int row, double x, double within) const;
  [[nodiscard]] std::int32_t target_at(std::size_t cell) const;

  std::shared_ptr<const OccupancyGrid> grid_;
  int margin_cells_;
  int width_;
  int height_;
  std::vector<std::int32_t> target_cells_;  // of the field, row by row
  std::vector<float> distances_;
  std::vector<std::int32_t> nearest_;
};

}  // namespace locfuse
