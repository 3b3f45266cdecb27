// SPDX-License-Identifier: Apache-2.0
#include "frontends/local_map_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace locfuse::internal {
namespace {

constexpr double kFirstKernel = 0.4;  // share of max_distance_m
constexpr double kKernelSigmas = 4.0;
constexpr double kInlierSigmas = 3.0;
constexpr double kReachKernels = 3.0;  // of a kernel: weights beyond are below 1 %
constexpr double kExplainedM = 0.05;
constexpr double kSameSide = 0.5;      // cosine between two normals of one wall, at least
constexpr double kSettled = 0.1;       // share of a kernel below which steps leave it
constexpr double kStillSigmas = 0.02;  // a step below this is none
constexpr double kNearlyStill = 0.2;   // where ends near a wall's end change their match
constexpr double kLongestStep = 1e3;   // of numbers that broke [m]
constexpr int kFullSteps = 10;
constexpr double kWideSigmas = 10.0;  // a kernel for which few beams do
constexpr std::size_t kStride = 4;    // then
constexpr std::size_t kMany = 100;    // beams, of which a few are enough
constexpr double kSameMatches = 0.5;  // sigmas that an end may move and keep its match
constexpr double kLeastRange = 0.1;   // typical range, at least [m]
constexpr std::size_t kLeastMatches = 6;

/// The end of a beam beside what it is matched with.
struct Pair {
  Vector<2> off;     // from the match to the end
  Vector<2> normal;  // zero: the match is a point
  Vector<2> lever;   // from the body to the end
  double variance;   // of one component of `off`
  double squared;    // residual over variance

  [[nodiscard]] bool on_line() const { return normal.squaredNorm() > 0.5; }
};

/// Normal equations over (x, y, heading).
struct Normal {
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
    return observed(H, g, std::max(std::sqrt(lever / weight), kLeastRange));
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
    double kernel = kFirstKernel * config_.max_distance_m;
    bool narrow = false;
    for (match_.iterations = 1; match_.iterations <= config_.max_iterations; ++match_.iterations) {
      const bool few_do = kernel > kWideSigmas * sigma && beams_.size() >= kMany;
      pair_up(kernel, few_do ? kStride : 1);
      const Normal normal = accumulate(kernel);
      if (normal.matches < kLeastMatches) {
        return ended(ScanMatch::Reason::kTooFewMatches);
      }
      const bool jumps = match_.iterations > kFullSteps;
      const double moved = step(normal, jumps ? 0.5 : 1.0);
      if (narrow && moved < (jumps ? kNearlyStill : kStillSigmas) * sigma) {
        return finished();
      }
      if (!(moved < kLongestStep)) {
        return ended(ScanMatch::Reason::kNoConvergence);
      }
      narrow = narrow || kernel <= floor();
      if (narrow) {
        estimate_scale();
      }
      if (narrow || moved < kSettled * kernel) {
        kernel = std::max(0.5 * kernel, floor());
      }
    }
    match_.iterations = config_.max_iterations;
    return ended(ScanMatch::Reason::kNoConvergence);
  }

 private:
  /// Four sigma of an end beside a line of as many ends [m].
  [[nodiscard]] double floor() const {
    return kKernelSigmas * scale_ * std::sqrt(2.0) * config_.sigma_range_m;
  }

  /// Ends keep their match as long as they hardly move.
  void pair_up(double kernel, std::size_t stride) {
    const double c = std::cos(match_.pose.heading);
    const double s = std::sin(match_.pose.heading);
    Matrix<2, 2> turn;
    turn << c, -s, s, c;
    places_.clear();
    for (std::size_t i = 0; i < beams_.size(); i += stride) {
      places_.emplace_back(match_.pose.position() + turn * beams_[i].end);
    }
    if (found_.size() != places_.size() || moved_since_ > kSameMatches * config_.sigma_range_m) {
      cloud_.nearest(places_, found_);
      moved_since_ = 0.0;
    }
    pairs_.clear();
    for (std::size_t k = 0; k < places_.size(); ++k) {
      pair_with(beams_[k * stride], cloud_.points()[static_cast<std::size_t>(found_[k])],
                places_[k], turn, kernel);
    }
  }

