// SPDX-License-Identifier: Apache-2.0
#include "frontends/local_map_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/median.hpp"

namespace locfuse::internal {
namespace {

/// Constants of the fit to a local map; docs/models/scans.md eq. (1.11) to (1.13). Values
/// without another source are empirical.
struct LocalMapFitTuning {
  // Kernel (Geman-McClure) and matches.
  /// Width of the first kernel as a share of max_distance_m.
  static constexpr double kFirstKernelShare = 0.4;
  /// Narrowest kernel, and residual of an inlier [standard deviations].
  static constexpr double kMinKernelSigmas = 4.0;
  static constexpr double kInlierSigmas = 3.0;
  /// Factor of the kernel from one width to the next.
  static constexpr double kKernelShrink = 0.5;
  /// The kernel shrinks once a step is shorter than this share of it.
  static constexpr double kSettledKernelShare = 0.1;
  /// Maximum distance of a match [kernels]; weights beyond are below 1 %.
  static constexpr double kReachKernels = 3.0;
  /// Minimum cosine between the normals of two matched lines: 60 degrees.
  static constexpr double kMinNormalCosine = 0.5;
  static constexpr std::size_t kMinMatches = 6;
  /// Above this kernel [standard deviations] only every kSubsampleStride-th beam is used, of scans
  /// with kMinSubsampledBeams or more.
  static constexpr double kSubsampledKernelSigmas = 10.0;
  static constexpr std::size_t kSubsampleStride = 4;
  static constexpr std::size_t kMinSubsampledBeams = 100;
  /// Motion of the pose after which matches are searched again [standard deviations].
  static constexpr double kRematchSigmas = 0.5;
  /// Minimum distance within which a return counts as explained [m].
  static constexpr double kExplainedDistance = 0.05;
  /// Minimum typical range, by which a radian becomes a length [m].
  static constexpr double kMinTypicalRange = 0.1;

  // Convergence.
  /// Length of a step below which the fit has converged [standard deviations].
  static constexpr double kConvergedStepSigmas = 0.02;
  /// After kFullSteps iterations steps are damped by kDamping, as matches may alternate near the
  /// end of a wall, and a step below kConvergedHalfStepSigmas has converged.
  static constexpr int kFullSteps = 10;
  static constexpr double kDamping = 0.5;
  static constexpr double kConvergedHalfStepSigmas = 0.2;
  /// Length of a step from which on the fit has diverged [m].
  static constexpr double kMaxStep = 1e3;
};

/// End of a beam and its match.
struct Pair {
  Vector<2> off;     // from the match to the end
  Vector<2> normal;  // zero: the match is a point
  Vector<2> lever;   // from the body to the end
  double variance;   // of one component of `off`
  double squared;    // residual over variance

  [[nodiscard]] bool on_line() const { return normal.squaredNorm() > 0.5; }
};

/// Normal equations over (x, y, heading).
struct MapNormal {
  Matrix<3, 3> H = Matrix<3, 3>::Zero();
  Vector<3> g = Vector<3>::Zero();
  double lever = 0.0;  // sum of weighted squared distances to the body
  double weight = 0.0;
  std::size_t matches = 0;

  /// A residual e, its derivative along the unit vector n, and its weight.
  void add(double e, const Vector<2>& n, const Pair& pair, double w) {
    const Vector<3> row(n.x(), n.y(), n.y() * pair.lever.x() - n.x() * pair.lever.y());
    H += w * row * row.transpose();
    g += w * e * row;
    lever += w * pair.lever.squaredNorm();
    weight += w;
  }

  void add(const Pair& pair, double w) {
    if (pair.on_line()) {
      add(pair.normal.dot(pair.off), pair.normal, pair, w);
    } else {
      add(pair.off.x(), Vector<2>::UnitX(), pair, w);
      add(pair.off.y(), Vector<2>::UnitY(), pair, w);
    }
    ++matches;
  }

  [[nodiscard]] Observed observed_part() const {
    return observed(H, g, std::max(std::sqrt(lever / weight), LocalMapFitTuning::kMinTypicalRange));
  }
};

class Fitting {
 public:
  Fitting(const LineCloud& cloud, const LocalMapConfig& config, const std::vector<LinePoint>& beams,
          const Pose2& start, const Prior& prior)
      : cloud_(cloud), config_(config), beams_(beams), start_(start), prior_(prior) {
    match_.pose = start;
    pairs_.reserve(beams.size());
    places_.reserve(beams.size());
  }

