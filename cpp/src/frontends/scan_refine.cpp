// SPDX-License-Identifier: Apache-2.0
#include "frontends/scan_refine.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "math/median.hpp"

namespace locfuse::internal {
namespace {

/// Constants of the refinement, lengths in cells of the map; docs/models/scans.md eq. (1.4)
/// to (1.7). Values without another source are empirical.
struct ScanRefineTuning {
  // Noise of the map.
  /// Standard deviation of a surface about its wall line, which lies in the same cell.
  static constexpr double kSurfaceOffsetSigma = 0.5;
  /// Standard deviation of a point that is uniform in its cell: 1 / sqrt(12).
  static constexpr double kCellSigma = 0.28867513;
  /// Standard deviation of a line through five rounded cells: sqrt(1 / 60).
  static constexpr double kLineSigma = 0.12909944;
  /// Bounds of the estimated standard deviation of the map's errors, the lower maximum while the
  /// pose is rough.
  static constexpr double kMinMapSigma = 0.05;
  static constexpr double kMaxMapSigmaWhileRough = 1.0;
  static constexpr double kMaxMapSigma = 4.0;
  /// Weight of kLineSigma against the residuals [runs of wall].
  static constexpr double kPriorRuns = 4.0;
  /// Histogram of residual magnitudes for their median: range and bins.
  static constexpr float kHistogramReach = 4.0F;
  static constexpr float kBinsPerCell = 64.0F;
  static constexpr std::size_t kBins = 256;

  // Kernel (Geman-McClure) and matches.
  /// Narrowest kernel, and residual of an inlier [standard deviations].
  static constexpr double kMinKernelSigmas = 4.0;
  static constexpr double kInlierSigmas = 3.0;
  /// Factor of the kernel from one width to the next.
  static constexpr double kKernelShrink = 0.5;
  /// The kernel shrinks once a step is shorter than this share of it.
  static constexpr double kSettledKernelShare = 0.1;
  /// Above this kernel only every kSubsampleStride-th beam is used.
  static constexpr double kSubsampledKernel = 2.0;
  static constexpr std::size_t kSubsampleStride = 4;
  /// Maximum distance from an end point to its wall, in kernels; at least kMinReach, so that every
  /// explained end point is matched.
  static constexpr double kReachKernels = 3.0;
  static constexpr double kMinReach = 3.0;
  static constexpr std::size_t kMinMatches = 6;
  /// Minimum distance to the wall within which a return counts as explained.
  static constexpr double kExplainedCells = 2.0;

  // Convergence.
  /// Length of a step below which the fit has converged.
  static constexpr double kConvergedStep = 0.005;
  /// After kFullSteps iterations steps are damped by kDamping, as nearest cells may alternate near
  /// the end of a wall, and a step below kConvergedHalfStep has converged.
  static constexpr int kFullSteps = 10;
  static constexpr double kDamping = 0.5;
  static constexpr double kConvergedHalfStep = 0.05;

  // Restarts.
  /// A fit that explains less than this share of the returns is repeated from headings kRetryTurn
  /// [rad] to both sides, which moves the ends of 10 m beams by 0.6 m.
  static constexpr double kGoodExplained = 0.85;
  static constexpr double kRetryTurn = 0.06;
};

/// Normal equations over (x, y, heading, offset); docs/models/scans.md.
struct ScanNormal {
  Matrix<4, 4> H = Matrix<4, 4>::Zero();
  Vector<4> g = Vector<4>::Zero();
  double lever = 0.0;  // sum of weighted squared distances to the body
  double weight = 0.0;
};

using CompactLine = ScanMap::CompactLine;

/// Wall lines matched with the end points, and their residuals.
class Walls {
 public:
  void resize(std::size_t count) {
    for (std::vector<float>* column : {&x_, &y_, &nx_, &ny_, &run_, &residuals, &correlated}) {
      column->resize(count);
    }
    targets.resize(count);
  }

