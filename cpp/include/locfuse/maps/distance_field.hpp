// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "locfuse/maps/occupancy_grid.hpp"

namespace locfuse {

/// Distance of each cell of a map to the nearest target cell, exact, by two passes of linear time.
///
/// Targets are the occupied cells, or given ones. The field extends by `margin` beyond the map on
/// each side, for end points behind the outermost walls. Distances are between centres of cells;
/// docs/models/scans.md eq. (1.1) and (1.2).
///
/// Memory beside the grid: 4 bytes per cell and 4 per target, plus `Extra`.
class DistanceField {
 public:
  /// Optional contents beside the distances.
  enum class Extra {
    kNone,
    kNearestTargets,  ///< nearest_targets(): 4 bytes per cell
    kSurroundings,    ///< distances far beyond the field: 2.25 bytes per cell
  };

  /// A target, numbered row by row, and the distance to its centre [m].
  struct Neighbour {
    int target = 0;
    double distance = 0.0;
  };

  /// Throws std::invalid_argument without a map or on one without occupied cells, if `margin` [m]
  /// is not in [0, 1e4], or if the field exceeds 2^24 cells per side or 2^30 cells.
  explicit DistanceField(const std::shared_ptr<const OccupancyGrid>& grid, double margin = 1.0,
                         Extra extra = Extra::kNone);

  /// Field of the target cells where `is_target` (row by row) is not 0.
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

  /// Distance [m] to the nearest target from the centre of the cell of the point: accurate to half
  /// a cell's diagonal, exact beyond the field. Throws std::invalid_argument unless the point is
  /// less than 1e9 cells from the map.
  [[nodiscard]] double distance(const Vector<2>& p_world) const;

  /// Target nearest to the point, exact. Throws as distance() does.
  [[nodiscard]] Neighbour nearest(const Vector<2>& p_world) const;

  /// Target nearest to a point in the field frame, in cells.
  [[nodiscard]] Neighbour nearest_in_field(double x, double y) const;

  /// Point in the field frame, in cells.
  [[nodiscard]] Vector<2> to_field(const Vector<2>& p_world) const {
    return grid_->to_grid(p_world) + Vector<2>::Constant(margin_cells_);
  }

  // For loops over many points: the field row by row, with its margin.
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] int margin_cells() const { return margin_cells_; }
  /// Distances [cells]. With kSurroundings those of an area of three times the size follow, row by
  /// row, one value per kFarCells x kFarCells cells, accurate to three cells.
  [[nodiscard]] const std::vector<float>& distances() const { return distances_; }
  static constexpr int kFarCells = 4;
  [[nodiscard]] int far_width() const { return 3 * width_ / kFarCells + 1; }
  [[nodiscard]] int far_height() const { return 3 * height_ / kFarCells + 1; }
  /// Target nearest to each cell; empty without kNearestTargets.
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
