// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/distance_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace locfuse {
namespace {

constexpr std::int32_t kNone = 1 << 30;  // a row without target
constexpr double kNoParabola = std::numeric_limits<double>::infinity();

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

double square(double value) { return value * value; }

/// Lower envelope of the parabolas (y - row)^2 + height(row) over one column (Felzenszwalb and
/// Huttenlocher, 2012).
class Envelope {
 public:
  explicit Envelope(std::size_t rows) : rows_(rows), from_(rows) {}

  /// Rows whose height is kNoParabola are left out; one at least must stay.
  template <class Height>
  void build(const Height& height_of) {
    count_ = 0;
    for (int row = 0; row < static_cast<int>(rows_.size()); ++row) {
      const double height = height_of(row);
      if (height == kNoParabola) {
        continue;
      }
      double begin = -kNoParabola;
      while (count_ > 0) {
        const double last = rows_[count_ - 1];
        // From here on the new parabola is below the last one.
        begin = 0.5 * (row + last + (height - height_of(rows_[count_ - 1])) / (row - last));
        if (begin > from_[count_ - 1]) {
          break;
        }
        --count_;
        begin = -kNoParabola;
      }
      rows_[count_] = row;
      from_[count_++] = begin;
    }
    at_ = 0;
  }

  /// Row of the lowest parabola at y, which must not fall from call to call.
  [[nodiscard]] int lowest_at(double y) {
    while (at_ + 1 < count_ && from_[at_ + 1] <= y) {
      ++at_;
    }
    return rows_[at_];
  }

 private:
  std::vector<int> rows_;
  std::vector<double> from_;
  std::size_t count_ = 0;
  std::size_t at_ = 0;
};

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
  distances_.resize(row_offset_.size() +
                    static_cast<std::size_t>(far_width()) * static_cast<std::size_t>(far_height()));
  fill_columns();
  fill_far();
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

void DistanceField::fill_columns() {
  Envelope envelope(static_cast<std::size_t>(height_));
  for (int column = 0; column < width_; ++column) {
    envelope.build([&](int row) {
      const std::int32_t offset = row_offset_[at(row, column, width_)];
      return offset == kNone ? kNoParabola : square(offset);
    });
    for (int row = 0; row < height_; ++row) {
      const int nearest_row = envelope.lowest_at(row);
      const std::int32_t offset = row_offset_[at(nearest_row, column, width_)];
      nearest_[at(row, column, width_)] = target_of_[at(
          nearest_row - margin_cells_, column + offset - margin_cells_, grid_->width())];
      distances_[at(row, column, width_)] =
          static_cast<float>(std::sqrt(square(nearest_row - row) + square(offset)));
    }
  }
}

void DistanceField::fill_far() {
  Envelope envelope(static_cast<std::size_t>(height_));
  float* const far = distances_.data() + row_offset_.size();
  for (int column = 0; column < far_width(); ++column) {
    const double x = (column + 0.5) * kFarCells - width_;
    const int from = clamped_cell(x, width_);
    envelope.build([&](int row) {
      const std::int32_t offset = row_offset_[at(row, from, width_)];
      return offset == kNone ? kNoParabola : square(from + offset + 0.5 - x);
    });
    for (int row = 0; row < far_height(); ++row) {
      const double y = (row + 0.5) * kFarCells - height_ - 0.5;  // rows are counted at centres
      const int nearest_row = envelope.lowest_at(y);
      const std::int32_t offset = row_offset_[at(nearest_row, from, width_)];
      far[at(row, column, far_width())] =
          static_cast<float>(std::sqrt(square(nearest_row - y) + square(from + offset + 0.5 - x)));
    }
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
