// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/distance_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "maps/cells.hpp"
#include "maps/given.hpp"

namespace locfuse {
namespace {

/// Limits of DistanceField.
struct DistanceFieldLimits {
  static constexpr double kMaxSide = 1 << 24;   // [cells], exact in a float
  static constexpr double kMaxCells = 1 << 30;  // fits an int
  static constexpr double kMaxMargin = 1e4;     // [m]
  /// Distance of a point from the map, in cells: a double does not resolve cells well beyond it.
  static constexpr double kMaxDistance = 1e9;
};

// Columns that are filled at a time, as cells of one column are far apart in memory.
constexpr int kBlock = 32;

// Relative and absolute margin for the rounding of a squared upper bound of the distance [cells].
constexpr double kBoundFactor = 1.000001;
constexpr double kBoundMargin = 1e-6;

constexpr float kNoTarget = std::numeric_limits<float>::infinity();
using internal::kInfinity;

std::vector<std::uint8_t> occupied_cells(const OccupancyGrid& grid) {
  std::vector<std::uint8_t> occupied(grid.cells().size());
  std::transform(grid.cells().begin(), grid.cells().end(), occupied.begin(),
                 [](Cell cell) { return static_cast<std::uint8_t>(cell == Cell::kOccupied); });
  return occupied;
}

int margin_cells_of(double margin, const OccupancyGrid& grid) {
  if (!(margin >= 0.0 && margin <= DistanceFieldLimits::kMaxMargin)) {
    throw std::invalid_argument("margin is " + std::to_string(margin) + " m, expected 0 to 10000");
  }
  const double cells = std::ceil(margin / grid.resolution()) + 1.0;
  const double width = grid.width() + 2.0 * cells;
  const double height = grid.height() + 2.0 * cells;
  if (!(std::max(width, height) <= DistanceFieldLimits::kMaxSide &&
        width * height <= DistanceFieldLimits::kMaxCells)) {
    throw std::invalid_argument("margin is " + std::to_string(margin) + " m, or " +
                                std::to_string(cells) +
                                " cells, expected a field of at most 2^30 cells, 2^24 a side");
  }
  return static_cast<int>(cells);
}

/// Checks a point in the field frame, in cells.
void require_near(const Vector<2>& p, const Vector<2>& p_world) {
  if (!(p.array().abs() < DistanceFieldLimits::kMaxDistance).all()) {
    throw std::invalid_argument("position is (" + std::to_string(p_world.x()) + ", " +
                                std::to_string(p_world.y()) +
                                ") m, expected finite numbers, less than 1e9 cells from the map");
  }
}

std::size_t at(int row, int column, int width) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(column);
}

double square(double value) { return value * value; }

}  // namespace

/// Lower envelope of parabolas (Felzenszwalb and Huttenlocher, 2012).
class DistanceField::Envelope {
 public:
  /// Parabola (y - row)^2 + height, the lowest one from y = from / per on. Without the division,
  /// which would dominate the run time.
  struct Parabola {
    double row;
    double height;
    double from;
    double per;
  };

  /// Builds it from the distances to the target of each row. At least one row must have a target.
  void build(int rows, const float* distances) {
    parabolas_.clear();
    for (int row = 0; row < rows; ++row) {
      if (distances[row] < kNoTarget) {
        add(row, square(static_cast<double>(distances[row])));
      }
    }
    at_ = 0;
  }

  /// Lowest parabola at y, which must not decrease between calls.
  [[nodiscard]] const Parabola& lowest_at(double y) {
    while (at_ + 1 < parabolas_.size() && parabolas_[at_ + 1].from <= y * parabolas_[at_ + 1].per) {
      ++at_;
    }
    return parabolas_[at_];
  }

 private:
  void add(double row, double height) {
    Parabola added{row, height, -kInfinity, 1.0};
    while (!parabolas_.empty()) {
      const Parabola& last = parabolas_.back();
      const double from = (row - last.row) * (row + last.row) + height - last.height;
      const double per = 2.0 * (row - last.row);
      if (from * last.per > last.from * per) {
        added.from = from;
        added.per = per;
        break;
      }
      parabolas_.pop_back();
    }
    parabolas_.push_back(added);
  }

  std::vector<Parabola> parabolas_;
  std::size_t at_ = 0;
};

