// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/scan_matcher.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "frontends/scan_refine.hpp"
#include "frontends/scan_search.hpp"
#include "maps/given.hpp"
#include "math/refuse.hpp"

namespace locfuse {
namespace {

using internal::Beams;
using internal::Fit;
using internal::Prior;
using internal::refuse;

void require_share(const char* what, double value) {
  if (!(value >= 1e-12 && value < 1.0)) {
    refuse(what, value, "1e-12 or more, and less than 1");
  }
}

ScanMatcherConfig checked(const ScanMatcherConfig& config) {
  if (!(config.sigma_range_m >= 1e-6 && config.sigma_range_m <= 10.0)) {
    refuse("ScanMatcherConfig.sigma_range_m", config.sigma_range_m, "1e-6 to 10");
  }
  require_share("ScanMatcherConfig.outlier_share", config.outlier_share);
  require_share("ScanMatcherConfig.no_return_share", config.no_return_share);
  require_share("ScanMatcherConfig.wrong_probability", config.wrong_probability);
  require_share("ScanMatcherConfig.min_explained", config.min_explained);
  if (config.max_hypotheses < 2) {
    refuse("ScanMatcherConfig.max_hypotheses", config.max_hypotheses, "2 or more");
  }
  if (config.max_iterations < 1 || config.max_iterations > 1000) {
    refuse("ScanMatcherConfig.max_iterations", config.max_iterations, "1 to 1000");
  }
  return config;
}

/// Constants of ScanMatcher; docs/models/scans.md.
struct ScanMatcherTuning {
  /// Error of the guess that a refinement starts with [m], and of a coarse minimum [cells].
  static constexpr double kRefineCapture = 0.4;
  static constexpr double kSearchCapture = 6.0;
  /// The same of a fit that is repeated with exact neighbours [cells].
  static constexpr double kExactCapture = 2.0;
  /// Half the window of a search [standard deviations of the position].
  static constexpr double kWindowSigmas = 3.0;
  /// Two fits within these are one: distance [cells] and turn [rad].
  static constexpr double kDuplicateDistance = 2.0;
  static constexpr double kDuplicateTurn = 3.0 * kPi / 180.0;
  /// So are two within these whose squared Mahalanobis distance is below three sigma squared: the
  /// scan does not distinguish them.
  static constexpr double kSimilarDistance = 10.0;
  static constexpr double kSimilarTurn = 10.0 * kPi / 180.0;
  static constexpr double kSimilarSquared = 9.0;
  /// Minimum standard deviation by which hypotheses are compared [cells]: precision of a map.
  static constexpr double kMinSigma = 0.5;
};

/// Covariance of (x, y, ...) in world as information in the field frame, in cells.
template <int N>
Matrix<N, N> information_in_field(const Matrix<N, N>& covariance, const OccupancyGrid& grid) {
  const double c = std::cos(grid.origin().heading);
  const double s = std::sin(grid.origin().heading);
  Matrix<N, N> world_from_field = Matrix<N, N>::Identity();
  world_from_field.template topLeftCorner<2, 2>() << c, -s, s, c;
  world_from_field.template topLeftCorner<2, 2>() *= grid.resolution();
  const Matrix<N, N> solved = covariance.llt().solve(world_from_field);
  const Matrix<N, N> information = world_from_field.transpose() * solved;
  return 0.5 * (information + information.transpose());
}

/// Standard deviations along the axes of the field [cells]: row norms of a factor, never negative.
Vector<2> sigmas_in_field(const Matrix<2, 2>& covariance, const OccupancyGrid& grid) {
  const double c = std::cos(grid.origin().heading);
  const double s = std::sin(grid.origin().heading);
  Matrix<2, 2> field_from_world;
  field_from_world << c, s, -s, c;
  const Matrix<2, 2> factor = covariance.llt().matrixL();
  return (field_from_world * factor).rowwise().stableNorm() / grid.resolution();
}

/// A fit and its score.
struct Candidate {
  Fit fit;
  internal::Score score;
};

/// Whether two fits are one pose found twice, or two that the scan does not distinguish.
bool same_place(const Fit& a, const Fit& b, const Prior& prior) {
  const Vector<3> off = local(a.pose, b.pose);
  if (off.head<2>().norm() < ScanMatcherTuning::kDuplicateDistance &&
      std::abs(off.z()) < ScanMatcherTuning::kDuplicateTurn) {
    return true;
  }
  const Matrix<3, 3> information = 0.25 * (a.information + b.information) + 0.5 * prior.information;
  return off.head<2>().norm() < ScanMatcherTuning::kSimilarDistance &&
         std::abs(off.z()) < ScanMatcherTuning::kSimilarTurn &&
         off.dot(information * off) < ScanMatcherTuning::kSimilarSquared;
}

std::vector<Fit> distinct_fits(const std::vector<Fit>& fits, const Prior& prior) {
  std::vector<Fit> kept;
  for (const Fit& fit : fits) {
    const auto same = std::find_if(kept.begin(), kept.end(),
                                   [&](const Fit& other) { return same_place(fit, other, prior); });
    if (same == kept.end()) {
      kept.push_back(fit);
    } else if (fit.explained > same->explained) {
      *same = fit;
    }
  }
  return kept;
}

double prior_cost(const Fit& fit, const Prior& prior) {
  const Vector<3> off = local(fit.pose, prior.mean);
  return 0.5 * off.dot(prior.information * off);
}

/// Candidates by cost. All are judged by one sigma: that of the best one, at least kMinSigma.
std::vector<Candidate> ranked(const ScanMap& map, const ScanMatcherConfig& config,
                              const Beams& beams, const std::vector<Fit>& fits,
                              const Prior& prior) {
  std::vector<Candidate> candidates;
  double sigma = ScanMatcherTuning::kMinSigma;
  for (int round = 0; round < 2; ++round) {
    candidates.clear();
    for (const Fit& fit : fits) {
      internal::Score score = internal::score(map, config, beams, fit, sigma);
      score.cost += prior_cost(fit, prior);
      candidates.push_back({fit, score});
    }
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [](const Candidate& a, const Candidate& b) { return a.score.cost < b.score.cost; });
    const double best = candidates.front().fit.sigma;
    if (best <= sigma) {
      break;
    }
    sigma = best;
  }
  return candidates;
}

/// Shares of exp(-cost); docs/models/scans.md eq. (1.9).
void set_probabilities(std::vector<ScanHypothesis>& hypotheses) {
  double sum = 0.0;
  for (ScanHypothesis& hypothesis : hypotheses) {
    hypothesis.probability = std::exp(hypotheses.front().cost - hypothesis.cost);
    sum += hypothesis.probability;
  }
  for (ScanHypothesis& hypothesis : hypotheses) {
    hypothesis.probability /= sum;
  }
}

void judge(ScanSearch& found, const ScanMatcherConfig& config) {
  const ScanHypothesis& best = found.hypotheses.front();
  if (best.match.explained < config.min_explained) {
    found.status = ScanSearch::Status::kNone;
    found.reason = ScanSearch::Reason::kPoorFit;
  } else if (1.0 - best.probability > config.wrong_probability) {
    found.status = ScanSearch::Status::kAmbiguous;
    found.reason = ScanSearch::Reason::kSeveralFit;
  } else if (!best.match.covariance) {
    found.status = ScanSearch::Status::kAmbiguous;
    found.reason = ScanSearch::Reason::kHeadingUnobserved;
  } else {
    found.status = ScanSearch::Status::kReady;
    found.reason = ScanSearch::Reason::kUnique;
  }
}

}  // namespace

