// SPDX-License-Identifier: Apache-2.0
#include "frontends/scan_refine.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace locfuse::internal {
namespace {

constexpr double kOffsetSigma = 0.5;  // of a surface about its line: it lies in its cell [cells]
constexpr double kCellSigma = 0.28867513;  // of a point that is anywhere in its cell [cells]
constexpr double kLineSigma = 0.12909944;  // of a line through the five cells of a fit [cells]
constexpr double kLeastMapSigma = 0.05;    // no map is better than this [cells]
constexpr double kMostAtFirst = 1.0;       // nor, while the pose is rough, worse than this
constexpr double kMostMapSigma = 4.0;      // nor ever worse than this
constexpr double kPriorRuns = 4.0;         // weight of kLineSigma against the residuals
constexpr double kKernelSigmas = 4.0;
constexpr double kInlierSigmas = 3.0;
constexpr double kExplainedCells = 2.0;
constexpr double kStill = 0.005;       // a step below this is none [cells]
constexpr double kSettled = 0.1;       // share of a kernel below which steps leave it
constexpr double kNearlyStill = 0.05;  // where it jumps; a millimetre or two
constexpr int kFullSteps = 10;
constexpr double kWide = 2.0;        // a kernel for which few beams do [cells]
constexpr std::size_t kStride = 4;   // then
constexpr double kLeastReach = 3.0;  // of a beam to its wall, so that all explained ones are seen
constexpr std::size_t kLeastMatches = 6;

/// Normal equations over (x, y, heading, offset); docs/models/scan_matching.md.
struct Normal {
  Matrix<4, 4> H = Matrix<4, 4>::Zero();
  Vector<4> g = Vector<4>::Zero();
  double lever = 0.0;  // sum of weighted squared distances to the body
  double weight = 0.0;
};

using Line = ScanMap::CompactLine;

/// The walls next to the end points, and their residuals.
class Walls {
 public:
  void resize(std::size_t count) {
    for (std::vector<float>* column : {&x_, &y_, &nx_, &ny_, &run_, &residuals, &alike}) {
      column->resize(count);
    }
    targets.resize(count);
  }

  /// Takes the first `count` targets.
  void gather(const std::vector<Line>& lines, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const Line& line = lines[static_cast<std::size_t>(targets[i])];
      x_[i] = line.x;
      y_[i] = line.y;
      nx_[i] = line.nx;
      ny_[i] = line.ny;
      run_[i] = line.run;
    }
  }

  [[nodiscard]] LaneWalls view(const BeamColumns& columns) const {
    return {x_.data(), y_.data(), nx_.data(), ny_.data(), run_.data(), columns.per_spacing.data()};
  }

  std::vector<std::int32_t> targets;
  std::vector<float> residuals;  ///< eq. (4)
  std::vector<float> alike;      ///< k of eq. (6)

 private:
  std::vector<float> x_, y_, nx_, ny_, run_;
};

class Refinement {
 public:
  Refinement(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
             const Prior& prior, const Pose2& start)
      : field_(map.surface()),
        lines_(map.compact_lines()),
        beams_(beams),
        prior_(prior),
        exact_(config.exact_neighbours),
        sigma_beam_(config.sigma_range_m / map.grid().resolution()),
        start_(start),
        all_(columns_of(beams)),
        few_(columns_of(beams, kStride)) {
    fit_.pose = start;
    set_map_variance(kCellSigma * kCellSigma);
    walls_.resize(all_.x.size());
  }

  Fit run(int max_iterations, double capture) {
    double kernel = capture;
    bool narrow = false;
    for (fit_.iterations = 1; fit_.iterations <= max_iterations; ++fit_.iterations) {
      // While the kernel is wide, every fourth beam shows the way.
      const Normal normal = accumulate(kernel, false, !narrow && kernel > kWide ? few_ : all_);
      if (matches_ < kLeastMatches) {
        return ended(ScanMatch::Reason::kTooFewMatches);
      }
      // Near a wall's end the nearest cell may jump back and forth; shorter steps settle between.
      const bool jumps = fit_.iterations > kFullSteps;
      const double moved = step(normal, jumps ? 0.5 : 1.0);
      if (!inside()) {
        return ended(ScanMatch::Reason::kOutsideMap);
      }
      if (narrow && moved < (jumps ? kNearlyStill : kStill)) {
        estimate_sigma(kMostMapSigma);
        step(accumulate(floor(), false, all_), 1.0);
        return finished();
      }
      if (!narrow && kernel <= floor()) {
        narrow = true;
        estimate_sigma(kMostAtFirst);
      }
      if (narrow || moved < kSettled * kernel) {
        kernel = std::max(0.5 * kernel, floor());
      }
    }
    fit_.iterations = max_iterations;
    return ended(ScanMatch::Reason::kNoConvergence);
  }

 private:
  [[nodiscard]] double floor() const { return kKernelSigmas * fit_.sigma; }

  void set_map_variance(double variance) {
    map_variance_ = variance;
    fit_.sigma = std::sqrt(variance + sigma_beam_ * sigma_beam_);
  }

