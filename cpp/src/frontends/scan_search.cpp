// SPDX-License-Identifier: Apache-2.0
#include "frontends/scan_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace locfuse::internal {
namespace {

constexpr std::size_t kBlock = 8;  // loops of known length become vector instructions

/// Constants of the coarse search; docs/models/scans.md, "Power-up". Values without another
/// source are empirical.
struct ScanSearchTuning {
  /// Beams that score a place, spread evenly over the scan.
  static constexpr std::size_t kCoarseBeams = 64;
  /// Headings around the full circle.
  static constexpr int kHeadings = 90;
  /// Maximum number of places along x or y, an odd number.
  static constexpr int kMaxSteps = 11;
  /// Finest step of a grid over x and y [cells].
  static constexpr double kMinStep = 2.0;
  /// Part of the window that is searched [standard deviations of the prior].
  static constexpr double kWindowSigmas = 4.0;
  /// Tolerance of an end point [cells]: a constant, half the diagonal of a step, half a turn.
  static constexpr double kToleranceCells = 2.0;
  static constexpr double kStepDiagonal = 0.7;
  /// Maximum number of local minima that are refined further.
  static constexpr std::size_t kMaxMinima = 24;
  /// Maximum cost above the best one: share of beams that end elsewhere.
  static constexpr float kMaxExcessCost = 0.25F;
  /// Cost of a node outside the window; within it costs are at most 1.
  static constexpr float kOutsideCost = 2.0F;
};

/// Subset of the beams in single precision.
struct CoarseBeams {
  std::vector<float> x, y, range;
};

CoarseBeams subset_of(const Beams& beams) {
  CoarseBeams subset;
  const std::size_t count = beams.x.size();
  const std::size_t wanted = std::min(ScanSearchTuning::kCoarseBeams, count);
  for (std::size_t i = 0; i < wanted; ++i) {
    const std::size_t k = i * count / wanted;
    subset.x.push_back(static_cast<float>(beams.x[k]));
    subset.y.push_back(static_cast<float>(beams.y[k]));
    subset.range.push_back(static_cast<float>(beams.range[k]));
  }
  while (subset.x.size() % kBlock != 0) {  // repeats fill the last block
    subset.x.push_back(subset.x[subset.x.size() - wanted]);
    subset.y.push_back(subset.y[subset.y.size() - wanted]);
    subset.range.push_back(subset.range[subset.range.size() - wanted]);
  }
  return subset;
}

/// Mean over the beams of min(1, distance / tolerance)^2. The tolerance of a beam is two cells and
/// the distance by which half a step of the grid moves its end point.
class CoarseCost {
 public:
  CoarseCost(const DistanceField& field, const CoarseBeams& beams) : field_(field), beams_(beams) {
    x_.resize(beams.x.size());
    y_.resize(beams.x.size());
    per_tolerance_.resize(beams.x.size());
  }

  void set_steps(double heading_step, double step) {
    for (std::size_t i = 0; i < beams_.range.size(); ++i) {
      const double tolerance = ScanSearchTuning::kToleranceCells +
                               ScanSearchTuning::kStepDiagonal * step +
                               0.5 * heading_step * static_cast<double>(beams_.range[i]);
      per_tolerance_[i] =
          static_cast<float>(1.0 / std::min(tolerance, field_.margin_cells() - 1.0));
    }
  }

  void turn(double heading) {
    const auto c = static_cast<float>(std::cos(heading));
    const auto s = static_cast<float>(std::sin(heading));
    for (std::size_t i = 0; i < x_.size(); ++i) {
      x_[i] = c * beams_.x[i] - s * beams_.y[i];
      y_[i] = s * beams_.x[i] + c * beams_.y[i];
    }
  }

