// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/distance_field.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace locfuse {
namespace {

constexpr std::int32_t kNone = 1 << 30;  // a row without target

std::vector<std::uint8_t> occupied_cells(const OccupancyGrid& grid) {
  std::vector<std::uint8_t> occupied(grid.cells().size());
  std::transform(grid.cells().begin(), grid.cells().end(), occupied.begin(),
                 [](Cell cell) { return static_cast<std::uint8_t>(cell == Cell::kOccupied); });
  return occupied;
}

int cells_of(double margin, double resolution) {
  if (!(margin >= 0.0 && margin <= 1e4)) {
    throw std::invalid_argument("margin is " + std::to_string(margin) + " m, expected 0 to 10000");
  }
  return static_cast<int>(std::ceil(margin / resolution)) + 1;
}

/// Cell that holds a coordinate, or the outermost one on its side.
int clamped_cell(double coordinate, int size) {
  return static_cast<int>(std::min(std::max(coordinate, 0.0), size - 1.0));
}

void require_finite(const Vector<2>& p_world) {
  if (!p_world.allFinite()) {
    throw std::invalid_argument("position is (" + std::to_string(p_world.x()) + ", " +
                                std::to_string(p_world.y()) + ") m, expected finite numbers");
  }
}

std::size_t at(int row, int column, int width) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(column);
}

}  // namespace

DistanceField::DistanceField(const std::shared_ptr<const OccupancyGrid>& grid, double margin)
    : DistanceField(grid, occupied_cells(*grid), margin) {}

DistanceField::DistanceField(std::shared_ptr<const OccupancyGrid> grid,
                             const std::vector<std::uint8_t>& is_target, double margin)
    : grid_(std::move(grid)),
      margin_cells_(cells_of(margin, grid_->resolution())),
      width_(grid_->width() + 2 * margin_cells_),
      height_(grid_->height() + 2 * margin_cells_) {
  if (is_target.size() != grid_->cells().size()) {
    throw std::invalid_argument(
        "is_target has " + std::to_string(is_target.size()) +
        " cells, expected those of the grid: " + std::to_string(grid_->cells().size()));
  }
  if (std::all_of(is_target.begin(), is_target.end(), [](std::uint8_t t) { return t == 0; })) {
    throw std::invalid_argument("the map has 0 occupied cells, expected at least 1");
  }
  fill_rows(is_target);
  nearest_.resize(row_offset_.size());
  distances_.resize(row_offset_.size());
  std::vector<int> rows(static_cast<std::size_t>(height_));
  std::vector<int> from(static_cast<std::size_t>(height_));
  for (int column = 0; column < width_; ++column) {
    fill_column(column, rows, from);
  }
}

void DistanceField::fill_rows(const std::vector<std::uint8_t>& is_target) {
  target_of_.assign(is_target.size(), -1);
  row_offset_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), kNone);
  for (int row = 0; row < grid_->height(); ++row) {
    std::int32_t* const offset = &row_offset_[at(row + margin_cells_, 0, width_)];
    for (int column = 0; column < grid_->width(); ++column) {
      const std::size_t cell = at(row, column, grid_->width());
      if (is_target[cell] != 0) {
        target_of_[cell] = static_cast<std::int32_t>(centers_.size());
        centers_.emplace_back(column + margin_cells_ + 0.5, row + margin_cells_ + 0.5);
        offset[column + margin_cells_] = 0;
      }
    }
    for (int x = 1; x < width_; ++x) {  // targets to the left
      if (offset[x] == kNone && offset[x - 1] != kNone) {
        offset[x] = offset[x - 1] - 1;
      }
    }
    for (int x = width_ - 2; x >= 0; --x) {  // nearer ones to the right
      if (offset[x + 1] != kNone && offset[x + 1] >= 0 &&
          (offset[x] == kNone || offset[x + 1] + 1 < -offset[x])) {
        offset[x] = offset[x + 1] + 1;
      }
    }
  }
}

