// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/scan_map.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "frontends/kd_tree.hpp"
#include "maps/given.hpp"

namespace locfuse {
namespace {

/// Occupied cells that touch a cell for which `open` holds.
template <class Open>
std::vector<std::uint8_t> touching(const OccupancyGrid& grid, const Open& open) {
  std::vector<std::uint8_t> found(grid.cells().size(), 0);
  std::size_t cell = 0;
  for (int row = 0; row < grid.height(); ++row) {
    for (int column = 0; column < grid.width(); ++column, ++cell) {
      if (grid.at(column, row) != Cell::kOccupied) {
        continue;
      }
      for (int i = 0; i < 9 && found[cell] == 0; ++i) {
        found[cell] = static_cast<std::uint8_t>(open(grid.at(column + i % 3 - 1, row + i / 3 - 1)));
      }
    }
  }
  return found;
}

std::vector<std::uint8_t> surface_cells(const OccupancyGrid& grid) {
  std::vector<std::uint8_t> surface = touching(grid, [](Cell cell) { return cell == Cell::kFree; });
  if (std::find(surface.begin(), surface.end(), 1) == surface.end()) {  // a map without free cells
    surface = touching(grid, [](Cell cell) { return cell != Cell::kOccupied; });
  }
  if (std::find(surface.begin(), surface.end(), 1) == surface.end()) {
    throw std::invalid_argument(
        "the map has 0 occupied cells that a beam can reach, expected at "
        "least 1");
  }
  return surface;
}

/// Constants of the wall lines of a map; docs/models/scans.md eq. (1.3). Values without
/// another source are empirical.
struct WallLineTuning {
  /// Half the window that a line is fitted to, standard deviation of its weights and their sum
  /// [cells].
  static constexpr int kReach = 3;
  static constexpr double kWeightSigma = 1.5;
  static constexpr double kFittedCells = 5.0;
  static constexpr int kMinCells = 3;
  /// Maximum counted length of a run [cells].
  static constexpr int kMaxRun = 200;
  /// Maximum spread across a line, as a share of that along it. A straight wall, rounded to cells,
  /// has 0.05, a column of 30 cm in cells of 5 cm 0.15, a right corner 0.37.
  static constexpr double kMaxFlatness = 0.2;
  /// Cells face opposite sides from this product of their directions to free space on [cells^2]. A
  /// cell of a solid wall has a direction of length 15; in a wall of one or two cells, free on both
  /// sides, neighbours have lengths up to 5 in opposite directions and are one wall.
  static constexpr double kOppositeProduct = 50.0;
  /// Maximum spread of all the cells of a thin pole [cells^2].
  static constexpr double kMaxPoleSpread = 0.8;
};

/// Direction from a cell to the free space around it; near zero in a wall that is free on both
/// sides.
Vector<2> to_free(const OccupancyGrid& grid, int column, int row) {
  Vector<2> sum = Vector<2>::Zero();
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      if (grid.at(column + dx, row + dy) == Cell::kFree) {
        sum += Vector<2>(dx, dy);
      }
    }
  }
  return sum;
}

/// Weighted principal axis of the surface cells around one that face the same side.
class LineFit {
 public:
  explicit LineFit(const DistanceField& surface) : surface_(surface) {
    for (int i = 0; i < surface.targets(); ++i) {
      facing_.push_back(to_free(surface.grid(), cell(i).x(), cell(i).y()));
    }
    for (int k = 0; k <= 2 * WallLineTuning::kReach * WallLineTuning::kReach; ++k) {
      weights_.push_back(
          std::exp(-0.5 * k / (WallLineTuning::kWeightSigma * WallLineTuning::kWeightSigma)));
    }
  }

  [[nodiscard]] ScanMap::WallLine line_at(int target) const {
    Vector<2> mean = Vector<2>::Zero();
    Matrix<2, 2> scatter = Matrix<2, 2>::Zero();
    double weight = 0.0;
    int cells = 0;
    for (int dy = -WallLineTuning::kReach; dy <= WallLineTuning::kReach; ++dy) {
      for (int dx = -WallLineTuning::kReach; dx <= WallLineTuning::kReach; ++dx) {
        if (same_side(target, dx, dy)) {
          const int squared = dx * dx + dy * dy;
          const double w = weights_[static_cast<std::size_t>(squared)];
          const Vector<2> d(dx, dy);
          mean += w * d;
          scatter += w * d * d.transpose();
          weight += w;
          ++cells;
        }
      }
    }
    mean /= weight;
    scatter = scatter / weight - mean * mean.transpose();
    const double half = 0.5 * (scatter(0, 0) - scatter(1, 1));
    const double spread = std::hypot(half, scatter(0, 1));
    const double long_axis = 0.5 * scatter.trace() + spread;
    const double short_axis = 0.5 * scatter.trace() - spread;
    ScanMap::WallLine line{
        surface_.center(target) + mean, Vector<2>::Zero(),
        scatter.trace() < WallLineTuning::kMaxPoleSpread ? WallLineTuning::kFittedCells : 0.0};
    if (cells >= WallLineTuning::kMinCells &&
        short_axis < WallLineTuning::kMaxFlatness * long_axis) {
      const double along = 0.5 * std::atan2(scatter(0, 1), half);
      line.normal = {-std::sin(along), std::cos(along)};
      const Eigen::Vector2i step = grid_direction(line.normal);
      line.run = std::max(WallLineTuning::kFittedCells,
                          1.0 + run_to(target, step) + run_to(target, -step));
    }
    return line;
  }

