// SPDX-License-Identifier: Apache-2.0
#include "frontends/wall_outlines.hpp"

#include <array>
#include <cstdint>
#include <optional>
#include <utility>

namespace locfuse::internal {
namespace {

/// Side of a free cell: 0 is the lower one, which runs to the right, 1 the right one, which runs
/// up, and so on around the cell.
struct CellSide {
  int column;
  int row;
  int side;
};

constexpr std::array<int, 4> kRight{1, 0, -1, 0};  // columns along a side
constexpr std::array<int, 4> kUp{0, 1, 0, -1};     // rows along it; side + 3 leads out of the cell

/// A bit for each side of each cell.
class EdgeSet {
 public:
  explicit EdgeSet(const OccupancyGrid& grid)
      : width_(grid.width()), bits_(grid.cells().size(), std::uint8_t{0}) {}

  [[nodiscard]] bool has(const CellSide& edge) const { return (at(edge) & bit(edge)) != 0; }
  void insert(const CellSide& edge) { at(edge) = static_cast<std::uint8_t>(at(edge) | bit(edge)); }
  void erase(const CellSide& edge) { at(edge) = static_cast<std::uint8_t>(at(edge) & ~bit(edge)); }

 private:
  [[nodiscard]] std::size_t index(const CellSide& edge) const {
    return static_cast<std::size_t>(edge.row) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(edge.column);
  }
  [[nodiscard]] std::uint8_t at(const CellSide& edge) const { return bits_[index(edge)]; }
  [[nodiscard]] std::uint8_t& at(const CellSide& edge) { return bits_[index(edge)]; }
  [[nodiscard]] static int bit(const CellSide& edge) { return 1 << edge.side; }

  int width_;
  std::vector<std::uint8_t> bits_;
};

class Outlines {
 public:
  explicit Outlines(const OccupancyGrid& grid) : grid_(grid), left_(grid), followed_(grid) {
    each_edge([&](const CellSide& edge) {
      if (is_wall(edge)) {
        left_.insert(edge);
      }
    });
    each_edge([&](const CellSide& edge) {
      if (const std::optional<CellSide> next = left_.has(edge) ? after(edge) : std::nullopt) {
        followed_.insert(*next);
      }
    });
  }

  [[nodiscard]] std::vector<std::vector<Vector<2>>> ways() {
    std::vector<std::vector<Vector<2>>> ways;
    const auto follow = [&](const CellSide& first) {
      std::vector<Vector<2>> way{world(first)};
      for (std::optional<CellSide> edge = first; edge && left_.has(*edge); edge = after(*edge)) {
        left_.erase(*edge);
        way.push_back(world({edge->column, edge->row, (edge->side + 1) % 4}));
      }
      ways.push_back(std::move(way));
    };
    each_edge([&](const CellSide& edge) {
      if (left_.has(edge) && !followed_.has(edge)) {
        follow(edge);
      }
    });
    each_edge(
        [&](const CellSide& edge) {  // what is left is closed, and bends to the left somewhere
          const std::optional<CellSide> next = left_.has(edge) ? after(edge) : std::nullopt;
          if (next && next->side != edge.side) {
            follow(*next);
          }
        });
    return ways;
  }

 private:
  template <class Visit>
  void each_edge(const Visit& visit) const {
    for (int row = 0; row < grid_.height(); ++row) {
      for (int column = 0; column < grid_.width(); ++column) {
        if (grid_.at(column, row) == Cell::kFree) {
          for (int side = 0; side < 4; ++side) {
            visit(CellSide{column, row, side});
          }
        }
      }
    }
  }

  /// The cell that a side of a cell faces.
  [[nodiscard]] static CellSide across(const CellSide& edge) {
    const auto out = static_cast<std::size_t>((edge.side + 3) % 4);
    return {edge.column + kRight[out], edge.row + kUp[out], edge.side};
  }
  [[nodiscard]] static CellSide ahead(const CellSide& edge) {
    const auto side = static_cast<std::size_t>(edge.side);
    return {edge.column + kRight[side], edge.row + kUp[side], edge.side};
  }
  [[nodiscard]] Cell cell(const CellSide& edge) const { return grid_.at(edge.column, edge.row); }
  [[nodiscard]] bool is_wall(const CellSide& edge) const {
    return cell(across(edge)) == Cell::kOccupied;
  }

  /// The edge that a wall's edge leads to, if that is one of a wall.
  [[nodiscard]] std::optional<CellSide> after(const CellSide& edge) const {
    CellSide next{edge.column, edge.row, (edge.side + 1) % 4};  // a corner of the free space
    if (const CellSide straight = ahead(edge); cell(straight) == Cell::kFree) {
      const CellSide beyond = across(straight);
      next = cell(beyond) == Cell::kFree ? CellSide{beyond.column, beyond.row, (edge.side + 3) % 4}
                                         : straight;
    }
    return is_wall(next) ? std::optional(next) : std::nullopt;
  }

  /// Where an edge begins.
  [[nodiscard]] Vector<2> world(const CellSide& edge) const {
    const int right = edge.side == 1 || edge.side == 2 ? 1 : 0;
    const int up = edge.side >= 2 ? 1 : 0;
    return grid_.to_world({edge.column + right, edge.row + up});
  }

  const OccupancyGrid& grid_;
  EdgeSet left_;
  EdgeSet followed_;
};

}  // namespace

std::vector<std::vector<Vector<2>>> wall_outlines(const OccupancyGrid& grid) {
  return Outlines(grid).ways();
}

}  // namespace locfuse::internal