  /// Takes the first `count` targets.
  void gather(const std::vector<CompactLine>& lines, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const CompactLine& line = lines[static_cast<std::size_t>(targets[i])];
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
  std::vector<float> residuals;   ///< eq. (1.4)
  std::vector<float> correlated;  ///< k of eq. (1.6): beams that share their wall's error

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
        subsampled_(columns_of(beams, ScanRefineTuning::kSubsampleStride)) {
    fit_.pose = start;
    set_map_variance(ScanRefineTuning::kCellSigma * ScanRefineTuning::kCellSigma);
    walls_.resize(all_.x.size());
  }

  Fit run(int max_iterations, double capture) {
    double kernel = capture;
    bool narrow = false;
    for (fit_.iterations = 1; fit_.iterations <= max_iterations; ++fit_.iterations) {
      const ScanNormal normal =
          accumulate(kernel, false,
                     !narrow && kernel > ScanRefineTuning::kSubsampledKernel ? subsampled_ : all_);
      if (matches_ < ScanRefineTuning::kMinMatches) {
        return ended(ScanMatch::Reason::kTooFewMatches);
      }
      const bool damped = fit_.iterations > ScanRefineTuning::kFullSteps;
      const double moved = step(normal, damped ? ScanRefineTuning::kDamping : 1.0);
      if (!inside()) {
        return ended(ScanMatch::Reason::kOutsideMap);
      }
      if (narrow && moved < (damped ? ScanRefineTuning::kConvergedHalfStep
                                    : ScanRefineTuning::kConvergedStep)) {
        estimate_sigma(ScanRefineTuning::kMaxMapSigma);
        step(accumulate(floor(), false, all_), 1.0);
        return finished();
      }
      if (!narrow && kernel <= floor()) {
        narrow = true;
        estimate_sigma(ScanRefineTuning::kMaxMapSigmaWhileRough);
      }
      if (narrow || moved < ScanRefineTuning::kSettledKernelShare * kernel) {
        kernel = std::max(ScanRefineTuning::kKernelShrink * kernel, floor());
      }
    }
    fit_.iterations = max_iterations;
    return ended(ScanMatch::Reason::kNoConvergence);
  }

 private:
  [[nodiscard]] double floor() const { return ScanRefineTuning::kMinKernelSigmas * fit_.sigma; }

  void set_map_variance(double variance) {
    map_variance_ = variance;
    fit_.sigma = std::sqrt(variance + sigma_beam_ * sigma_beam_);
  }

  [[nodiscard]] bool inside() const {
    return fit_.pose.x >= 0.0 && fit_.pose.x < field_.width() && fit_.pose.y >= 0.0 &&
           fit_.pose.y < field_.height();
  }

  /// Finds the nearest target of each end point. An end point off the field gets the target nearest
  /// to the field's edge, which is farther away than the margin.
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

  /// Normal equations of eq. (1.4) and (1.5), weighted by eq. (1.6) and a smooth kernel, or, if
  /// `hard`, with full weight within `kernel`.
  ScanNormal accumulate(double kernel, bool hard, const BeamColumns& columns) {
    const double reach =
        std::min(std::max(ScanRefineTuning::kReachKernels * kernel, ScanRefineTuning::kMinReach),
                 static_cast<double>(field_.margin_cells()));
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
                      walls_.correlated.data(), sums);
    return normal_of(sums);
  }

  ScanNormal normal_of(const LaneSums& sums) {
    ScanNormal normal;
    normal.H << sums.xx, sums.xy, sums.xt, -sums.x,  //
        sums.xy, sums.yy, sums.yt, -sums.y,          //
        sums.xt, sums.yt, sums.tt, -sums.t,          //
        -sums.x, -sums.y, -sums.t,
        sums.w +
            1.0 / (ScanRefineTuning::kSurfaceOffsetSigma * ScanRefineTuning::kSurfaceOffsetSigma);
    normal.g << sums.xe, sums.ye, sums.te,
        fit_.offset /
                (ScanRefineTuning::kSurfaceOffsetSigma * ScanRefineTuning::kSurfaceOffsetSigma) -
            sums.e;
    normal.lever = sums.lever;
    normal.weight = sums.w;
    matches_ = static_cast<std::size_t>(sums.matches);
    return normal;
  }

  /// Eq. (1.7): the scan's information on the pose, the offset eliminated.
  [[nodiscard]] static Observed reduce(const ScanNormal& normal) {
    const Vector<3> h = normal.H.block<3, 1>(0, 3);
    return observed(normal.H.topLeftCorner<3, 3>() - h * h.transpose() / normal.H(3, 3),
                    normal.g.head<3>() - h * (normal.g(3) / normal.H(3, 3)),
                    std::max(std::sqrt(normal.lever / normal.weight), 1.0));
  }