/// Lower envelope of the parabolas (y - row)^2 + offset^2 over one column (Felzenszwalb and
/// Huttenlocher, 2012; Meijster et al., 2000, for whole numbers).
void DistanceField::fill_column(int column, std::vector<int>& rows, std::vector<int>& from) {
  const auto square = [&](int row) {
    const std::int64_t offset = row_offset_[at(row, column, width_)];
    return offset * offset;
  };
  std::size_t count = 0;
  for (int row = 0; row < height_; ++row) {
    if (row_offset_[at(row, column, width_)] == kNone) {
      continue;
    }
    int begin = 0;
    while (count > 0) {
      const std::int64_t last = rows[count - 1];
      const std::int64_t top =
          std::int64_t{row} * row - last * last + square(row) - square(rows[count - 1]);
      // From the row after `top / (2 (row - last))` on, the new parabola is the lower one.
      begin = top < 0
                  ? 0
                  : static_cast<int>(std::min<std::int64_t>(top / (2 * (row - last)) + 1, height_));
      if (begin > from[count - 1]) {
        break;
      }
      --count;
      begin = 0;
    }
    if (begin < height_) {
      rows[count] = row;
      from[count++] = begin;
    }
  }
  std::size_t i = 0;
  for (int y = 0; y < height_; ++y) {
    while (i + 1 < count && from[i + 1] <= y) {
      ++i;
    }
    const std::int64_t up = rows[i] - y;
    const int target_column = column + row_offset_[at(rows[i], column, width_)] - margin_cells_;
    nearest_[at(y, column, width_)] =
        target_of_[at(rows[i] - margin_cells_, target_column, grid_->width())];
    distances_[at(y, column, width_)] = std::sqrt(static_cast<float>(up * up + square(rows[i])));
  }
}

double DistanceField::distance(const Vector<2>& p_world) const {
  require_finite(p_world);
  const Vector<2> p = to_field(p_world);
  if (!(p.x() >= 0.0 && p.x() < width_ && p.y() >= 0.0 && p.y() < height_)) {
    return nearest(p_world).distance;
  }
  return grid_->resolution() *
         static_cast<double>(
             distances_[at(static_cast<int>(p.y()), static_cast<int>(p.x()), width_)]);
}

DistanceField::Neighbour DistanceField::nearest(const Vector<2>& p_world) const {
  require_finite(p_world);
  const Vector<2> p = to_field(p_world);
  Neighbour found = nearest_in_field(p.x(), p.y());
  found.distance *= grid_->resolution();
  return found;
}

DistanceField::Neighbour DistanceField::nearest_in_field(double x, double y) const {
  const int column = clamped_cell(x, width_);
  const int middle = clamped_cell(y, height_);
  // The answer for the cell's centre is an upper bound; no row farther away than that is looked at.
  int best_target = nearest_[at(middle, column, width_)];
  double best = (center(best_target) - Vector<2>(x, y)).squaredNorm();
  const auto look = [&](int row) {
    const double dy = row + 0.5 - y;
    if (row < margin_cells_ || row >= height_ - margin_cells_ || dy * dy >= best) {
      return dy * dy < best;
    }
    std::int32_t offset = row_offset_[at(row, column, width_)];
    if (offset == kNone) {
      return true;
    }
    const double right = x - (column + 0.5);  // of the centre
    const int other = column - offset;
    if (static_cast<double>(offset) * right < 0.0 && other >= 0 && other < width_ &&
        row_offset_[at(row, other, width_)] == 0) {
      offset = -offset;  // as far from the centre, nearer to the point
    }
    const double dx = offset - right;
    if (dx * dx + dy * dy < best) {
      best = dx * dx + dy * dy;
      best_target =
          target_of_[at(row - margin_cells_, column + offset - margin_cells_, grid_->width())];
    }
    return true;
  };
  look(middle);
  bool up = true;
  bool down = true;
  for (int step = 1; (up || down) && step < height_; ++step) {
    up = up && look(middle + step);
    down = down && look(middle - step);
  }
  return {best_target, std::sqrt(best)};
}

}  // namespace locfuse
