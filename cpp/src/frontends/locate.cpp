// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/locate.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "locfuse/math/angle.hpp"
#include "locfuse/math/chi_squared.hpp"

namespace locfuse {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Constants of `locate`; docs/models/ranges.md eq. (2.18) to (2.21).
struct LocateTuning {
  /// Distance below which two minima are one [largest sigma of a range].
  static constexpr double kResolution = 0.01;
  /// Starts around the circle or sphere that fits, and the sine of the elevation of the upper and
  /// lower circles of the sphere.
  static constexpr int kSamplesAround = 16;
  static constexpr double kSampleTilt = 0.7;
  /// Smallest eigenvalue of an information, and of the covariance of a difference, beside the
  /// largest: rounding of a double.
  static constexpr double kMinInformationShare = 1e-14;
  static constexpr double kMinVarianceShare = 1e-12;
  /// Minimum redundancy of ranges for a culprit: with one, all removals fit equally well.
  static constexpr int kMinRedundancy = 2;
};

std::string text_of(const Eigen::VectorXd& values) {
  std::string text = "(";
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    const std::string number = std::to_string(values(k));
    const std::size_t point = number.find('.');
    text +=
        (k > 0 ? ", " : "") + (point == std::string::npos ? number : number.substr(0, point + 4));
  }
  return text + ")";
}

void check_ranges(const RangesView& ranges, int size) {
  if (ranges.size() != size) {
    throw std::invalid_argument(std::to_string(ranges.size()) + " ranges, expected " +
                                std::to_string(size) + ", one per anchor");
  }
  for (int i = 0; i < size; ++i) {
    if (!is_length(ranges[i])) {
      throw std::invalid_argument("range " + std::to_string(i) + " is " +
                                  std::to_string(ranges[i]) +
                                  ", expected a positive number, 1e-12 to 1e12");
    }
  }
}

void check_options(const LocateOptions& options, int dimensions) {
  validate(options.loss);
  internal::checked_alarm(options.rules.false_alarm_probability);
  const CeresOptions& ceres = options.ceres;
  if (!(ceres.max_iterations >= 0 && ceres.function_tolerance >= 0.0 &&
        ceres.gradient_tolerance >= 0.0 && ceres.parameter_tolerance >= 0.0)) {
    throw std::invalid_argument("an option of Ceres is negative or not a number");
  }
  if (options.prior) {
    const AxisPrior& prior = *options.prior;
    if (prior.mean.size() != dimensions || prior.sigma.size() != dimensions ||
        !(prior.mean.array().abs() <= kMaxLength).all() ||
        !(prior.sigma.array() >= kMinLength).all()) {
      throw std::invalid_argument("prior has mean " + text_of(prior.mean) + " and sigma " +
                                  text_of(prior.sigma) + ", expected " +
                                  std::to_string(dimensions) +
                                  " finite numbers and as many positive ones, 1e-12 or more");
    }
  }
  if (options.box) {
    const PositionBox& box = *options.box;
    if (box.low.size() != dimensions || box.high.size() != dimensions ||
        !(box.low.array() <= box.high.array()).all()) {
      throw std::invalid_argument("box is from " + text_of(box.low) + " to " + text_of(box.high) +
                                  ", expected " + std::to_string(dimensions) +
                                  " lower and upper ends in order");
    }
  }
}

/// One call of `locate` in N dimensions.
template <int N>
class Locator {
 public:
  Locator(const AnchorTable& anchors, const RangesView& ranges, const RangesView& sigma,
          const LocateOptions& options)
      : anchors_(anchors),
        ranges_(ranges),
        sigma_(sigma),
        options_(options),
        layout_(anchors, sigma),
        margin_(internal::side_margin(options.rules.wrong_side_probability)) {
    if (options.prior) {
      prior_.mean = options.prior->mean - layout_.centre;
      prior_.information = options.prior->sigma.cwiseAbs2().cwiseInverse();
    }
  }

  PositionSolution run() {
    squared_ = solve_squared_ranges<N>(layout_, ranges_, options_.weights);
    find_minima();
    const bool excluded = minima_.count > 0 && !keep_inside_box();
    report_hypotheses();
    if (excluded) {
      solution_.status = PositionStatus::kExcluded;
      solution_.reason = "every position that fits is outside the box";
      return solution_;
    }
    solution_.status = internal::judge<N>(minima_, layout_, ranges_, margin_);
    if (minima_.count > 0) {
      if (is_continuum_sampled()) {
        solution_.status = PositionStatus::kUnderdetermined;
      }
      report_best();
    }
    state_reason();
    return solution_;
  }