ScanMatcher::ScanMatcher(const std::shared_ptr<const OccupancyGrid>& grid,
                         const ScanMatcherConfig& config)
    : map_(std::make_shared<const ScanMap>(internal::given(grid, "ScanMatcher"))),
      config_(checked(config)) {}

ScanMatch ScanMatcher::refine(const LaserScan& scan, const Pose2& guess,
                              const std::optional<Matrix<3, 3>>& covariance) const {
  for (const double value : {guess.x, guess.y, guess.heading}) {
    if (!std::isfinite(value)) {
      refuse("guess", value, "finite numbers");
    }
  }
  const OccupancyGrid& grid = map_->grid();
  const int margin = map_->surface().margin_cells();
  const Beams beams = internal::beams_of(scan, grid.resolution());
  Prior prior{internal::to_field(guess, grid, margin)};
  if (covariance) {
    internal::require_covariance(*covariance);
    prior.information = information_in_field(*covariance, grid);
  }
  Fit fit;
  if (beams.x.empty()) {
    fit.reason = ScanMatch::Reason::kNoReturns;
  } else if (!grid.contains(guess.position())) {
    fit.reason = ScanMatch::Reason::kOutsideMap;
  } else {
    fit = internal::refine_around(*map_, config_, beams, prior,
                                  ScanMatcherTuning::kRefineCapture / grid.resolution());
  }
  return internal::to_match(fit, grid, margin, guess, prior);
}

