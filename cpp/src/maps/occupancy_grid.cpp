// SPDX-License-Identifier: Apache-2.0
#include "locfuse/maps/occupancy_grid.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace locfuse {
namespace {

constexpr std::size_t kMaxCells = std::size_t{1} << 28;  // indices fit an int, also with a margin
constexpr double kMinResolution = 1e-6;                  // [m]
constexpr double kMaxResolution = 1e6;                   // [m]
constexpr double kMaxOrigin = 1e9;                       // magnitude of its numbers [m], [rad]

[[noreturn]] void refuse(const char* what, double value, const char* expected) {
  std::ostringstream text;
  text << what << " is " << value << ", expected " << expected;
  throw std::invalid_argument(text.str());
}

}  // namespace

OccupancyGrid::OccupancyGrid(int width, int height, double resolution, const Pose2& origin,
                             std::vector<Cell> cells)
    : width_(width),
      height_(height),
      resolution_(resolution),
      origin_(origin),
      grid_from_world_(inverse(origin)),
      cells_(std::move(cells)) {
  if (width < 1 || height < 1 ||
      static_cast<std::size_t>(width) > kMaxCells / static_cast<std::size_t>(height)) {
    refuse(width < 1 ? "OccupancyGrid.width" : "OccupancyGrid.height", width < 1 ? width : height,
           "1 or more, and at most 2^28 cells in all");
  }
  if (!(resolution >= kMinResolution && resolution <= kMaxResolution)) {
    refuse("OccupancyGrid.resolution [m]", resolution, "1e-6 to 1e6");
  }
  for (const double value : {origin.x, origin.y, origin.heading}) {
    if (!(std::abs(value) <= kMaxOrigin)) {
      refuse("OccupancyGrid.origin", value, "numbers from -1e9 to 1e9");
    }
  }
  if (cells_.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    refuse("number of OccupancyGrid.cells", static_cast<double>(cells_.size()), "width * height");
  }
  for (const Cell cell : cells_) {
    if (cell != Cell::kFree && cell != Cell::kOccupied && cell != Cell::kUnknown) {
      refuse("an OccupancyGrid.cell", static_cast<int>(cell),
             "0 (free), 100 (occupied) or -1 (unknown)");
    }
  }
}

Vector<2> OccupancyGrid::to_grid(const Vector<2>& p_world) const {
  return grid_from_world_.act(p_world) / resolution_;
}

Vector<2> OccupancyGrid::to_world(const Vector<2>& p_grid) const {
  return origin_.act(resolution_ * p_grid);
}

bool OccupancyGrid::contains(const Vector<2>& p_world) const {
  const Vector<2> p = to_grid(p_world);
  return p.x() >= 0.0 && p.x() < width_ && p.y() >= 0.0 && p.y() < height_;
}

Cell OccupancyGrid::at(const Vector<2>& p_world) const {
  const Vector<2> p = to_grid(p_world);
  return contains(p_world) ? at(static_cast<int>(p.x()), static_cast<int>(p.y())) : Cell::kUnknown;
}

}  // namespace locfuse