 private:
  RangeFit<N> fit(const Vector<N>& start, std::string* termination = nullptr) const {
    return fit_ranges_by<N>(options_.ml, layout_, ranges_, start, options_.loss, prior_,
                            options_.ceres, termination);
  }

  void try_start(const Vector<N>& start) {
    minima_.add(fit(start), LocateTuning::kResolution * layout_.largest_sigma);
  }

  void find_minima() {
    for (int j = 0; j < squared_.count; ++j) {
      try_start(squared_.position[static_cast<std::size_t>(j)]);
    }
    if (squared_.count == 0) {
      if (constrained()) {
        try_samples();
      }
      return;
    }
    if (minima_.count == 0) {
      return;
    }
    const RangeFit<N> first = minima_.fit[0];
    const Vector<N> off = layout_.axes.col(0);
    if (first.saddle) {
      minima_.count = 0;
    }
    const double beside = first.position.dot(off);
    const Vector<N> among = first.position - beside * off;
    const double step = first.saddle ? off_plane(among) : std::abs(beside);
    try_start(among - std::copysign(step, beside) * off);
    if (first.saddle) {
      try_start(among + std::copysign(step, beside) * off);
    }
  }

  [[nodiscard]] bool constrained() const { return options_.prior || options_.box; }

  /// Whether a whole circle or sphere fits and no prior changes the cost along it.
  [[nodiscard]] bool is_continuum_sampled() const { return squared_.count == 0 && !options_.prior; }

  /// Distance from the anchors' line or plane that the ranges imply.
  [[nodiscard]] double off_plane(const Vector<N>& x) const {
    double sum = 0.0;
    double largest = 0.0;
    for (int i = 0; i < layout_.size; ++i) {
      sum += ranges_[i] * ranges_[i] - layout_.squared_distance(x, i);
      largest = std::max(largest, ranges_[i]);
    }
    return std::sqrt(std::max(sum / layout_.size, layout_.largest_sigma * largest));
  }

  /// Tries starts on the circle or sphere that fits, for a prior or a box to decide.
  void try_samples() {
    double radius_squared = 0.0;
    for (int i = 0; i < layout_.size; ++i) {
      radius_squared +=
          (ranges_[i] * ranges_[i] - layout_.squared_distance(Vector<N>::Zero(), i)) / layout_.size;
    }
    const double radius = std::sqrt(std::max(radius_squared, 0.0));
    for (int k = 0; k < LocateTuning::kSamplesAround; ++k) {
      const double angle = 2.0 * kPi * (k + 0.5) / LocateTuning::kSamplesAround;
      for (int tilt = -1; tilt <= (N == 3 ? 1 : -1); ++tilt) {
        const double along = N == 3 ? LocateTuning::kSampleTilt * tilt : 0.0;
        const double around = std::sqrt(1.0 - along * along);
        Vector<N> direction = Vector<N>::Zero();
        direction(0) = around * std::cos(angle);
        direction(1) = around * std::sin(angle);
        direction(N - 1) += along;
        try_start(radius * (layout_.axes * direction));
      }
    }
  }

  bool keep_inside_box() {
    if (!options_.box) {
      return true;
    }
    RangeMinima<N> inside;
    for (int j = 0; j < minima_.count; ++j) {
      const RangeFit<N>& found = minima_.fit[static_cast<std::size_t>(j)];
      const Vector<N> x = found.position + layout_.centre;
      if ((x.array() >= options_.box->low.array()).all() &&
          (x.array() <= options_.box->high.array()).all()) {
        inside.add(found, 0.0);
      }
    }
    minima_ = inside;
    return minima_.count > 0;
  }

  void report_hypotheses() {
    for (int j = 0; j < minima_.count; ++j) {
      const RangeFit<N>& found = minima_.fit[static_cast<std::size_t>(j)];
      if (found.cost - minima_.fit[0].cost >= margin_) {
        break;
      }
      const Eigen::SelfAdjointEigenSolver<Matrix<N, N>> eigen(found.information);
      const double smallest = eigen.eigenvalues()(0);
      PositionHypothesis hypothesis;
      hypothesis.position = layout_.centre + found.position;
      hypothesis.cost = found.cost;
      hypothesis.weak_direction = eigen.eigenvectors().col(0);
      const bool open =
          !(smallest > LocateTuning::kMinInformationShare * eigen.eigenvalues()(N - 1));
      hypothesis.weak_sigma = open ? kInfinity : 1.0 / std::sqrt(smallest);
      hypothesis.covariance = Matrix<N, N>(Vector<N>::Constant(kInfinity).asDiagonal());
      for (int k = 0; open && k < N * N; ++k) {
        hypothesis.covariance(k / N, k % N) = k / N == k % N ? kInfinity : 0.0;
      }
      if (!open) {
        const Matrix<N, N> P = eigen.eigenvectors() *
                               eigen.eigenvalues().cwiseInverse().asDiagonal() *
                               eigen.eigenvectors().transpose();
        hypothesis.covariance = 0.5 * (P + P.transpose());
      }
      solution_.hypotheses.push_back(hypothesis);
    }
  }