  [[nodiscard]] float at(double px, double py) const {
    const auto x0 = static_cast<float>(px);
    const auto y0 = static_cast<float>(py);
    const auto right = static_cast<float>(field_.width() - 1);
    const auto top = static_cast<float>(field_.height() - 1);
    const float* const distances = field_.distances().data();
    float sum = 0.0F;
    for (std::size_t i = 0; i < x_.size(); i += kBlock) {
      int index[kBlock];
      for (std::size_t k = 0; k < kBlock; ++k) {
        // Off the field the distance is at least the margin, which exceeds every tolerance. In this
        // order of arguments the NaN of an infinitely far end becomes 0.
        const float x = std::min(std::max(0.0F, x_[i + k] + x0), right);
        const float y = std::min(std::max(0.0F, y_[i + k] + y0), top);
        index[k] = static_cast<int>(y) * field_.width() + static_cast<int>(x);
      }
      for (std::size_t k = 0; k < kBlock; ++k) {
        const float d = std::min(distances[index[k]] * per_tolerance_[i + k], 1.0F);
        sum += d * d;
      }
    }
    return sum / static_cast<float>(x_.size());
  }

 private:
  const DistanceField& field_;
  const CoarseBeams& beams_;
  std::vector<float> x_, y_, per_tolerance_;
};

/// A window about the prior's mean, and the cost of each node, heading by heading.
struct Grid {
  Vector<2> first;
  Vector<2> step;
  std::array<int, 2> steps;
  std::vector<float> cost;

  [[nodiscard]] float at(int h, int iy, int ix) const {
    if (iy < 0 || iy >= steps[1] || ix < 0 || ix >= steps[0]) {
      return ScanSearchTuning::kOutsideCost;
    }
    const int row = (h + ScanSearchTuning::kHeadings) % ScanSearchTuning::kHeadings * steps[1] + iy;
    const int node = row * steps[0] + ix;
    return cost[static_cast<std::size_t>(node)];
  }
};

/// Grid over the part of the window that lies on the field.
Grid grid_over(const DistanceField& field, const Vector<2>& mean, const Vector<2>& half_window) {
  Grid grid;
  for (int axis = 0; axis < 2; ++axis) {
    const double size = axis == 0 ? field.width() : field.height();
    const double low = std::clamp(mean(axis) - half_window(axis), 0.0, size);
    const double half_width = 0.5 * (std::clamp(mean(axis) + half_window(axis), 0.0, size) - low);
    const int half = std::min(static_cast<int>(std::ceil(half_width / ScanSearchTuning::kMinStep)),
                              ScanSearchTuning::kMaxSteps / 2);
    grid.steps[static_cast<std::size_t>(axis)] = 2 * half + 1;
    grid.step(axis) = half > 0 ? half_width / half : 0.0;
    grid.first(axis) = low;
  }
  return grid;
}

/// Squared distance from the prior's mean, in sigmas.
double mahalanobis(const Prior& prior, const Pose2& pose) {
  const Vector<3> off = local(pose, prior.mean);
  return off.dot(prior.information * off);
}

void fill(Grid& grid, CoarseCost& coarse, const Prior& prior) {
  const int nodes = ScanSearchTuning::kHeadings * grid.steps[0] * grid.steps[1];
  grid.cost.reserve(static_cast<std::size_t>(nodes));
  for (int h = 0; h < ScanSearchTuning::kHeadings; ++h) {
    coarse.turn(h * 2.0 * kPi / ScanSearchTuning::kHeadings);
    for (int iy = 0; iy < grid.steps[1]; ++iy) {
      for (int ix = 0; ix < grid.steps[0]; ++ix) {
        const double x = grid.first.x() + ix * grid.step.x();
        const double y = grid.first.y() + iy * grid.step.y();
        const bool in_window = mahalanobis(prior, {x, y, prior.mean.heading}) <=
                               ScanSearchTuning::kWindowSigmas * ScanSearchTuning::kWindowSigmas;
        grid.cost.push_back(in_window ? coarse.at(x, y) : ScanSearchTuning::kOutsideCost);
      }
    }
  }
}

bool is_minimum(const Grid& grid, int h, int iy, int ix) {
  const float here = grid.at(h, iy, ix);
  for (int i = 0; i < 27; ++i) {
    const float there = grid.at(h + i / 9 - 1, iy + i / 3 % 3 - 1, ix + i % 3 - 1);
    if (i != 13 && (there < here || (there == here && i < 13))) {  // of equal ones the first
      return false;
    }
  }
  return here <= 1.0F;
}

struct Node {
  float cost;
  Pose2 pose;
};

std::vector<Node> minima_of(const Grid& grid) {
  std::vector<Node> minima;
  for (int h = 0; h < ScanSearchTuning::kHeadings; ++h) {
    for (int iy = 0; iy < grid.steps[1]; ++iy) {
      for (int ix = 0; ix < grid.steps[0]; ++ix) {
        if (is_minimum(grid, h, iy, ix)) {
          minima.push_back(
              {grid.at(h, iy, ix),
               {grid.first.x() + ix * grid.step.x(), grid.first.y() + iy * grid.step.y(),
                h * 2.0 * kPi / ScanSearchTuning::kHeadings}});
        }
      }
    }
  }
  std::sort(minima.begin(), minima.end(),
            [](const Node& a, const Node& b) { return a.cost < b.cost; });
  if (minima.size() > ScanSearchTuning::kMaxMinima) {
    minima.resize(ScanSearchTuning::kMaxMinima);
  }
  return minima;
}

/// Best of the 27 nodes around, a step away each.
Node best_around(CoarseCost& coarse, const Node& start, double heading_step,
                 const Vector<2>& step) {
  Node best{ScanSearchTuning::kOutsideCost, start.pose};
  for (int h = -1; h <= 1; ++h) {
    const double heading = start.pose.heading + h * heading_step;
    coarse.turn(heading);
    for (int i = 0; i < 9; ++i) {
      const int column = i % 3 - 1;
      const int row = i / 3 - 1;
      const double x = start.pose.x + column * step.x();
      const double y = start.pose.y + row * step.y();
      const float cost = coarse.at(x, y);
      if (cost < best.cost) {
        best = {cost, {x, y, heading}};
      }
    }
  }
  return best;
}

/// Minima close to the best cost, without duplicates.
std::vector<Pose2> separate(std::vector<Node> minima, double heading_step) {
  std::sort(minima.begin(), minima.end(),
            [](const Node& a, const Node& b) { return a.cost < b.cost; });
  std::vector<Pose2> poses;
  for (const Node& node : minima) {
    const Pose2 pose{node.pose.x, node.pose.y, wrap_angle(node.pose.heading)};
    const bool duplicate = std::any_of(poses.begin(), poses.end(), [&](const Pose2& other) {
      const Vector<3> off = local(pose, other);
      return off.head<2>().norm() < ScanSearchTuning::kMinStep && std::abs(off.z()) < heading_step;
    });
    if (!duplicate && node.cost <= minima.front().cost + ScanSearchTuning::kMaxExcessCost) {
      poses.push_back(pose);
    }
  }
  return poses;
}

}  // namespace