DistanceField::DistanceField(const std::shared_ptr<const OccupancyGrid>& grid, double margin,
                             Extra extra)
    : DistanceField(grid, occupied_cells(*internal::given(grid, "DistanceField")), margin, extra) {}

DistanceField::DistanceField(const std::shared_ptr<const OccupancyGrid>& grid,
                             const std::vector<std::uint8_t>& is_target, double margin, Extra extra)
    : grid_(internal::given(grid, "DistanceField")),
      margin_cells_(margin_cells_of(margin, *grid_)),
      width_(grid_->width() + 2 * margin_cells_),
      height_(grid_->height() + 2 * margin_cells_) {
  if (is_target.size() != grid_->cells().size()) {
    throw std::invalid_argument(
        "is_target has " + std::to_string(is_target.size()) +
        " cells, expected those of the grid: " + std::to_string(grid_->cells().size()));
  }
  list_targets(is_target);
  const std::size_t cells = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  const bool far = extra == Extra::kSurroundings;
  distances_.reserve(cells + (far ? far_cells() : 0));
  distances_.resize(cells, kNoTarget);
  nearest_.resize(extra == Extra::kNearestTargets ? cells : 0);
  fill_rows();
  fill_columns();
  if (far) {
    fill_far();
  }
}

void DistanceField::list_targets(const std::vector<std::uint8_t>& is_target) {
  target_cells_.reserve(is_target.size() - static_cast<std::size_t>(
                                               std::count(is_target.begin(), is_target.end(), 0)));
  for (int row = 0; row < grid_->height(); ++row) {
    for (int column = 0; column < grid_->width(); ++column) {
      if (is_target[at(row, column, grid_->width())] != 0) {
        target_cells_.push_back((row + margin_cells_) * width_ + column + margin_cells_);
      }
    }
  }
  if (target_cells_.empty()) {
    throw std::invalid_argument("the map has 0 occupied cells, expected at least 1");
  }
}

/// Leaves in each cell the distance to the nearest target of its row, infinite without one.
void DistanceField::fill_rows() {
  for (std::size_t i = 0; i < target_cells_.size(); ++i) {
    const auto cell = static_cast<std::size_t>(target_cells_[i]);
    distances_[cell] = 0.0F;
    if (!nearest_.empty()) {
      nearest_[cell] = static_cast<std::int32_t>(i);
    }
  }
  for (int row = margin_cells_; row < height_ - margin_cells_; ++row) {
    float* const distance = &distances_[at(row, 0, width_)];
    for (int x = 1; x < width_; ++x) {
      distance[x] = std::min(distance[x], distance[x - 1] + 1.0F);
    }
    for (int x = width_ - 2; x >= 0; --x) {
      distance[x] = std::min(distance[x], distance[x + 1] + 1.0F);
    }
  }
}

void DistanceField::fill_columns() {
  Envelope envelope;
  std::vector<float> block(static_cast<std::size_t>(kBlock) * static_cast<std::size_t>(height_));
  for (int first = 0; first < width_; first += kBlock) {
    const int columns = std::min(kBlock, width_ - first);
    for (int row = 0; row < height_; ++row) {
      for (int k = 0; k < columns; ++k) {
        block[at(k, row, height_)] = distances_[at(row, first + k, width_)];
      }
    }
    for (int k = 0; k < columns; ++k) {
      fill_column(first + k, &block[at(k, 0, height_)], envelope);
    }
    for (int row = 0; row < height_; ++row) {
      for (int k = 0; k < columns; ++k) {
        distances_[at(row, first + k, width_)] = block[at(k, row, height_)];
      }
    }
  }
}

void DistanceField::fill_column(int column, float* distances, Envelope& envelope) {
  envelope.build(height_, distances);
  for (int row = 0; row < height_; ++row) {
    const auto& lowest = envelope.lowest_at(row);
    distances[row] = static_cast<float>(std::sqrt(square(lowest.row - row) + lowest.height));
    if (!nearest_.empty()) {
      // Targets keep distance 0 and their number, whichever columns are done.
      const int target_row = static_cast<int>(lowest.row);
      const int aside = static_cast<int>(std::sqrt(lowest.height));
      const bool left =
          column >= aside && distances_[at(target_row, column - aside, width_)] == 0.0F;
      nearest_[at(row, column, width_)] =
          nearest_[at(target_row, left ? column - aside : column + aside, width_)];
    }
  }
}

