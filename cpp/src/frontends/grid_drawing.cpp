// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/grid_drawing.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "frontends/scan_lines.hpp"
#include "math/refuse.hpp"

namespace locfuse {
namespace {

using internal::LinePoint;
using internal::refuse;

/// Constants of drawing; docs/map.md eq. (1) and (2).
struct GridDrawingTuning {
  /// Log odds of a beam that ends in a cell (0.7) and of one that passes (0.4), as OctoMap has
  /// them.
  static constexpr double kHit = 0.8473;
  static constexpr double kMiss = 0.4055;
  /// A beam says nothing of cells closer than this to the surface that it meets [cells].
  static constexpr double kBeforeWall = 1.0;
  /// Minimum cosine of the angle at which a beam meets a surface.
  static constexpr double kMinCosine = 0.05;
  static constexpr double kSigmaRange = 0.01;  ///< by which lines are fitted through ends [m]
  static constexpr double kMaxCells = 268435456.0;
  static constexpr double kMinResolution = 1e-3;  ///< [m]
  static constexpr double kMaxResolution = 10.0;  ///< [m]
};

/// A beam in world: from the laser to the end, and how far it surely is free [m].
struct DrawnBeam {
  Vector<2> from;
  Vector<2> to;
  double free;
};

std::vector<DrawnBeam> rays_of(const std::vector<PlacedScan>& scans, double resolution) {
  std::vector<DrawnBeam> rays;
  for (const PlacedScan& placed : scans) {
    if (!std::isfinite(placed.pose.x + placed.pose.y + placed.pose.heading)) {
      throw std::invalid_argument("pose of a scan is not finite");
    }
    const Vector<2> from = placed.pose.act(placed.scan.geometry->pose_in_body.position());
    for (const LinePoint& point :
         internal::line_points(placed.scan, GridDrawingTuning::kSigmaRange)) {
      const LinePoint in_world = internal::moved(point, placed.pose);
      const Vector<2> along = in_world.end - from;
      const double length = along.norm();
      double cosine = 1.0;
      if (length > 0.0 && in_world.normal.squaredNorm() > 0.5) {
        cosine =
            std::max(std::abs(in_world.normal.dot(along)) / length, GridDrawingTuning::kMinCosine);
      }
      rays.push_back(
          {from, in_world.end, length - GridDrawingTuning::kBeforeWall * resolution / cosine});
    }
  }
  return rays;
}

/// Cells that beams end in and pass.
class Drawing {
 public:
  Drawing(int width, int height, double resolution, const Pose2& origin)
      : frame_(1, 1, resolution, origin, {Cell::kUnknown}),
        width_(width),
        height_(height),
        odds_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), kNothing) {}

  void draw(const DrawnBeam& ray) {
    const Vector<2> from = frame_.to_grid(ray.from);
    const Vector<2> to = frame_.to_grid(ray.to);
    clear(from, to, ray.free / frame_.resolution());
    add(static_cast<int>(std::floor(to.x())), static_cast<int>(std::floor(to.y())),
        GridDrawingTuning::kHit);
  }

  [[nodiscard]] std::vector<Cell> cells() const {
    std::vector<Cell> cells(odds_.size(), Cell::kUnknown);
    std::transform(odds_.begin(), odds_.end(), cells.begin(), [](float odds) {
      return odds == kNothing ? Cell::kUnknown : odds > 0.0F ? Cell::kOccupied : Cell::kFree;
    });
    return cells;
  }

 private:
  static constexpr float kNothing = -std::numeric_limits<float>::max();