std::vector<Pose2> coarse_minima(const ScanMap& map, const Beams& beams, const Prior& prior,
                                 const Vector<2>& half_window) {
  const CoarseBeams subset = subset_of(beams);
  CoarseCost coarse(map.surface(), subset);
  Grid grid = grid_over(map.surface(), prior.mean.position(), half_window);
  double heading_step = 2.0 * kPi / ScanSearchTuning::kHeadings;
  Vector<2> step = grid.step;
  coarse.set_steps(heading_step, step.maxCoeff());
  fill(grid, coarse, prior);
  std::vector<Node> minima = minima_of(grid);
  do {
    heading_step *= 0.5;
    step *= 0.5;
    coarse.set_steps(heading_step, step.maxCoeff());
    for (Node& node : minima) {
      node = best_around(coarse, node, heading_step, step);
    }
  } while (step.maxCoeff() > ScanSearchTuning::kMinStep);
  return separate(std::move(minima), heading_step);
}

namespace {

/// Constants of the score of a pose; docs/models/scans.md eq. (1.8). Lengths in cells.
struct ScanScoreTuning {
  /// Length of wall whose end points share one error, or are hidden together.
  static constexpr double kCorrelatedWall = 7.0;
  /// Mean length of a beam in unknown space.
  static constexpr double kMeanFreeInUnknown = 20.0;
  /// Share of the cells that the map has wrong.
  static constexpr double kWrongCellShare = 0.01;
  /// Minimum length of a beam over which outliers are spread.
  static constexpr double kMinOutlierSpan = 20.0;
  /// Maximum distance of an explained end point from its wall, and the same in standard deviations:
  /// the larger one counts.
  static constexpr double kExplainedCells = 2.0;
  static constexpr double kExplainedSigmas = 3.0;
  /// Distance beyond the end of a wall line at which an end point still lies on it.
  static constexpr double kLineHalfLength = 2.0;
  /// Diagonal of a cell, by which the distance of its centre may be too short, rounded up; and the
  /// shortest step along a ray.
  static constexpr double kCellDiagonal = 1.42;
  static constexpr double kMinRayStep = 0.5;
};

/// Length at which a ray meets the first occupied cell, or `length` if it meets none.
double free_length(const DistanceField& field, const Vector<2>& from, const Vector<2>& along,
                   double length) {
  double at = 0.0;
  while (at < length) {
    const Vector<2> p = from + at * along;
    if (!(p.x() >= 0.0 && p.x() < field.width() && p.y() >= 0.0 && p.y() < field.height())) {
      return length;
    }
    const float distance =
        field
            .distances()[static_cast<std::size_t>(p.y()) * static_cast<std::size_t>(field.width()) +
                         static_cast<std::size_t>(p.x())];
    if (distance == 0.0F) {
      return at;
    }
    at += std::max(static_cast<double>(distance) - ScanScoreTuning::kCellDiagonal,
                   ScanScoreTuning::kMinRayStep);
  }
  return length;
}

/// Line of the wall at a point of the field.
const ScanMap::WallLine& wall_at(const ScanMap& map, const Vector<2>& p) {
  const DistanceField& field = map.surface();
  const auto x = static_cast<std::size_t>(std::min(std::max(0.0, p.x()), field.width() - 1.0));
  const auto y = static_cast<std::size_t>(std::min(std::max(0.0, p.y()), field.height() - 1.0));
  return map.lines()[static_cast<std::size_t>(
      field.nearest_targets()[y * static_cast<std::size_t>(field.width()) + x])];
}

/// Cost of one hypothesis, beam by beam; docs/models/scans.md eq. (1.8).
class Scorer {
 public:
  Scorer(const ScanMap& map, const ScanMatcherConfig& config, const Fit& fit, double sigma)
      : map_(map),
        config_(config),
        offset_(fit.offset),
        sigma_(sigma),
        bound_(std::max(ScanScoreTuning::kExplainedCells,
                        ScanScoreTuning::kExplainedSigmas * sigma)) {}

