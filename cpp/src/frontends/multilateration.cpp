// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/multilateration.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "locfuse/math/chi_squared.hpp"

namespace locfuse {

namespace {

/// Constants of range-only positioning; docs/models/ranges.md eq. (2.19) to (2.21).
struct MultilaterationTuning {
  /// Share of its distance by which an equally good position may lie away before it is searched.
  static constexpr double kSecondPositionShare = 0.1;
  /// Distance below which two minima are one [largest sigma of a range].
  static constexpr double kResolution = 0.01;
  /// Minimum information of a direction beside the trace: rounding of a double.
  static constexpr double kMinInformationShare = 1e-13;
  /// Test of first order: distance from the minimum [sigmas], and the bounds of the rise of the
  /// cost there as a share of the predicted one.
  static constexpr double kTestSigmas = 3.0;
  static constexpr double kMinRise = 0.5;
  static constexpr double kMaxRise = 2.0;
};

template <int N>
double largest_of(const RangeLayout<N>& layout, const RangesView& ranges) {
  double largest = 0.0;
  for (int i = 0; i < layout.size; ++i) {
    largest = std::max(largest, ranges[i]);
  }
  return largest;
}

/// Distance from the anchors' line or plane that the ranges imply, for a position that lies in it.
template <int N>
double excess(const RangeLayout<N>& layout, const RangesView& ranges, const Vector<N>& x) {
  double sum = 0.0;
  double total = 0.0;
  for (int i = 0; i < layout.size; ++i) {
    const double weight = layout.information[static_cast<std::size_t>(i)];
    sum += weight * (ranges[i] * ranges[i] - layout.squared_distance(x, i));
    total += weight;
  }
  return std::sqrt(std::max(sum / total, layout.largest_sigma * largest_of<N>(layout, ranges)));
}

template <int N>
AnchorTable checked(const AnchorTable& anchors, const RangesView& sigma) {
  validate(anchors, sigma);
  if (anchors.dimensions() != N) {
    throw std::invalid_argument("anchors are for positions of " +
                                std::to_string(anchors.dimensions()) + " dimensions, expected " +
                                std::to_string(N));
  }
  return anchors;
}

}  // namespace

template <int N>
void RangeMinima<N>::add(const RangeFit<N>& found, double resolution) {
  if (!std::isfinite(found.cost + found.position.sum())) {
    return;  // its squares overflow
  }
  int place = count;
  for (int j = 0; j < count; ++j) {
    const RangeFit<N>& other = fit[static_cast<std::size_t>(j)];
    if ((other.position - found.position).squaredNorm() <= resolution * resolution) {
      return;
    }
    place = std::min(place, found.cost < other.cost ? j : place);
  }
  count = std::min(count + 1, kCapacity);
  for (int j = count - 1; j > place; --j) {
    fit[static_cast<std::size_t>(j)] = fit[static_cast<std::size_t>(j - 1)];
  }
  if (place < kCapacity) {
    fit[static_cast<std::size_t>(place)] = found;
  }
}

namespace internal {

double side_margin(double wrong_side_probability) {
  if (!(wrong_side_probability > 0.0 && wrong_side_probability < 0.5)) {
    throw std::invalid_argument("wrong_side_probability is " +
                                std::to_string(wrong_side_probability) +
                                ", expected a number between 0 and 0.5");
  }
  // Squared quantile of a normal variable: a chi-square quantile of both sides.
  return chi_squared_quantile(1, 1.0 - 2.0 * wrong_side_probability);
}

double checked_alarm(double false_alarm_probability) {
  if (!(false_alarm_probability > 0.0 && false_alarm_probability < 1.0)) {
    throw std::invalid_argument("false_alarm_probability is " +
                                std::to_string(false_alarm_probability) +
                                ", expected a number between 0 and 1");
  }
  return false_alarm_probability;
}

template <int N>
double strong_below(const RangeLayout<N>& layout, double side_margin) {
  const double reach = 2.0 * MultilaterationTuning::kSecondPositionShare *
                       std::sqrt(layout.spread(0)) / layout.largest_sigma;
  if (!(reach * reach > side_margin)) {
    return -1.0;
  }
  const double root = (reach * reach - side_margin) / (2.0 * reach);
  return root * root;
}

template <int N>
bool leaves_open(const Matrix<N, N>& information, double reach) {
  const double trace = information.trace();
  const double min_information =
      std::max(1.0 / (reach * reach), MultilaterationTuning::kMinInformationShare * trace);
  // det / (trace / (N - 1))^(N - 1) is a lower bound of the smallest eigenvalue.
  if constexpr (N == 2) {
    if (information.determinant() > min_information * trace) {
      return false;
    }
  } else {
    if (information.determinant() > 0.25 * min_information * trace * trace) {
      return false;
    }
  }
  const Eigen::SelfAdjointEigenSolver<Matrix<N, N>> eigen(information, Eigen::EigenvaluesOnly);
  return !(eigen.eigenvalues()(0) > min_information);
}

template <int N>
RangeMinima<N> find_minima(const RangeLayout<N>& layout, const RangesView& ranges,
                           const RangeLoss& loss, double strong, RangeMl ml) {
  RangeMinima<N> minima;
  const double resolution = MultilaterationTuning::kResolution * layout.largest_sigma;
  const SquaredRangePosition<N> start = solve_squared_ranges<N>(layout, ranges);
  for (int j = 0; j < start.count; ++j) {
    minima.add(
        fit_ranges_by<N>(ml, layout, ranges, start.position[static_cast<std::size_t>(j)], loss),
        resolution);
  }
  if (start.count != 1 || minima.count == 0 ||
      (minima.fit[0].cost < strong && !minima.fit[0].saddle)) {
    return minima;
  }
  const RangeFit<N> first = minima.fit[0];
  const Vector<N> off = layout.axes.col(0);
  const double beside = off.dot(first.position);
  const Vector<N> among = first.position - beside * off;
  if (first.saddle) {
    minima.count = 0;
    const double step = excess<N>(layout, ranges, among);
    minima.add(fit_ranges_by<N>(ml, layout, ranges, Vector<N>(among + step * off), loss),
               resolution);
    minima.add(fit_ranges_by<N>(ml, layout, ranges, Vector<N>(among - step * off), loss),
               resolution);
  } else {
    minima.add(fit_ranges_by<N>(ml, layout, ranges, Vector<N>(among - beside * off), loss),
               resolution);
  }
  return minima;
}

template <int N>
bool defies_first_order(const RangeFit<N>& fit, const RangeLayout<N>& layout,
                        const RangesView& ranges, const RangeLoss& loss) {
  const Eigen::SelfAdjointEigenSolver<Matrix<N, N>> eigen(fit.information);
  const Vector<N> reach = MultilaterationTuning::kTestSigmas / std::sqrt(eigen.eigenvalues()(0)) *
                          eigen.eigenvectors().col(0);
  for (const double side : {-1.0, 1.0}) {
    double cost = 0.0;
    for (int i = 0; i < layout.size; ++i) {
      const double h = std::sqrt(layout.squared_distance(fit.position + side * reach, i));
      cost += loss.cost((ranges[i] - h) / layout.sigma[static_cast<std::size_t>(i)]);
    }
    const double share = (cost - fit.cost) /
                         (MultilaterationTuning::kTestSigmas * MultilaterationTuning::kTestSigmas);
    if (!(share > MultilaterationTuning::kMinRise && share < MultilaterationTuning::kMaxRise)) {
      return true;
    }
  }
  return false;
}

template <int N>
PositionStatus judge(const RangeMinima<N>& minima, const RangeLayout<N>& layout,
                     const RangesView& ranges, double side_margin) {
  if (minima.count == 0) {
    return PositionStatus::kUnderdetermined;
  }
  const RangeFit<N>& best = minima.fit[0];
  if (!best.converged) {
    return PositionStatus::kNotConverged;
  }
  if (best.saddle || leaves_open<N>(best.information, largest_of<N>(layout, ranges))) {
    return PositionStatus::kUnderdetermined;
  }
  return minima.count > 1 && minima.fit[1].cost - best.cost < side_margin
             ? PositionStatus::kAmbiguous
             : PositionStatus::kUnique;
}

}  // namespace internal

template <int N>
Multilateration<N>::Multilateration(const AnchorTable& anchors, const RangesView& sigma,
                                    const Config& config)
    : config_(config),
      rows_(checked<N>(anchors, sigma).rows),
      height_(anchors.height),
      sigma_(sigma),
      layout_(anchors, sigma),
      side_margin_(internal::side_margin(config.rules.wrong_side_probability)),
      strong_below_(internal::strong_below<N>(layout_, side_margin_)) {
  const double alarm = internal::checked_alarm(config.rules.false_alarm_probability);
  validate(config.loss);
  for (int m = 0; m <= kMaxRanges; ++m) {
    cost_limit_[static_cast<std::size_t>(m)] =
        m > N && config.loss.kind == RangeLossKind::kNone
            ? (m <= anchors.size() ? chi_squared_quantile(m - N, 1.0 - alarm) : 0.0)
            : std::numeric_limits<double>::infinity();
  }
}

template <int N>
AnchorTable Multilateration<N>::table() const {
  return {RowsView(rows_.data(), rows_.rows(), rows_.cols()), height_};
}

template <int N>
RangePosition<N> Multilateration<N>::solve(const RangesView& ranges) const {
  if (ranges.size() != sigma_.size()) {
    throw std::invalid_argument(std::to_string(ranges.size()) + " ranges, expected " +
                                std::to_string(sigma_.size()) + ", one per anchor");
  }
  RangeIndices received(ranges.size());
  int count = 0;
  for (int i = 0; i < layout_.size; ++i) {
    if (std::isnan(ranges[i])) {
      continue;
    }
    if (!is_length(ranges[i])) {
      throw std::invalid_argument("range " + std::to_string(i) + " is " +
                                  std::to_string(ranges[i]) +
                                  ", expected a positive number, 1e-12 to 1e12, or NaN if it was "
                                  "not received");
    }
    received(count++) = i;
  }
  if (count == layout_.size) {
    return solve_on(layout_, ranges, strong_below_, RangeMl::kNewton);
  }
  received.conservativeResize(count);
  Ranges without_gaps(count);
  for (int j = 0; j < count; ++j) {
    without_gaps(j) = ranges(received(j));
  }
  return solve_over(RangeLayout<N>(table(), sigma_, received), without_gaps);
}

template <int N>
RangePosition<N> Multilateration<N>::solve_on(const RangeLayout<N>& layout,
                                              const RangesView& ranges, double strong,
                                              RangeMl ml) const {
  RangePosition<N> result;
  const RangeMinima<N> minima = internal::find_minima<N>(layout, ranges, config_.loss, strong, ml);
  result.status = internal::judge<N>(minima, layout, ranges, side_margin_);
  if (minima.count == 0) {
    return result;
  }
  const RangeFit<N>& best = minima.fit[0];
  if (result.status == PositionStatus::kUnique) {
    if (best.cost > cost_limit(layout.size)) {
      result.status = PositionStatus::kInconsistent;
    } else if (best.cost >= strong &&
               internal::defies_first_order<N>(best, layout, ranges, config_.loss)) {
      result.status = PositionStatus::kUnderdetermined;
    }
  }
  result.has_position = true;
  result.position = layout.centre + best.position;
  result.cost = best.cost;
  const bool is_open =
      result.status == PositionStatus::kUnderdetermined ||
      (result.status == PositionStatus::kNotConverged &&
       (best.saddle || internal::leaves_open<N>(best.information, largest_of<N>(layout, ranges))));
  const Matrix<N, N> P = best.information.llt().solve(Matrix<N, N>::Identity());
  result.covariance = 0.5 * (P + P.transpose());
  if (is_open || result.covariance.llt().info() != Eigen::Success) {
    // First order does not hold, so no finite covariance would be true.
    result.covariance.setZero();
    result.covariance.diagonal().setConstant(std::numeric_limits<double>::infinity());
    result.status = result.status == PositionStatus::kNotConverged
                        ? result.status
                        : PositionStatus::kUnderdetermined;
  }
  return result;
}

template <int N>
RangePosition<N> solve_by_squares(const RangeLayout<N>& layout, const RangesView& ranges,
                                  SquaredRangeWeights weights) {
  RangePosition<N> result;
  const SquaredRangePosition<N> found = solve_squared_ranges<N>(layout, ranges, weights);
  if (found.count == 0) {
    return result;
  }
  result.has_position = true;
  const Vector<N> x = found.position[0];
  result.position = layout.centre + x;
  for (int i = 0; i < layout.size; ++i) {
    const double error = ranges[i] - std::sqrt(layout.squared_distance(x, i));
    result.cost += layout.information[static_cast<std::size_t>(i)] * error * error;
  }
  RangeGain<N> gain;
  if (!squared_range_gain<N>(layout, x, ranges, weights, gain)) {
    result.covariance.diagonal().setConstant(std::numeric_limits<double>::infinity());
    return result;
  }
  result.covariance = covariance_of<N>(layout, gain);
  result.status = found.count > 1 ? PositionStatus::kAmbiguous : PositionStatus::kUnique;
  return result;
}

#define LOCFUSE_INSTANTIATE(N)                                                               \
  template struct RangeMinima<N>;                                                            \
  template class Multilateration<N>;                                                         \
  template double internal::strong_below<N>(const RangeLayout<N>&, double);                  \
  template bool internal::defies_first_order<N>(const RangeFit<N>&, const RangeLayout<N>&,   \
                                                const RangesView&, const RangeLoss&);        \
  template bool internal::leaves_open<N>(const Matrix<N, N>&, double);                       \
  template RangeMinima<N> internal::find_minima<N>(const RangeLayout<N>&, const RangesView&, \
                                                   const RangeLoss&, double, RangeMl);       \
  template PositionStatus internal::judge<N>(const RangeMinima<N>&, const RangeLayout<N>&,   \
                                             const RangesView&, double);                     \
  template RangePosition<N> solve_by_squares<N>(const RangeLayout<N>&, const RangesView&,    \
                                                SquaredRangeWeights);
LOCFUSE_INSTANTIATE(2)
LOCFUSE_INSTANTIATE(3)
#undef LOCFUSE_INSTANTIATE

}  // namespace locfuse
