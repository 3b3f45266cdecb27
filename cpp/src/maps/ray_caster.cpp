// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/ray_caster.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "maps/cells.hpp"
#include "maps/given.hpp"

namespace locfuse {
namespace {

using internal::kInfinity;
/// Limits of RayCaster.
struct RayCasterLimits {
  static constexpr int kMaxRings = 255;  // largest number of a byte
  static constexpr int kMaxBeams = 1'000'000;
  /// Distance of a beam's start from the map [cells]: a double does not resolve cells well beyond
  /// it.
  static constexpr double kMaxDistance = 1e9;
  /// Direction along an axis below which its inverse may be infinite.
  static constexpr double kMinSlope = 1e-290;
};

/// One axis of a beam: coordinates start + t * along, t in cells from its start.
struct Axis {
  double start;
  double along;
  double per_cell;
  int size;

  Axis(double from, double towards, int cells)
      : start(from),
        along(std::abs(towards) < RayCasterLimits::kMinSlope ? 0.0 : towards),
        per_cell(along == 0.0 ? kInfinity : 1.0 / along),
        size(cells) {}

  [[nodiscard]] bool rises() const { return along >= 0.0; }
  [[nodiscard]] double enters() const {
    return along == 0.0 ? -kInfinity : at_edge(rises() ? 0 : size);
  }
  [[nodiscard]] double leaves() const {
    if (along == 0.0) {
      return start >= 0.0 && start < size ? kInfinity : -kInfinity;
    }
    return at_edge(rises() ? size : 0);
  }
  [[nodiscard]] double at_edge(int edge) const { return (edge - start) * per_cell; }
  [[nodiscard]] int cell_at(double t) const { return static_cast<int>(start + t * along); }
};

/// Limits the rings of each cell to one more than those of the cells before it and below it.
void grow(std::vector<std::uint8_t>& rings, int width, int height) {
  for (int row = 0; row < height; ++row) {
    std::uint8_t* const here =
        &rings[static_cast<std::size_t>(row) * static_cast<std::size_t>(width)];
    for (int column = 0; column < width; ++column) {
      int rings_around = column > 0 ? here[column - 1] : RayCasterLimits::kMaxRings;
      if (row > 0) {
        const std::uint8_t* const below = here - width;
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, width - 1); ++c) {
          rings_around = std::min<int>(rings_around, below[c]);
        }
      }
      here[column] = static_cast<std::uint8_t>(std::min<int>(here[column], rings_around + 1));
    }
  }
}

/// Whether a beam may start at a point in the grid frame.
bool is_near(const Vector<2>& p) { return (p.array().abs() < RayCasterLimits::kMaxDistance).all(); }

void require_finite(const char* what, double value, const char* unit) {
  if (!std::isfinite(value)) {
    throw std::invalid_argument(std::string(what) + " is " + std::to_string(value) + " " + unit +
                                ", expected a finite number");
  }
}

}  // namespace

RayCaster::RayCaster(const std::shared_ptr<const OccupancyGrid>& grid, bool unknown_stops)
    : grid_(internal::given(grid, "RayCaster")), clear_(grid_->cells().size()) {
  std::transform(grid_->cells().begin(), grid_->cells().end(), clear_.begin(), [&](Cell cell) {
    const bool stops = cell == Cell::kOccupied || (unknown_stops && cell == Cell::kUnknown);
    return static_cast<std::uint8_t>(stops ? 0 : RayCasterLimits::kMaxRings);
  });
  grow(clear_, grid_->width(), grid_->height());
  std::reverse(clear_.begin(), clear_.end());
  grow(clear_, grid_->width(), grid_->height());
  std::reverse(clear_.begin(), clear_.end());
}

double RayCaster::cast(const Vector<2>& p_world, double heading, double max_range) const {
  return range_from(start_of(p_world, max_range), heading, max_range);
}

std::vector<double> RayCaster::scan(const Pose2& T_world_laser, double angle_min,
                                    double angle_increment, int count, double max_range) const {
  const Vector<2> start = start_of(T_world_laser.position(), max_range);
  require_finite("angle_min", angle_min, "rad");
  require_finite("angle_increment", angle_increment, "rad");
  if (count < 0 || count > RayCasterLimits::kMaxBeams) {
    throw std::invalid_argument("count is " + std::to_string(count) + ", expected 0 to 1000000");
  }
  std::vector<double> ranges(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const double heading = T_world_laser.heading + (angle_min + i * angle_increment);
    ranges[static_cast<std::size_t>(i)] = range_from(start, heading, max_range);
  }
  return ranges;
}

bool RayCaster::reaches(const Vector<2>& p_world) const { return is_near(grid_->to_grid(p_world)); }

/// Start in the grid frame, in cells.
Vector<2> RayCaster::start_of(const Vector<2>& p_world, double max_range) const {
  Vector<2> start = grid_->to_grid(p_world);
  if (!is_near(start)) {
    throw std::invalid_argument("position is (" + std::to_string(p_world.x()) + ", " +
                                std::to_string(p_world.y()) +
                                ") m, expected finite numbers, less than 1e9 cells from the map");
  }
  if (!(max_range >= 0.0)) {
    throw std::invalid_argument("max_range is " + std::to_string(max_range) +
                                " m, expected 0 or more");
  }
  return start;
}

double RayCaster::range_from(const Vector<2>& start, double heading, double max_range) const {
  const double turned = heading - grid_->origin().heading;
  require_finite("heading", turned, "rad");
  const Vector<2> along(std::cos(turned), std::sin(turned));
  // One cell more, so that rounding at the end of the beam misses none.
  const double reach = max_range / grid_->resolution() + 1.0;
  const double range = cells_to_hit(start, along, reach) * grid_->resolution();
  if (range > max_range) {
    return kInfinity;
  }
  return range;
}

/// Steps from cell to cell, over all clear rings around one.
///
/// J. Amanatides and A. Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987,
/// is the case of one ring.
double RayCaster::cells_to_hit(const Vector<2>& start, const Vector<2>& along, double reach) const {
  const Axis x(start.x(), along.x(), grid_->width());
  const Axis y(start.y(), along.y(), grid_->height());
  double travelled = std::max({0.0, x.enters(), y.enters()});
  const double end = std::min({reach, x.leaves(), y.leaves()});
  if (!(travelled <= end)) {
    return kInfinity;
  }
  int column = internal::clamped_cell(x.start + travelled * x.along, x.size);
  int row = internal::clamped_cell(y.start + travelled * y.along, y.size);
  while (grid_->contains(column, row)) {
    const int rings = clear_[static_cast<std::size_t>(row) * static_cast<std::size_t>(x.size) +
                             static_cast<std::size_t>(column)];
    if (rings == 0) {
      return travelled;
    }
    const double out_x = x.at_edge(column + (x.rises() ? rings : 1 - rings));
    const double out_y = y.at_edge(row + (y.rises() ? rings : 1 - rings));
    const bool sideways = out_x <= out_y;
    travelled = sideways ? out_x : out_y;
    if (travelled > end) {
      break;
    }
    // Only one edge is crossed at a time: through a corner a beam might pass between two cells.
    const int last = rings - 1;
    const int beside_x = std::clamp(x.cell_at(travelled), column - last, column + last);
    const int beside_y = std::clamp(y.cell_at(travelled), row - last, row + last);
    column = sideways ? column + (x.rises() ? rings : -rings) : beside_x;
    row = sideways ? beside_y : row + (y.rises() ? rings : -rings);
  }
  return kInfinity;
}

}  // namespace locfuse