  /// Cost of a return: `explained` by a wall nearby, or an object that is not on the map.
  [[nodiscard]] double cost_of(const Vector<2>& laser, const Vector<2>& end, double range,
                               bool& explained) const {
    const double peak = sigma_ * std::sqrt(2.0 * kPi);
    const double stray = config_.outlier_share / (1.0 - config_.outlier_share) * peak /
                         std::max(range, ScanScoreTuning::kMinOutlierSpan);
    const double max_cost = -std::log(stray / (1.0 + stray));
    explained = false;
    if (behind_a_wall(laser, end, range)) {
      return max_cost;
    }
    const double e = residual(laser, end);
    explained = e <= bound_;
    const double cost =
        -std::log((std::exp(-0.5 * e * e / (sigma_ * sigma_)) + stray) / (1.0 + stray));
    return cost_in_unknown(end, std::min(cost, max_cost), peak);
  }

  /// Cost of a beam without return, where the map has a wall within reach.
  [[nodiscard]] double cost_of_no_return(const Vector<2>& laser, const Vector<2>& along,
                                         double range_max, double step) const {
    const double wall = free_length(map_.occupied(), laser, along, range_max);
    // A wall near the end of the range may or may not be seen.
    if (wall >= range_max - bound_) {
      return 0.0;
    }
    return -std::log(config_.no_return_share) /
           beams_per_run(std::max(wall, 1.0), step, ScanScoreTuning::kCorrelatedWall);
  }