  ScanMatch run() {
    const double sigma = config_.sigma_range_m;
    double kernel = LocalMapFitTuning::kFirstKernelShare * config_.max_distance_m;
    bool narrow = false;
    for (match_.iterations = 1; match_.iterations <= config_.max_iterations; ++match_.iterations) {
      const bool subsample = kernel > LocalMapFitTuning::kSubsampledKernelSigmas * sigma &&
                             beams_.size() >= LocalMapFitTuning::kMinSubsampledBeams;
      pair_up(kernel, subsample ? LocalMapFitTuning::kSubsampleStride : 1);
      const MapNormal normal = accumulate(kernel);
      if (normal.matches < LocalMapFitTuning::kMinMatches) {
        return ended(ScanMatch::Reason::kTooFewMatches);
      }
      const bool damped = match_.iterations > LocalMapFitTuning::kFullSteps;
      const double moved = step(normal, damped ? LocalMapFitTuning::kDamping : 1.0);
      if (narrow && moved < (damped ? LocalMapFitTuning::kConvergedHalfStepSigmas
                                    : LocalMapFitTuning::kConvergedStepSigmas) *
                                sigma) {
        return finished();
      }
      if (!(moved < LocalMapFitTuning::kMaxStep)) {
        return ended(ScanMatch::Reason::kNoConvergence);
      }
      narrow = narrow || kernel <= floor();
      if (narrow) {
        estimate_scale();
      }
      if (narrow || moved < LocalMapFitTuning::kSettledKernelShare * kernel) {
        kernel = std::max(LocalMapFitTuning::kKernelShrink * kernel, floor());
      }
    }
    match_.iterations = config_.max_iterations;
    return ended(ScanMatch::Reason::kNoConvergence);
  }

 private:
  /// Narrowest kernel: of an end point beside a line through as many ends [m].
  [[nodiscard]] double floor() const {
    return LocalMapFitTuning::kMinKernelSigmas * scale_ * std::sqrt(2.0) * config_.sigma_range_m;
  }

  /// Matches the ends of the beams; searches again once the pose has moved.
  void pair_up(double kernel, std::size_t stride) {
    const double c = std::cos(match_.pose.heading);
    const double s = std::sin(match_.pose.heading);
    Matrix<2, 2> turn;
    turn << c, -s, s, c;
    places_.clear();
    for (std::size_t i = 0; i < beams_.size(); i += stride) {
      places_.emplace_back(match_.pose.position() + turn * beams_[i].end);
    }
    if (found_.size() != places_.size() ||
        moved_since_ > LocalMapFitTuning::kRematchSigmas * config_.sigma_range_m) {
      cloud_.nearest(places_, found_);
      moved_since_ = 0.0;
    }
    pairs_.clear();
    for (std::size_t k = 0; k < places_.size(); ++k) {
      pair_with(beams_[k * stride], cloud_.points()[static_cast<std::size_t>(found_[k])],
                places_[k], turn, kernel);
    }
  }

  /// Eq. (1.11) and (1.12).
  void pair_with(const LinePoint& beam, const LinePoint& wall, const Vector<2>& end,
                 const Matrix<2, 2>& turn, double kernel) {
    const Vector<2> off = end - wall.foot;
    const double reach =
        std::min(LocalMapFitTuning::kReachKernels * kernel + wall.gap, config_.max_distance_m);
    const bool lines = wall.normal.squaredNorm() > 0.5 && beam.normal.squaredNorm() > 0.5;
    if (off.squaredNorm() > reach * reach ||
        (lines && wall.normal.dot(turn * beam.normal) < LocalMapFitTuning::kMinNormalCosine)) {
      return;
    }
    Pair pair{off, wall.normal, turn * beam.end,
              beam.variance + wall.variance * wall.spacing / beam.spacing, 0.0};
    if (pair.on_line()) {
      const double e = pair.normal.dot(off);
      pair.squared = e * e / pair.variance;
    } else {
      pair.variance += wall.gap * wall.gap / 12.0;
      pair.squared = off.squaredNorm() / pair.variance;
    }
    if (std::isfinite(pair.variance)) {  // not without a neighbour
      pairs_.push_back(pair);
    }
  }

  /// Bound of squared residuals: leaves out the worst trimmed_share, but no inliers.
  [[nodiscard]] double trimmed() {
    squares_.clear();
    for (const Pair& pair : pairs_) {
      squares_.push_back(pair.squared);
    }
    const double kept = (1.0 - config_.trimmed_share) * static_cast<double>(squares_.size());
    const double inlier =
        LocalMapFitTuning::kInlierSigmas * LocalMapFitTuning::kInlierSigmas * scale_ * scale_;
    const auto last = static_cast<std::size_t>(kept);
    if (last >= squares_.size()) {
      return std::numeric_limits<double>::infinity();
    }
    const auto at = squares_.begin() + static_cast<std::ptrdiff_t>(last);
    std::nth_element(squares_.begin(), at, squares_.end());
    return std::max(*at, inlier);
  }