  void report_best() {
    const RangeFit<N>& best = minima_.fit[0];
    solution_.iterations = fit(start_of_best(), &solution_.termination).iterations;
    solution_.residuals.resize(layout_.size);
    for (int i = 0; i < layout_.size; ++i) {
      solution_.residuals(i) = ranges_[i] - std::sqrt(layout_.squared_distance(best.position, i));
    }
    solution_.dop = dilution(anchors_, layout_.centre + best.position);
    test_fit();
    compare();
    const bool alarm =
        !solution_.fits() || (solution_.comparison && !solution_.comparison->agree());
    if (alarm && solution_.fit_tested) {
      find_culprit();
      if (solution_.status == PositionStatus::kUnique) {
        solution_.status = PositionStatus::kInconsistent;
      }
    }
    if (solution_.status == PositionStatus::kUnique && !options_.prior &&
        best.cost >= internal::strong_below<N>(layout_, margin_) &&
        internal::defies_first_order<N>(best, layout_, ranges_, options_.loss)) {
      solution_.status = PositionStatus::kUnderdetermined;
    }
  }

  [[nodiscard]] Vector<N> start_of_best() const {
    Vector<N> start = minima_.fit[0].position;
    double nearest = kInfinity;
    for (int j = 0; j < squared_.count; ++j) {
      const Vector<N>& from = squared_.position[static_cast<std::size_t>(j)];
      const double distance = (from - minima_.fit[0].position).norm();
      if (distance < nearest) {
        nearest = distance;
        start = from;
      }
    }
    return start;
  }

  void test_fit() {
    const int priors = static_cast<int>((prior_.information.array() > 0.0).count());
    solution_.fit_dof = layout_.size + priors - N;
    solution_.fit_tested = options_.loss.kind == RangeLossKind::kNone && solution_.fit_dof > 0;
    if (solution_.fit_tested) {
      solution_.fit_limit = limit_of(solution_.fit_dof);
    }
  }

  [[nodiscard]] double limit_of(int dof) const {
    return chi_squared_quantile(dof, 1.0 - options_.rules.false_alarm_probability);
  }

  void compare() {
    if (squared_.count == 0) {
      return;
    }
    SolverComparison comparison;
    const Vector<N> beck = start_of_best();
    comparison.squared_range_position = layout_.centre + beck;
    comparison.difference = minima_.fit[0].position - beck;
    RangeGain<N> by_squares;
    RangeGain<N> by_likelihood;
    if (!squared_range_gain<N>(layout_, beck, ranges_, options_.weights, by_squares)) {
      return;
    }
    comparison.squared_range_covariance = covariance_of<N>(layout_, by_squares);
    const int dof = std::min(N, layout_.size - N);
    if (dof > 0 && solution_.fit_tested && !options_.prior &&
        range_fit_gain<N>(layout_, minima_.fit[0], by_likelihood)) {
      const Matrix<N, N> covariance =
          covariance_of<N>(layout_, RangeGain<N>(by_likelihood - by_squares));
      const Eigen::SelfAdjointEigenSolver<Matrix<N, N>> eigen(covariance);
      const Vector<N> along = eigen.eigenvectors().transpose() * comparison.difference;
      for (int k = N - dof; k < N; ++k) {
        if (eigen.eigenvalues()(k) > LocateTuning::kMinVarianceShare * eigen.eigenvalues()(N - 1)) {
          comparison.statistic += along(k) * along(k) / eigen.eigenvalues()(k);
          ++comparison.dof;
        }
      }
      comparison.limit = comparison.dof > 0 ? limit_of(comparison.dof) : 0.0;
    }
    solution_.comparison = comparison;
  }

