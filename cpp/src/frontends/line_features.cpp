// SPDX-License-Identifier: Apache-2.0
// Split and merge with total least squares: equations of docs/models/scans.md.
#include "locfuse/frontends/line_features.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "frontends/beams.hpp"
#include "frontends/line_fit.hpp"
#include "frontends/wall_outlines.hpp"
#include "math/refuse.hpp"

namespace locfuse {
namespace {

/// The noise of a line's points counts as much as that of so many points of all lines, where the
/// line itself has few.
constexpr double kPointsOfAll = 10.0;

/// Distance of a cell's corner from the line of a wall, over the width of a cell across the wall,
/// with room for rounding.
constexpr double kHalfCell = 0.5 + 1e-6;

struct ChainPiece {
  std::size_t begin;
  std::size_t end;  // one past its last point
};

/// Points in order, with what is free to their left.
class Chain {
 public:
  explicit Chain(std::vector<Vector<2>> points) : points_(std::move(points)) {}

  [[nodiscard]] const Vector<2>& at(std::size_t i) const { return points_[i]; }

  struct Fitted {
    Vector<2> mean;
    internal::LineFit line;
  };
  [[nodiscard]] Fitted fit(const ChainPiece& piece) const {
    const double count = static_cast<double>(piece.end - piece.begin);
    Vector<2> mean = Vector<2>::Zero();
    for (std::size_t i = piece.begin; i < piece.end; ++i) {
      mean += points_[i] / count;
    }
    Matrix<2, 2> spread = Matrix<2, 2>::Zero();
    for (std::size_t i = piece.begin; i < piece.end; ++i) {
      const Vector<2> d = points_[i] - mean;
      spread += d * d.transpose() / count;
    }
    return {mean, internal::fit_line(spread)};
  }

  /// Cut where it is farthest from its chord, until one line fits every part to
  /// tolerance(normal); neighbours that one line fits are joined again.
  template <class Tolerance>
  [[nodiscard]] std::vector<ChainPiece> split_and_merge(const Tolerance& tolerance) const {
    std::vector<ChainPiece> merged;
    std::vector<ChainPiece> left{{0, points_.size()}};
    while (!left.empty()) {
      const ChainPiece piece = left.back();
      if (!is_straight(piece, tolerance)) {
        const std::size_t bend = bend_of(piece);
        left.back() = {bend + 1, piece.end};
        left.push_back({piece.begin, bend + 1});
        continue;
      }
      left.pop_back();
      if (!merged.empty() && is_straight({merged.back().begin, piece.end}, tolerance)) {
        merged.back().end = piece.end;
      } else {
        merged.push_back(piece);
      }
    }
    return merged;
  }

 private:
  /// The inner point farthest from the chord.
  [[nodiscard]] std::size_t bend_of(const ChainPiece& piece) const {
    const Vector<2>& from = points_[piece.begin];
    const Vector<2> chord = points_[piece.end - 1] - from;
    const double length = chord.norm();
    std::size_t farthest = piece.begin;
    double most = 0.0;
    for (std::size_t i = piece.begin + 1; i + 1 < piece.end; ++i) {
      const Vector<2> d = points_[i] - from;
      const double off =
          length > 0.0 ? std::abs(chord.x() * d.y() - chord.y() * d.x()) / length : d.norm();
      if (off > most) {
        most = off;
        farthest = i;
      }
    }
    return farthest;
  }

  template <class Tolerance>
  [[nodiscard]] bool is_straight(const ChainPiece& piece, const Tolerance& tolerance) const {
    const Fitted fitted = fit(piece);
    const Vector<2> normal = fitted.line.normal();
    const double most = tolerance(normal);
    for (std::size_t i = piece.begin; i < piece.end; ++i) {
      if (std::abs(normal.dot(points_[i] - fitted.mean)) > most) {
        return false;
      }
    }
    return true;
  }