void DistanceField::fill_far() {
  Envelope envelope;
  const std::size_t field = distances_.size();
  distances_.resize(field + far_cells());
  std::vector<float> block(static_cast<std::size_t>(kBlock) * static_cast<std::size_t>(height_),
                           kNoTarget);
  for (int first = 0; first < far_width(); first += kBlock) {
    const int columns = std::min(kBlock, far_width() - first);
    for (int row = margin_cells_; row < height_ - margin_cells_; ++row) {
      for (int k = 0; k < columns; ++k) {
        const double x = (first + k + 0.5) * kFarCells - width_;
        const int nearest = nearest_in_row(row, x, kInfinity);
        block[at(k, row, height_)] =
            nearest < 0 ? kNoTarget : static_cast<float>(std::abs(nearest + 0.5 - x));
      }
    }
    for (int k = 0; k < columns; ++k) {
      envelope.build(height_, &block[at(k, 0, height_)]);
      for (int row = 0; row < far_height(); ++row) {
        const double y = (row + 0.5) * kFarCells - height_ - 0.5;  // rows are counted at centres
        const auto& lowest = envelope.lowest_at(y);
        distances_[field + at(row, first + k, far_width())] =
            static_cast<float>(std::sqrt(square(lowest.row - y) + lowest.height));
      }
    }
  }
}

double DistanceField::distance(const Vector<2>& p_world) const {
  const Vector<2> p = to_field(p_world);
  require_near(p, p_world);
  if (!(p.x() >= 0.0 && p.x() < width_ && p.y() >= 0.0 && p.y() < height_)) {
    return nearest(p_world).distance;
  }
  return grid_->resolution() *
         static_cast<double>(
             distances_[at(static_cast<int>(p.y()), static_cast<int>(p.x()), width_)]);
}

DistanceField::Neighbour DistanceField::nearest(const Vector<2>& p_world) const {
  const Vector<2> p = to_field(p_world);
  require_near(p, p_world);
  Neighbour found = nearest_in_field(p.x(), p.y());
  found.distance *= grid_->resolution();
  return found;
}

DistanceField::Neighbour DistanceField::nearest_in_field(double x, double y) const {
  const int column = internal::clamped_cell(x, width_);
  const int middle = internal::clamped_cell(y, height_);
  // The distance by way of the centre of the cell is an upper bound, which limits the rows to
  // search. It is widened for rounding, as the target may be exactly that far away.
  const double bound = static_cast<double>(distances_[at(middle, column, width_)]) +
                       (Vector<2>(column + 0.5, middle + 0.5) - Vector<2>(x, y)).norm();
  double best = square(kBoundFactor * bound + kBoundMargin);
  std::size_t found = 0;
  const auto look = [&](int row) {
    const double above = square(row + 0.5 - y);
    if (row < 0 || row >= height_ || above >= best) {
      return false;
    }
    const int nearest = nearest_in_row(row, x, std::sqrt(best - above));
    if (nearest >= 0) {
      best = square(nearest + 0.5 - x) + above;
      found = at(row, nearest, width_);
    }
    return true;
  };
  look(middle);
  bool up = true;
  bool down = true;
  for (int step = 1; up || down; ++step) {
    up = up && look(middle + step);
    down = down && look(middle - step);
  }
  return {target_at(found), std::sqrt(best)};
}

/// Column of the target in a row of the field that is nearest to x and nearer than `within`, or -1.
int DistanceField::nearest_in_row(int row, double x, double within) const {
  const float* const distance = &distances_[at(row, 0, width_)];
  const int start = internal::clamped_cell(x, width_);
  int found = -1;
  for (const int side : {1, -1}) {
    // No target is nearer to a cell than its distance, so that many cells can be skipped.
    for (int column = start; column >= 0 && column < width_;
         column += side * static_cast<int>(distance[column])) {
      const double off = std::abs(column + 0.5 - x);
      if (off >= within) {
        break;
      }
      if (distance[column] == 0.0F) {
        found = column;
        within = off;
        break;
      }
    }
  }
  return found;
}

std::int32_t DistanceField::target_at(std::size_t cell) const {
  if (!nearest_.empty()) {
    return nearest_[cell];
  }
  const auto found =
      std::lower_bound(target_cells_.begin(), target_cells_.end(), static_cast<std::int32_t>(cell));
  return static_cast<std::int32_t>(found - target_cells_.begin());
}

}  // namespace locfuse