  /// Eq. (11) and (12).
  void pair_with(const LinePoint& beam, const LinePoint& wall, const Vector<2>& end,
                 const Matrix<2, 2>& turn, double kernel) {
    const Vector<2> off = end - wall.foot;
    const double reach = std::min(kReachKernels * kernel + wall.gap, config_.max_distance_m);
    const bool lines = wall.normal.squaredNorm() > 0.5 && beam.normal.squaredNorm() > 0.5;
    if (off.squaredNorm() > reach * reach ||
        (lines && wall.normal.dot(turn * beam.normal) < kSameSide)) {
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
    if (std::isfinite(pair.variance)) {  // it has a neighbour, and a length along its wall
      pairs_.push_back(pair);
    }
  }

  /// The worst of the matches are left out, as far as noise does not explain them.
  [[nodiscard]] double trimmed() {
    squares_.clear();
    for (const Pair& pair : pairs_) {
      squares_.push_back(pair.squared);
    }
    const double kept = (1.0 - config_.trimmed_share) * static_cast<double>(squares_.size());
    const double inlier = kInlierSigmas * kInlierSigmas * scale_ * scale_;
    const auto last = static_cast<std::size_t>(kept);
    if (last >= squares_.size()) {
      return std::numeric_limits<double>::infinity();
    }
    const auto at = squares_.begin() + static_cast<std::ptrdiff_t>(last);
    std::nth_element(squares_.begin(), at, squares_.end());
    return std::max(*at, inlier);
  }

  Normal accumulate(double kernel) {
    const double c = kernel / (std::sqrt(2.0) * config_.sigma_range_m);
    const double bound = trimmed();
    Normal normal;
    for (const Pair& pair : pairs_) {
      if (pair.squared <= bound) {
        const double damping = 1.0 + pair.squared / (c * c);
        normal.add(pair, 1.0 / (damping * damping * scale_ * scale_ * pair.variance));
      }
    }
    return normal;
  }

  Normal accumulate_inliers() {
    Normal normal;
    for (const Pair& pair : pairs_) {
      if (pair.squared <= kInlierSigmas * kInlierSigmas * scale_ * scale_) {
        normal.add(pair, 1.0 / (scale_ * scale_ * pair.variance));
      }
    }
    return normal;
  }

  double step(const Normal& normal, double damping) {
    const Observed seen = normal.observed_part();
    const Vector<3> moved = damping * newton_step(seen, prior_, match_.pose);
    match_.pose = retract(match_.pose, seen.per_scale.cwiseProduct(moved));
    moved_since_ += moved.norm();
    return moved.norm();
  }

  /// Residuals over what is expected, by their median: at least 1.
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
    scale_ = std::max(1.0, 1.4826 * std::sqrt(*middle));
  }

  ScanMatch ended(ScanMatch::Reason reason) {
    match_.pose = start_;
    match_.reason = reason;
    return match_;
  }

  ScanMatch finished() {
    pair_up(floor(), 1);
    const Normal normal = accumulate_inliers();
    if (normal.matches < kLeastMatches) {
      return ended(ScanMatch::Reason::kTooFewMatches);
    }
    const Observed seen = normal.observed_part();
    if (!(step(normal, 1.0) < kLongestStep)) {
      return ended(ScanMatch::Reason::kNoConvergence);
    }
    match_.information = seen.information;
    if (seen.weak) {
      match_.weak_direction = *seen.weak / seen.weak->norm();
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
      if (e2 <= kExplainedM * kExplainedM ||
          pair.squared <= kInlierSigmas * kInlierSigmas * scale_ * scale_) {
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
  std::vector<int> found_;    // the nearest foot to each
  double moved_since_ = 0.0;  // they were searched
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