  std::vector<Vector<2>> points_;
};

/// A line before the noise of its points is known.
struct LineCandidate {
  LineFeature feature;
  ChainPiece piece;
  double count;
  double along;   // sum of squares of its points along it
  double across;  // and across it
};

LineCandidate candidate_of(const Chain& chain, const ChainPiece& piece) {
  const Chain::Fitted fitted = chain.fit(piece);
  Vector<2> normal = fitted.line.normal();
  const Vector<2> run = chain.at(piece.end - 1) - chain.at(piece.begin);
  if (normal.x() * run.y() - normal.y() * run.x() < 0.0) {
    normal = -normal;  // free space lies to the left of the run
  }
  Line2 line{normal.dot(fitted.mean), std::atan2(normal.y(), normal.x()), fitted.mean, 0.0};
  const Vector<2> direction(-normal.y(), normal.x());
  double low = 0.0;
  double high = 0.0;
  for (std::size_t i = piece.begin; i < piece.end; ++i) {
    const double at = direction.dot(chain.at(i) - fitted.mean);
    low = std::min(low, at);
    high = std::max(high, at);
  }
  line.half_length = 0.5 * (high - low);
  const double count = static_cast<double>(piece.end - piece.begin);
  return {{line, Matrix<2, 2>::Zero(), 0, 0},
          piece,
          count,
          count * fitted.line.along,
          count * std::max(fitted.line.across, 0.0)};
}

bool is_long(const Chain& chain, const ChainPiece& piece, const LineFeaturesConfig& config) {
  return piece.end - piece.begin >= static_cast<std::size_t>(config.min_points) &&
         (chain.at(piece.end - 1) - chain.at(piece.begin)).norm() >= config.min_length_m;
}

/// Covariances by eq. (2.4), with the noise that the points show across their lines: eq. (2.3).
std::vector<LineFeature> features(const std::vector<LineCandidate>& found, double min_sigma) {
  double across = 0.0;
  double freedom = 0.0;
  for (const LineCandidate& line : found) {
    across += line.across;
    freedom += line.count - 2.0;
  }
  const double of_all = freedom > 0.0 ? across / freedom : 0.0;
  std::vector<LineFeature> lines;
  lines.reserve(found.size());
  for (const LineCandidate& c : found) {
    const double variance = std::max(
        (c.across + kPointsOfAll * of_all) / (c.count - 2.0 + kPointsOfAll), min_sigma * min_sigma);
    lines.push_back(c.feature);
    const Line2& line = lines.back().line;
    const double lever = line.direction().dot(line.middle);
    const double turn = variance / c.along;
    lines.back().covariance << variance / c.count + lever * lever * turn, lever * turn,  //
        lever * turn, turn;
  }
  std::stable_sort(lines.begin(), lines.end(), [](const LineFeature& a, const LineFeature& b) {
    return a.line.half_length > b.line.half_length;
  });
  return lines;
}

const LineFeaturesConfig& checked(const LineFeaturesConfig& config) {
  const auto positive = [](const char* name, double value) {
    if (!(value >= 1e-6 && value <= 1e6)) {
      internal::refuse(name, value, "1e-6 to 1e6");
    }
  };
  positive("tolerance_m", config.tolerance_m);
  positive("max_gap_m", config.max_gap_m);
  positive("min_length_m", config.min_length_m);
  positive("min_sigma_m", config.min_sigma_m);
  if (config.min_points < 3) {
    internal::refuse("min_points", config.min_points, ">= 3");
  }
  return config;
}

/// Adds the lines of a chain.
template <class Tolerance>
void add_lines(const Chain& chain, const Tolerance& tolerance, const LineFeaturesConfig& config,
               std::vector<LineCandidate>& found) {
  for (const ChainPiece& piece : chain.split_and_merge(tolerance)) {
    if (is_long(chain, piece, config)) {
      found.push_back(candidate_of(chain, piece));
    }
  }
}

/// Returns of a scan that follow each other without a gap, as its beams, counter-clockwise.
std::vector<std::vector<int>> runs_of(const internal::Beams& beams, const std::vector<int>& beam,
                                      double max_gap) {
  std::vector<std::vector<int>> runs;
  for (std::size_t i = 0; i < beam.size(); ++i) {
    if (i == 0 || std::hypot(beams.x[i] - beams.x[i - 1], beams.y[i] - beams.y[i - 1]) > max_gap) {
      runs.emplace_back();
    }
    runs.back().push_back(static_cast<int>(i));
  }
  return runs;
}

}  // namespace

std::vector<LineFeature> scan_line_features(const LaserScan& scan,
                                            const LineFeaturesConfig& config) {
  checked(config);
  const internal::Beams beams = internal::beams_of(scan, 1.0);
  std::vector<int> beam;  // of each return
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (scan.geometry->is_return(scan.ranges[i])) {
      beam.push_back(static_cast<int>(i));
    }
  }
  std::vector<LineCandidate> found;
  for (std::vector<int>& run : runs_of(beams, beam, config.max_gap_m)) {
    if (scan.geometry->angle_increment < 0.0) {
      std::reverse(run.begin(), run.end());
    }
    std::vector<Vector<2>> points;
    points.reserve(run.size());
    for (const int i : run) {
      points.emplace_back(beams.x[static_cast<std::size_t>(i)],
                          beams.y[static_cast<std::size_t>(i)]);
    }
    const std::size_t before = found.size();
    const auto tolerance = [&](const Vector<2>& /*normal*/) { return config.tolerance_m; };
    add_lines(Chain(std::move(points)), tolerance, config, found);
    for (std::size_t k = before; k < found.size(); ++k) {
      const auto [first, last] =
          std::minmax(run[found[k].piece.begin], run[found[k].piece.end - 1]);
      found[k].feature.first = beam[static_cast<std::size_t>(first)];
      found[k].feature.last = beam[static_cast<std::size_t>(last)];
    }
  }
  return features(found, config.min_sigma_m);
}

std::vector<LineFeature> map_line_features(const OccupancyGrid& grid,
                                           const LineFeaturesConfig& config) {
  checked(config);
  const Pose2 to_grid{0.0, 0.0, -grid.origin().heading};
  const auto tolerance = [&](const Vector<2>& normal) {
    return kHalfCell * grid.resolution() * to_grid.act(normal).lpNorm<1>();
  };
  std::vector<LineCandidate> found;
  for (std::vector<Vector<2>>& way : internal::wall_outlines(grid)) {
    add_lines(Chain(std::move(way)), tolerance, config, found);
  }
  return features(found, config.min_sigma_m);
}

}  // namespace locfuse