  MapNormal accumulate(double kernel) {
    const double c = kernel / (std::sqrt(2.0) * config_.sigma_range_m);
    const double bound = trimmed();
    MapNormal normal;
    for (const Pair& pair : pairs_) {
      if (pair.squared <= bound) {
        const double damping = 1.0 + pair.squared / (c * c);
        normal.add(pair, 1.0 / (damping * damping * scale_ * scale_ * pair.variance));
      }
    }
    return normal;
  }

  MapNormal accumulate_inliers() {
    MapNormal normal;
    for (const Pair& pair : pairs_) {
      if (pair.squared <=
          LocalMapFitTuning::kInlierSigmas * LocalMapFitTuning::kInlierSigmas * scale_ * scale_) {
        normal.add(pair, 1.0 / (scale_ * scale_ * pair.variance));
      }
    }
    return normal;
  }

  double step(const MapNormal& normal, double damping) {
    const Observed observed = normal.observed_part();
    const Vector<3> moved = damping * newton_step(observed, prior_, match_.pose);
    match_.pose = retract(match_.pose, observed.per_scale.cwiseProduct(moved));
    moved_since_ += moved.norm();
    return moved.norm();
  }

  /// Estimates the scale of residuals over their expected noise, by their median; at least 1.
  void estimate_scale() {
    squares_.clear();
    for (const Pair& pair : pairs_) {
      if (pair.on_line()) {
        squares_.push_back(pair.squared);
      }
    }
    if (squares_.empty()) {
      return;
    }
    const auto middle = squares_.begin() + static_cast<std::ptrdiff_t>(squares_.size() / 2);
    std::nth_element(squares_.begin(), middle, squares_.end());
    scale_ = std::max(1.0, kSigmaPerMedian * std::sqrt(*middle));
  }

  ScanMatch ended(ScanMatch::Reason reason) {
    match_.pose = start_;
    match_.reason = reason;
    return match_;
  }

  ScanMatch finished() {
    pair_up(floor(), 1);
    const MapNormal normal = accumulate_inliers();
    if (normal.matches < LocalMapFitTuning::kMinMatches) {
      return ended(ScanMatch::Reason::kTooFewMatches);
    }
    const Observed observed = normal.observed_part();
    if (!(step(normal, 1.0) < LocalMapFitTuning::kMaxStep)) {
      return ended(ScanMatch::Reason::kNoConvergence);
    }
    match_.information = observed.information;
    if (observed.weak) {
      match_.weak_direction = *observed.weak / observed.weak->norm();
    }
    match_.covariance = covariance_of(match_.information + prior_.information);
    measure();
    match_.converged = true;
    match_.reason = ScanMatch::Reason::kConverged;
    return match_;
  }

  void measure() {
    double sum = 0.0;
    double count = 0.0;
    for (const Pair& pair : pairs_) {
      const double e2 = pair.squared * pair.variance;
      if (e2 <= LocalMapFitTuning::kExplainedDistance * LocalMapFitTuning::kExplainedDistance ||
          pair.squared <= LocalMapFitTuning::kInlierSigmas * LocalMapFitTuning::kInlierSigmas *
                              scale_ * scale_) {
        sum += e2;
        count += 1.0;
      }
    }
    match_.explained = count / static_cast<double>(beams_.size());
    match_.rms = std::sqrt(sum / std::max(count, 1.0));
  }

  const LineCloud& cloud_;
  const LocalMapConfig& config_;
  const std::vector<LinePoint>& beams_;
  const Pose2 start_;
  const Prior& prior_;
  double scale_ = 1.0;
  std::vector<Vector<2>> places_;
  std::vector<int> found_;    // nearest foot to each
  double moved_since_ = 0.0;  // their search [m]
  std::vector<Pair> pairs_;
  std::vector<double> squares_;
  ScanMatch match_;
};

}  // namespace

ScanMatch fit_lines(const LineCloud& cloud, const LocalMapConfig& config,
                    const std::vector<LinePoint>& beams, const Pose2& start, const Prior& prior) {
  return Fitting(cloud, config, beams, start, prior).run();
}

}  // namespace locfuse::internal