  /// One step over the directions that scan or prior observe. Returns its length [cells].
  double step(const ScanNormal& normal, double damping) {
    const Observed reduced = reduce(normal);
    const Vector<3> moved = damping * newton_step(reduced, prior_, fit_.pose);
    const Vector<3> delta = reduced.per_scale.cwiseProduct(moved);
    fit_.pose = retract(fit_.pose, delta);
    fit_.offset -= (normal.g(3) + normal.H.block<1, 3>(3, 0) * delta) / normal.H(3, 3);
    return moved.norm();
  }

  /// Estimates the map's errors: variance of the residuals without outliers, minus beam noise.
  void estimate_sigma(double max_sigma) {
    std::array<int, ScanRefineTuning::kBins> histogram{};
    int count = 0;
    for_each_match([&](float e, float) {
      if (std::abs(e) < ScanRefineTuning::kHistogramReach) {
        ++histogram[static_cast<std::size_t>(std::abs(e) * ScanRefineTuning::kBinsPerCell)];
        ++count;
      }
    });
    std::size_t middle = 0;
    for (int below = histogram[0]; 2 * below < count; below += histogram[++middle]) {
    }
    const double median =
        (static_cast<double>(middle) + 0.5) / static_cast<double>(ScanRefineTuning::kBinsPerCell);
    const double bound =
        ScanRefineTuning::kInlierSigmas *
        std::max(kSigmaPerMedian * median, std::hypot(ScanRefineTuning::kMinMapSigma, sigma_beam_));
    double runs = 0.0;
    double sum = 0.0;
    for_each_match([&](float e, float correlated) {
      if (static_cast<double>(std::abs(e)) < bound) {
        const double square = static_cast<double>(e) * static_cast<double>(e);
        runs += 1.0 / static_cast<double>(correlated);
        sum += (square - sigma_beam_ * sigma_beam_) / static_cast<double>(correlated);
      }
    });
    const double free = std::max(runs - 4.0, 0.0);  // four variables are fitted
    const double variance = (ScanRefineTuning::kPriorRuns * ScanRefineTuning::kLineSigma *
                                 ScanRefineTuning::kLineSigma +
                             std::max(sum, 0.0)) /
                            (ScanRefineTuning::kPriorRuns + free);
    set_map_variance(std::min(
        std::max(variance, ScanRefineTuning::kMinMapSigma * ScanRefineTuning::kMinMapSigma),
        max_sigma * max_sigma));
  }

  template <class Each>
  void for_each_match(const Each& each) const {
    for (std::size_t i = 0; i < used_; ++i) {
      if (walls_.residuals[i] < kFar) {
        each(walls_.residuals[i], walls_.correlated[i]);
      }
    }
  }

  Fit ended(ScanMatch::Reason reason) {
    fit_.pose = start_;
    fit_.reason = reason;
    return fit_;
  }

  Fit finished() {
    const Observed reduced =
        reduce(accumulate(ScanRefineTuning::kInlierSigmas * fit_.sigma, true, all_));
    if (matches_ < ScanRefineTuning::kMinMatches) {
      return ended(ScanMatch::Reason::kTooFewMatches);
    }
    fit_.information = reduced.information;
    fit_.weak = reduced.weak;
    const double bound =
        std::max(ScanRefineTuning::kExplainedCells, ScanRefineTuning::kInlierSigmas * fit_.sigma);
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
  const std::vector<CompactLine>& lines_;
  const Beams& beams_;
  const Prior& prior_;
  bool exact_;
  ScanLanes lanes_ = scan_lanes();
  double sigma_beam_;
  Pose2 start_;
  double map_variance_ = 0.0;
  BeamColumns all_, subsampled_;
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
  Fit best = refine(map, config, beams, prior.mean, prior, capture);
  for (const double turn : {ScanRefineTuning::kRetryTurn, -ScanRefineTuning::kRetryTurn}) {
    if (best.reason == ScanMatch::Reason::kConverged &&
        best.explained >= ScanRefineTuning::kGoodExplained) {
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