ScanSearch ScanMatcher::search(const LaserScan& scan, const Vector<2>& position,
                               const Matrix<2, 2>& covariance) const {
  if (!position.allFinite()) {
    refuse("position", position.x() + position.y(), "finite numbers");
  }
  internal::require_covariance(covariance);
  const OccupancyGrid& grid = map_->grid();
  const int margin = map_->surface().margin_cells();
  const Beams beams = internal::beams_of(scan, grid.resolution());
  ScanSearch found;
  if (beams.x.empty()) {
    return found;
  }
  Prior prior{internal::to_field({position.x(), position.y(), 0.0}, grid, margin)};
  prior.information.topLeftCorner<2, 2>() = information_in_field(covariance, grid);
  const Vector<2> half_window =
      ScanMatcherTuning::kWindowSigmas * sigmas_in_field(covariance, grid);
  found.reason = ScanSearch::Reason::kOutsideMap;
  const Vector<2> low = prior.mean.position() - half_window;
  const Vector<2> high = prior.mean.position() + half_window;
  const bool on_map = high.x() >= margin && high.y() >= margin &&
                      low.x() <= margin + grid.width() && low.y() <= margin + grid.height();
  if (!on_map) {  // also where it is so far away that this is NaN
    return found;
  }
  std::vector<Fit> fits;
  ScanMatcherConfig looked_up = config_;
  looked_up.exact_neighbours = false;
  for (const Pose2& start : internal::coarse_minima(*map_, beams, prior, half_window)) {
    const Fit fit =
        internal::refine(*map_, looked_up, beams, start, prior, ScanMatcherTuning::kSearchCapture);
    if (fit.reason == ScanMatch::Reason::kConverged) {
      fits.push_back(fit);
    }
  }
  fits = distinct_fits(fits, prior);
  if (fits.empty()) {
    found.reason = ScanSearch::Reason::kPoorFit;
    return found;
  }
  if (config_.exact_neighbours) {
    for (Fit& fit : fits) {
      const Fit exact = internal::refine(*map_, config_, beams, fit.pose, prior,
                                         ScanMatcherTuning::kExactCapture);
      fit = exact.reason == ScanMatch::Reason::kConverged ? exact : fit;
    }
  }
  for (const Candidate& candidate : ranked(*map_, config_, beams, fits, prior)) {
    if (static_cast<int>(found.hypotheses.size()) == config_.max_hypotheses) {
      break;
    }
    ScanHypothesis hypothesis{internal::to_match(candidate.fit, grid, margin, {}, prior),
                              candidate.score.cost};
    hypothesis.match.explained = candidate.score.explained;
    found.hypotheses.push_back(hypothesis);
  }
  set_probabilities(found.hypotheses);
  judge(found, config_);
  return found;
}

}  // namespace locfuse