 private:
  [[nodiscard]] Eigen::Vector2i cell(int target) const {
    return (surface_.center(target).array() - surface_.margin_cells()).cast<int>();
  }

  /// Step from cell to cell along a wall with this normal: to a side or to a corner.
  [[nodiscard]] static Eigen::Vector2i grid_direction(const Vector<2>& normal) {
    constexpr double kSineBetween = 0.38268343;  // of 22.5 degrees
    const auto part = [](double value) {
      return value > kSineBetween ? 1 : value < -kSineBetween ? -1 : 0;
    };
    return {part(-normal.y()), part(normal.x())};
  }

  /// Number of contiguous surface cells from the target on in one direction.
  [[nodiscard]] int run_to(int target, const Eigen::Vector2i& step) const {
    int cells = 0;
    while (cells < WallLineTuning::kMaxRun &&
           same_side(target, (cells + 1) * step.x(), (cells + 1) * step.y())) {
      ++cells;
    }
    return cells;
  }

  [[nodiscard]] bool same_side(int target, int dx, int dy) const {
    const int column = static_cast<int>(surface_.center(target).x()) + dx;
    const int row = static_cast<int>(surface_.center(target).y()) + dy;
    if (column < 0 || column >= surface_.width() || row < 0 || row >= surface_.height()) {
      return false;
    }
    const std::size_t at =
        static_cast<std::size_t>(row) * static_cast<std::size_t>(surface_.width()) +
        static_cast<std::size_t>(column);
    if (surface_.distances()[at] > 0.0F) {
      return false;
    }
    const Vector<2>& here = facing_[static_cast<std::size_t>(target)];
    const Vector<2>& there = facing_[static_cast<std::size_t>(surface_.nearest_targets()[at])];
    return here.dot(there) >= -WallLineTuning::kOppositeProduct;
  }

  const DistanceField& surface_;
  std::vector<Vector<2>> facing_;
  std::vector<double> weights_;
};

ScanMap::CompactLine compact(const ScanMap::WallLine& line) {
  return {static_cast<float>(line.point.x()), static_cast<float>(line.point.y()),
          static_cast<float>(line.normal.x()), static_cast<float>(line.normal.y()),
          static_cast<float>(line.run)};
}

/// In the field frame, in cells: a float would not resolve world coordinates far away.
std::vector<Vector<2>> centers_of(const DistanceField& occupied) {
  std::vector<Vector<2>> centers;
  centers.reserve(static_cast<std::size_t>(occupied.targets()));
  for (int i = 0; i < occupied.targets(); ++i) {
    centers.push_back(occupied.center(i));
  }
  return centers;
}

}  // namespace

ScanMap::ScanMap(const std::shared_ptr<const OccupancyGrid>& grid)
    : occupied_(internal::given(grid, "ScanMap"), kMargin, DistanceField::Extra::kSurroundings),
      surface_(grid, surface_cells(*grid), kMargin, DistanceField::Extra::kNearestTargets),
      tree_(std::make_unique<internal::KdTree>(centers_of(occupied_))) {
  const LineFit fit(surface_);
  lines_.reserve(static_cast<std::size_t>(surface_.targets()));
  for (int i = 0; i < surface_.targets(); ++i) {
    lines_.push_back(fit.line_at(i));
    compact_lines_.push_back(compact(lines_.back()));
  }
}

ScanMap::~ScanMap() = default;

double ScanMap::nearest_by_kdtree(const Vector<2>& p_world) const {
  const Vector<2> p = occupied_.to_field(p_world);
  if (!(p.cwiseAbs().maxCoeff() < 1e6)) {  // squares of floats must not overflow
    throw std::invalid_argument("position is (" + std::to_string(p_world.x()) + ", " +
                                std::to_string(p_world.y()) +
                                ") m, expected less than a million cells from the map");
  }
  std::vector<int> index;
  tree_->nearest({p}, index);
  const double distance = (occupied_.center(index[0]) - p).norm();
  return grid().resolution() * distance;
}

}  // namespace locfuse