  [[nodiscard]] double cost_of_place(const Vector<2>& body) const {
    switch (cell_at(body)) {
      case Cell::kOccupied:
        return -std::log(ScanScoreTuning::kWrongCellShare);
      case Cell::kUnknown:
        return std::log(2.0);
      default:
        return 0.0;
    }
  }

 private:
  /// Cell at a point of the field; a point outside may exceed integers and is not cast.
  [[nodiscard]] Cell cell_at(const Vector<2>& p) const {
    const DistanceField& field = map_.surface();
    if (!(p.x() >= 0.0 && p.x() < field.width() && p.y() >= 0.0 && p.y() < field.height())) {
      return Cell::kUnknown;
    }
    return map_.grid().at(static_cast<int>(p.x()) - field.margin_cells(),
                          static_cast<int>(p.y()) - field.margin_cells());
  }

  /// Distance to the wall line nearest to the end point, or to the end of that line.
  [[nodiscard]] double residual(const Vector<2>& laser, const Vector<2>& end) const {
    const ScanMap::WallLine& wall = wall_at(map_, end);
    const Vector<2> off = end - wall.point;
    if (wall.normal.isZero(0.0)) {
      return off.norm();
    }
    const double side = wall.normal.dot(end - laser) > 0.0 ? -1.0 : 1.0;
    const double across = side * wall.normal.dot(off) - offset_;
    const double along = std::abs(wall.normal.x() * off.y() - wall.normal.y() * off.x());
    return std::hypot(across, std::max(along - ScanScoreTuning::kLineHalfLength, 0.0));
  }

  /// Whether the beam went through a wall; grazing one does not count.
  [[nodiscard]] bool behind_a_wall(const Vector<2>& laser, const Vector<2>& end,
                                   double range) const {
    const Vector<2> along = (end - laser) / range;
    const double free = free_length(map_.occupied(), laser, along, range - bound_);
    if (free >= range - bound_) {
      return false;
    }
    const ScanMap::WallLine& wall = wall_at(map_, laser + free * along);
    const Vector<2> behind = end - wall.point;
    return std::abs(wall.normal.isZero(0.0) ? behind.norm() : wall.normal.dot(behind)) > bound_;
  }

  /// Cost of an end in unknown space, where a wall may be anywhere.
  [[nodiscard]] double cost_in_unknown(const Vector<2>& end, double cost, double peak) const {
    const bool unknown = cell_at(end) == Cell::kUnknown;
    return unknown
               ? std::min(cost, std::max(0.0, std::log(ScanScoreTuning::kMeanFreeInUnknown / peak)))
               : cost;
  }

  const ScanMap& map_;
  const ScanMatcherConfig& config_;
  double offset_;
  double sigma_;
  double bound_;
};

}  // namespace

Score score(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams, const Fit& fit,
            double sigma) {
  const Scorer scorer(map, config, fit, sigma);
  const double c = std::cos(fit.pose.heading);
  const double s = std::sin(fit.pose.heading);
  const Vector<2> laser = fit.pose.act(beams.laser);
  Score score{scorer.cost_of_place(fit.pose.position()), 0.0};
  for (std::size_t i = 0; i < beams.x.size(); ++i) {
    const Vector<2> end(fit.pose.x + c * beams.x[i] - s * beams.y[i],
                        fit.pose.y + s * beams.x[i] + c * beams.y[i]);
    bool explained = false;
    score.cost += scorer.cost_of(laser, end, beams.range[i], explained) /
                  beams_per_run(beams.range[i], beams.step, ScanScoreTuning::kCorrelatedWall);
    score.explained += explained ? 1.0 : 0.0;
  }
  for (const double direction : beams.silent) {
    const double angle = fit.pose.heading + direction;
    score.cost += scorer.cost_of_no_return(laser, {std::cos(angle), std::sin(angle)},
                                           beams.range_max, beams.step);
  }
  score.explained /= static_cast<double>(beams.x.size());
  return score;
}

}  // namespace locfuse::internal