  [[nodiscard]] bool inside() const {
    return fit_.pose.x >= 0.0 && fit_.pose.x < field_.width() && fit_.pose.y >= 0.0 &&
           fit_.pose.y < field_.height();
  }

  /// Finds the target next to each end point; one off the field gets the one that is nearest to the
  /// field's edge, and is farther than the margin from it.
  void find_targets(const BeamColumns& columns, const LanePose& pose) {
    if (!exact_) {
      lanes_.find_targets(field_.nearest_targets().data(), field_.width(), field_.height(),
                          columns.view(), pose, walls_.targets.data());
      return;
    }
    for (std::size_t i = 0; i < columns.x.size(); ++i) {
      const float x = pose.c * columns.x[i] - pose.s * columns.y[i] + pose.x;
      const float y = pose.s * columns.x[i] + pose.c * columns.y[i] + pose.y;
      walls_.targets[i] =
          field_.nearest_in_field(static_cast<double>(x), static_cast<double>(y)).target;
    }
  }

  /// Normal equations of eq. (4) and (5), weighted by eq. (6): by a smooth kernel, or all of those
  /// within `kernel` alike if `hard`.
  Normal accumulate(double kernel, bool hard, const BeamColumns& columns) {
    const double reach =
        std::min(std::max(3.0 * kernel, kLeastReach), static_cast<double>(field_.margin_cells()));
    const Vector<2> laser = Pose2{0.0, 0.0, fit_.pose.heading}.act(beams_.laser);
    const LanePose pose{static_cast<float>(std::cos(fit_.pose.heading)),
                        static_cast<float>(std::sin(fit_.pose.heading)),
                        static_cast<float>(fit_.pose.x), static_cast<float>(fit_.pose.y)};
    used_ = columns.x.size();
    find_targets(columns, pose);
    walls_.gather(lines_, used_);
    const LaneWeights weights{
        static_cast<float>(laser.x()),     static_cast<float>(laser.y()),
        static_cast<float>(reach * reach), static_cast<float>(kernel * kernel),
        static_cast<float>(map_variance_), static_cast<float>(sigma_beam_ * sigma_beam_),
        static_cast<float>(fit_.offset),   hard};
    LaneSums sums{};
    lanes_.accumulate(columns.view(), pose, walls_.view(columns), weights, walls_.residuals.data(),
                      walls_.alike.data(), sums);
    return normal_of(sums);
  }

  Normal normal_of(const LaneSums& sums) {
    Normal normal;
    normal.H << sums.xx, sums.xy, sums.xt, -sums.x,  //
        sums.xy, sums.yy, sums.yt, -sums.y,          //
        sums.xt, sums.yt, sums.tt, -sums.t,          //
        -sums.x, -sums.y, -sums.t, sums.w + 1.0 / (kOffsetSigma * kOffsetSigma);
    normal.g << sums.xe, sums.ye, sums.te, fit_.offset / (kOffsetSigma * kOffsetSigma) - sums.e;
    normal.lever = sums.lever;
    normal.weight = sums.w;
    matches_ = static_cast<std::size_t>(sums.matches);
    return normal;
  }

  /// Eq. (7): the scan's word on the pose alone, the offset eliminated.
  [[nodiscard]] static Observed reduce(const Normal& normal) {
    const Vector<3> h = normal.H.block<3, 1>(0, 3);
    return observed(normal.H.topLeftCorner<3, 3>() - h * h.transpose() / normal.H(3, 3),
                    normal.g.head<3>() - h * (normal.g(3) / normal.H(3, 3)),
                    std::max(std::sqrt(normal.lever / normal.weight), 1.0));
  }

  /// One step over the directions that scan or prior know; its length [cells].
  double step(const Normal& normal, double damping) {
    const Observed reduced = reduce(normal);
    const Vector<3> moved = damping * newton_step(reduced, prior_, fit_.pose);
    const Vector<3> delta = reduced.per_scale.cwiseProduct(moved);
    fit_.pose = retract(fit_.pose, delta);
    fit_.offset -= (normal.g(3) + normal.H.block<1, 3>(3, 0) * delta) / normal.H(3, 3);
    return moved.norm();
  }

  /// Map errors from the residuals: their spread without outliers, less the beams' own noise.
  void estimate_sigma(double most) {
    constexpr float kBins = 64.0F;  // per cell, up to 4 cells
    std::array<int, 256> histogram{};
    int count = 0;
    for_each_match([&](float e, float) {
      if (std::abs(e) < 4.0F) {
        ++histogram[static_cast<std::size_t>(std::abs(e) * kBins)];
        ++count;
      }
    });
    std::size_t middle = 0;
    for (int below = histogram[0]; 2 * below < count; below += histogram[++middle]) {
    }
    const double median = (static_cast<double>(middle) + 0.5) / static_cast<double>(kBins);
    const double bound =
        kInlierSigmas * std::max(1.4826 * median, std::hypot(kLeastMapSigma, sigma_beam_));
    double runs = 0.0;
    double sum = 0.0;
    for_each_match([&](float e, float alike) {
      if (static_cast<double>(std::abs(e)) < bound) {
        const double square = static_cast<double>(e) * static_cast<double>(e);
        runs += 1.0 / static_cast<double>(alike);
        sum += (square - sigma_beam_ * sigma_beam_) / static_cast<double>(alike);
      }
    });
    const double free = std::max(runs - 4.0, 0.0);  // four are fitted
    const double variance =
        (kPriorRuns * kLineSigma * kLineSigma + std::max(sum, 0.0)) / (kPriorRuns + free);
    set_map_variance(std::min(std::max(variance, kLeastMapSigma * kLeastMapSigma), most * most));
  }