  void add(int column, int row, double odds) {
    if (column < 0 || column >= width_ || row < 0 || row >= height_) {
      return;
    }
    float& cell = odds_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                        static_cast<std::size_t>(column)];
    cell = (cell == kNothing ? 0.0F : cell) + static_cast<float>(odds);
  }

  /// Cells that a beam enters within `length` [cells], one after the other.
  void clear(const Vector<2>& from, const Vector<2>& to, double length) {
    const double whole = (to - from).norm();
    if (!(length > 0.0) || !(whole > 0.0)) {
      return;
    }
    const Vector<2> along = (to - from) / whole;
    Eigen::Vector2i cell = from.array().floor().matrix().cast<int>();
    const Eigen::Vector2i last = to.array().floor().matrix().cast<int>();
    Eigen::Vector2i step;
    Vector<2> next;   // length at which the next column or row begins
    Vector<2> every;  // length from one to the next
    for (int axis = 0; axis < 2; ++axis) {
      step(axis) = along(axis) > 0.0 ? 1 : -1;
      every(axis) = along(axis) != 0.0 ? 1.0 / std::abs(along(axis))
                                       : std::numeric_limits<double>::infinity();
      const double edge = cell(axis) + (along(axis) > 0.0 ? 1.0 : 0.0);
      next(axis) = along(axis) != 0.0 ? (edge - from(axis)) / along(axis)
                                      : std::numeric_limits<double>::infinity();
    }
    for (double at = 0.0; at < length && cell != last;) {
      add(cell.x(), cell.y(), -GridDrawingTuning::kMiss);
      const int axis = next.x() < next.y() ? 0 : 1;
      at = next(axis);
      next(axis) += every(axis);
      cell(axis) += step(axis);
    }
  }

  OccupancyGrid frame_;
  int width_;
  int height_;
  std::vector<float> odds_;
};

int cells_of(const Vector<2>& size, int axis, double other) {
  const double cells = std::floor(size(axis)) + 1.0;
  if (!(cells * other <= GridDrawingTuning::kMaxCells)) {
    throw std::invalid_argument(
        "the map would have more than 2^28 cells; draw it coarser, or look "
        "for a scan that is far away");
  }
  return static_cast<int>(cells);
}

}  // namespace

OccupancyGrid draw_grid(const std::vector<PlacedScan>& scans, double resolution_m,
                        const std::shared_ptr<const OccupancyGrid>& onto) {
  const double resolution = onto ? onto->resolution() : resolution_m;
  if (!(resolution >= GridDrawingTuning::kMinResolution &&
        resolution <= GridDrawingTuning::kMaxResolution)) {
    refuse("resolution of a map [m]", resolution, "0.001 to 10");
  }
  const std::vector<DrawnBeam> rays = rays_of(scans, resolution);
  if (rays.empty() && !onto) {
    throw std::invalid_argument("there is nothing to draw: no scan has a return");
  }
  const OccupancyGrid frame(1, 1, resolution, onto ? onto->origin() : Pose2{}, {Cell::kUnknown});
  Vector<2> low = Vector<2>::Zero();
  Vector<2> high = Vector<2>::Zero();
  if (onto) {
    high = {onto->width() - 1.0, onto->height() - 1.0};
  } else {
    low = high = frame.to_grid(rays.front().to);
  }
  for (const DrawnBeam& ray : rays) {
    for (const Vector<2>& end : {frame.to_grid(ray.from), frame.to_grid(ray.to)}) {
      low = low.cwiseMin(end);
      high = high.cwiseMax(end);
    }
  }
  low = low.array().floor();
  const int width = cells_of(high - low, 0, 1.0);
  const int height = cells_of(high - low, 1, width);
  const Vector<2> corner = frame.to_world(low);
  const Pose2 origin{corner.x(), corner.y(), frame.origin().heading};
  Drawing drawing(width, height, resolution, origin);
  for (const DrawnBeam& ray : rays) {
    drawing.draw(ray);
  }
  std::vector<Cell> cells = drawing.cells();
  if (onto) {
    const int left = static_cast<int>(-low.x());
    const int below = static_cast<int>(-low.y());
    for (int row = 0; row < onto->height(); ++row) {
      for (int column = 0; column < onto->width(); ++column) {
        Cell& cell = cells[static_cast<std::size_t>(row + below) * static_cast<std::size_t>(width) +
                           static_cast<std::size_t>(column + left)];
        cell = cell == Cell::kUnknown ? onto->at(column, row) : cell;
      }
    }
  }
  return {width, height, resolution, origin, std::move(cells)};
}

}  // namespace locfuse