  /// Finds the culprit by removing each range in turn.
  void find_culprit() {
    if (layout_.size - N < LocateTuning::kMinRedundancy) {
      return;
    }
    RangeCulprit culprit;
    for (int out = 0; out < layout_.size; ++out) {
      RangeIndices others(layout_.size - 1);
      Ranges ranges(layout_.size - 1);
      for (int i = 0, j = 0; i < layout_.size; ++i) {
        if (i != out) {
          ranges(j) = ranges_[i];
          others(j++) = i;
        }
      }
      const RangeLayout<N> layout(anchors_, sigma_, others);
      const RangeMinima<N> minima = internal::find_minima<N>(layout, ranges, {}, -1.0);
      if (minima.count == 0) {
        continue;
      }
      const double drop = minima_.fit[0].cost - minima.fit[0].cost;
      if (drop > culprit.statistic) {
        culprit.index = out;
        culprit.statistic = drop;
        culprit.explains = minima.fit[0].cost <= limit_of(layout.size - N);
        culprit.without = layout.centre + minima.fit[0].position;
      }
    }
    if (culprit.index >= 0) {
      solution_.culprit = culprit;
    }
  }

  void state_reason() {
    switch (solution_.status) {
      case PositionStatus::kUnderdetermined:
        solution_.reason = underdetermined_reason();
        break;
      case PositionStatus::kAmbiguous:
        solution_.reason = std::to_string(solution_.hypotheses.size()) +
                           " positions fit: the anchors are nearly mirror symmetric across " +
                           text_of(layout_.axes.col(0));
        break;
      case PositionStatus::kInconsistent:
        solution_.reason = inconsistent_reason();
        break;
      case PositionStatus::kNotConverged:
        solution_.reason = "the solver stopped early: " + solution_.termination;
        break;
      default:
        break;
    }
  }

  [[nodiscard]] std::string underdetermined_reason() const {
    const std::string shape = layout_.within(0) ? "in one point" : "on one line";
    if (layout_.size < N) {
      return std::to_string(layout_.size) + " ranges, a position needs at least " +
             std::to_string(N);
    }
    if (layout_.within(N - 2)) {
      return "the anchors are " + shape + ": a whole " +
             (N == 3 && layout_.within(0) ? "sphere" : "circle") + " fits";
    }
    if (solution_.hypotheses.empty()) {
      return "a whole curve or surface fits";
    }
    return "the ranges leave the direction " + text_of(solution_.hypotheses[0].weak_direction) +
           " open";
  }

  [[nodiscard]] std::string inconsistent_reason() const {
    std::string text = solution_.fits() ? "the solvers disagree more than the sigmas allow"
                                        : "the ranges fit worse than the sigmas allow";
    if (!solution_.culprit) {
      return text + "; with " + std::to_string(layout_.size) +
             " ranges no single one can be identified as wrong";
    }
    return text + (solution_.culprit->explains ? "; all but range " : "; the worst is range ") +
           std::to_string(solution_.culprit->index) +
           (solution_.culprit->explains ? " fit" : ", and the others do not fit either");
  }

  const AnchorTable& anchors_;
  const RangesView& ranges_;
  const RangesView& sigma_;
  const LocateOptions& options_;
  RangeLayout<N> layout_;
  double margin_;
  PositionPrior<N> prior_;
  SquaredRangePosition<N> squared_;
  RangeMinima<N> minima_;
  PositionSolution solution_;
};

PositionSolution locate_by(const AnchorTable& anchors, const RangesView& ranges,
                           const RangesView& sigma, const LocateOptions& options) {
  if (anchors.dimensions() == 2) {
    return Locator<2>(anchors, ranges, sigma, options).run();
  }
  return Locator<3>(anchors, ranges, sigma, options).run();
}

/// Compares the best of ours with the nearest of Ceres.
std::optional<MlComparison> compare_ml(const PositionSolution& ours,
                                       const PositionSolution& ceres) {
  std::optional<MlComparison> nearest;
  for (const PositionHypothesis& other : ceres.hypotheses) {
    if (ours.hypotheses.empty()) {
      break;
    }
    const PositionHypothesis& best = ours.hypotheses.front();
    const Eigen::VectorXd apart = other.position - best.position;
    if (!nearest || apart.norm() < nearest->distance) {
      const double squared =
          best.covariance.allFinite() ? apart.dot(best.covariance.llt().solve(apart)) : kNan;
      nearest = {other.position, other.covariance, other.cost, apart.norm(), std::sqrt(squared)};
    }
  }
  return nearest;
}

}  // namespace

PositionSolution locate(const AnchorTable& anchors, const RangesView& ranges,
                        const RangesView& sigma, const LocateOptions& options) {
  validate(anchors, sigma);
  check_ranges(ranges, anchors.size());
  check_options(options, anchors.dimensions());
  PositionSolution solution = locate_by(anchors, ranges, sigma, options);
  if (options.ml == RangeMl::kBoth) {
    LocateOptions by_ceres = options;
    by_ceres.ml = RangeMl::kCeres;
    solution.ml_comparison = compare_ml(solution, locate_by(anchors, ranges, sigma, by_ceres));
  }
  return solution;
}

}  // namespace locfuse