  template <class Each>
  void for_each_match(const Each& each) const {
    for (std::size_t i = 0; i < used_; ++i) {
      if (walls_.residuals[i] < kFar) {
        each(walls_.residuals[i], walls_.alike[i]);
      }
    }
  }

  Fit ended(ScanMatch::Reason reason) {
    fit_.pose = start_;
    fit_.reason = reason;
    return fit_;
  }

  Fit finished() {
    const Observed reduced = reduce(accumulate(kInlierSigmas * fit_.sigma, true, all_));
    if (matches_ < kLeastMatches) {
      return ended(ScanMatch::Reason::kTooFewMatches);
    }
    fit_.information = reduced.information;
    fit_.weak = reduced.weak;
    const double bound = std::max(kExplainedCells, kInlierSigmas * fit_.sigma);
    double sum = 0.0;
    double count = 0.0;
    for_each_match([&](float e, float) {
      if (static_cast<double>(std::abs(e)) <= bound) {
        sum += static_cast<double>(e) * static_cast<double>(e);
        count += 1.0;
      }
    });
    fit_.explained = count / static_cast<double>(beams_.x.size());
    fit_.rms = std::sqrt(sum / std::max(count, 1.0));
    fit_.reason = ScanMatch::Reason::kConverged;
    return fit_;
  }

  const DistanceField& field_;
  const std::vector<Line>& lines_;
  const Beams& beams_;
  const Prior& prior_;
  bool exact_;
  ScanLanes lanes_ = scan_lanes();
  double sigma_beam_;
  Pose2 start_;
  double map_variance_ = 0.0;
  BeamColumns all_, few_;
  Walls walls_;
  std::size_t used_ = 0;  // of walls_
  std::size_t matches_ = 0;
  Fit fit_;
};

}  // namespace

Fit refine(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
           const Pose2& start, const Prior& prior, double capture) {
  return Refinement(map, config, beams, prior, start).run(config.max_iterations, capture);
}

Fit refine_around(const ScanMap& map, const ScanMatcherConfig& config, const Beams& beams,
                  const Prior& prior, double capture) {
  constexpr double kGood = 0.85;  // of the returns explained
  constexpr double kTurn = 0.06;  // rad; beams of 10 m then end 0.6 m elsewhere
  Fit best = refine(map, config, beams, prior.mean, prior, capture);
  for (const double turn : {kTurn, -kTurn}) {
    if (best.reason == ScanMatch::Reason::kConverged && best.explained >= kGood) {
      break;
    }
    const Pose2 start = retract(prior.mean, {0.0, 0.0, turn});
    const Fit fit = refine(map, config, beams, start, prior, capture);
    if (fit.explained > best.explained) {
      best = fit;
    }
  }
  return best;
}

ScanMatch to_match(const Fit& fit, const OccupancyGrid& grid, int margin_cells, const Pose2& guess,
                   const Prior& prior) {
  ScanMatch match;
  match.iterations = fit.iterations;
  match.reason = fit.reason;
  match.converged = fit.reason == ScanMatch::Reason::kConverged;
  match.pose = match.converged ? to_world(fit.pose, grid, margin_cells) : guess;
  if (!match.converged) {
    return match;
  }
  match.explained = fit.explained;
  match.rms = fit.rms * grid.resolution();
  const double c = std::cos(grid.origin().heading);
  const double s = std::sin(grid.origin().heading);
  Matrix<3, 3> world_from_field;                                           // of small changes
  world_from_field << c * grid.resolution(), -s * grid.resolution(), 0.0,  //
      s * grid.resolution(), c * grid.resolution(), 0.0, 0.0, 0.0, 1.0;
  Matrix<3, 3> field_from_world;
  field_from_world << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, grid.resolution();
  field_from_world /= grid.resolution();
  const auto turned = [&](const Matrix<3, 3>& m) {
    const Matrix<3, 3> t = field_from_world.transpose() * m * field_from_world;
    return Matrix<3, 3>(0.5 * (t + t.transpose()));
  };
  match.information = turned(fit.information);
  if (fit.weak) {
    const Vector<3> weak = world_from_field * *fit.weak;
    match.weak_direction = weak / weak.norm();
  }
  match.covariance = covariance_of(turned(fit.information + prior.information));
  return match;
}

}  // namespace locfuse::internal
