// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/squared_range.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "frontends/flat_anchors.hpp"

namespace locfuse {

namespace {

/// Constants of SR-LS; docs/models/ranges.md eq. (2.7) to (2.10).
struct SquaredRangeTuning {
  /// Stiffness, or its right side, that counts as 0: anchors on a line or plane.
  static constexpr double kFlat = internal::FlatAnchors::kShare;
  /// Newton's method: maximum number of steps, and the step below which it has converged, as a
  /// share of the distance to the end of the interval.
  static constexpr int kMaxSteps = 200;
  static constexpr double kConverged = 1e-12;
};

/// Frame in which A'WA is diagonal: eq. (2.5) of docs/models/ranges.md.
template <int N>
struct Frame {
  Vector<N> centre;  ///< weighted centroid of the anchors, in the layout's frame
  Matrix<N, N> axes;
  Vector<N> spread;  ///< mu
  std::array<double, kMaxRanges> weight;
  double total = 0.0;  ///< sum of the weights
};

/// Eq. (2.8): sum g^2 / (stiffness + alpha)^2 = level + slope alpha.
template <int N>
struct Secular {
  Vector<N> stiffness;  ///< 4 mu
  Vector<N> g;
  double level = 0.0;
  double slope = 0.0;
  double lower = 0.0;     ///< end of the interval of alpha, eq. (2.9)
  double rounding = 0.0;  ///< largest rounding error of g
};

/// 1 / variance of a squared range, eq. (2.11).
template <int N>
double weight_of(const RangeLayout<N>& layout, const RangesView& ranges,
                 SquaredRangeWeights weights, int i) {
  if (weights == SquaredRangeWeights::kEqual) {
    return 1.0;
  }
  const auto slot = static_cast<std::size_t>(i);
  const double variance = layout.sigma[slot] * layout.sigma[slot];
  return layout.information[slot] / (4.0 * ranges[i] * ranges[i] + 2.0 * variance);
}

template <int N>
void weigh(const RangeLayout<N>& layout, const RangesView& ranges, SquaredRangeWeights weights,
           Frame<N>& frame) {
  frame.centre.setZero();
  for (int i = 0; i < layout.size; ++i) {
    const double weight = weight_of(layout, ranges, weights, i);
    frame.weight[static_cast<std::size_t>(i)] = weight;
    frame.total += weight;
    frame.centre += weight * layout.offset(i);
  }
  frame.centre /= frame.total;
  Matrix<N, N> moments = Matrix<N, N>::Zero();
  for (int i = 0; i < layout.size; ++i) {
    const Vector<N> a = layout.offset(i) - frame.centre;
    moments += frame.weight[static_cast<std::size_t>(i)] * a * a.transpose();
  }
  frame.axes = internal::principal_axes(moments);
  frame.spread.setZero();
  for (int i = 0; i < layout.size; ++i) {
    const Vector<N> a = frame.axes.transpose() * (layout.offset(i) - frame.centre);
    frame.spread += frame.weight[static_cast<std::size_t>(i)] * a.cwiseAbs2();
  }
}

template <int N>
Secular<N> secular_of(const Matrix<N, N>& axes, const Vector<N>& spread, const Vector<N>& moment,
                      double sum, double magnitude, double total) {
  Secular<N> secular;
  secular.stiffness = 4.0 * spread;
  secular.g = -2.0 * (axes.transpose() * moment);
  secular.level = sum / total;
  secular.slope = 0.5 / total;
  secular.lower = -secular.stiffness(0);
  secular.rounding = SquaredRangeTuning::kFlat * magnitude * std::sqrt(spread(N - 1) / total);
  return secular;
}

template <int N>
Secular<N> equal_weights(const RangeLayout<N>& layout, const RangesView& ranges) {
  Vector<N> moment = Vector<N>::Zero();
  double sum = 0.0;
  double magnitude = 0.0;
  for (int i = 0; i < layout.size; ++i) {
    const Vector<N> a = layout.offset(i);
    const double b = ranges[i] * ranges[i] - layout.height_squared[static_cast<std::size_t>(i)] -
                     a.squaredNorm();
    moment += b * a;
    sum += b;
    magnitude += std::abs(b);
  }
  return secular_of<N>(layout.axes, layout.spread, moment, sum, magnitude, layout.size);
}

template <int N>
Secular<N> with_weights(const RangeLayout<N>& layout, const RangesView& ranges,
                        const Frame<N>& frame) {
  Vector<N> moment = Vector<N>::Zero();
  double sum = 0.0;
  double magnitude = 0.0;
  for (int i = 0; i < layout.size; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const Vector<N> a = layout.offset(i) - frame.centre;
    const double b = frame.weight[slot] *
                     (ranges[i] * ranges[i] - layout.height_squared[slot] - a.squaredNorm());
    moment += b * a;
    sum += b;
    magnitude += std::abs(b);
  }
  return secular_of<N>(frame.axes, frame.spread, moment, sum, magnitude, frame.total);
}

/// Root by Newton's method inside a bracket. The left side is convex and decreasing, the right side
/// increasing, so steps from the left of the root never overshoot.
template <int N>
double root(const Secular<N>& secular) {
  double low = secular.lower;
  double high = std::numeric_limits<double>::infinity();
  double alpha = 0.0;
  if (secular.lower == 0.0) {
    alpha = secular.stiffness(N - 1);  // flat anchors: the interval starts here
  }
  for (int i = 0; i < SquaredRangeTuning::kMaxSteps; ++i) {
    double length = 0.0;
    double fall = 0.0;
    for (int k = 0; k < N; ++k) {
      const double inverse = 1.0 / (secular.stiffness(k) + alpha);
      const double x = secular.g(k) * inverse;
      length += x * x;
      fall += x * x * inverse;
    }
    const double gap = length - (secular.level + secular.slope * alpha);
    (gap > 0.0 ? low : high) = alpha;
    const double newton = gap / (2.0 * fall + secular.slope);
    double next = alpha + newton;
    if (next == alpha ||
        std::abs(newton) <= SquaredRangeTuning::kConverged * (alpha - secular.lower)) {
      return std::max(next, secular.lower);  // a further step would be rounding
    }
    if (!(next > low && next < high)) {
      next = 0.5 * (low + high);
    }
    if (next == low || next == high) {
      return next;
    }
    alpha = next;
  }
  return alpha;
}

/// The hard case, eq. (2.10): at the end of the interval the directions of least spread are free.
/// False if it is not the hard case.
template <int N>
bool solve_hard_case(const Secular<N>& secular, SquaredRangePosition<N>& found) {
  int free = 0;
  double rest = secular.level + secular.slope * secular.lower;
  found.position[0].setZero();
  for (int k = 0; k < N; ++k) {
    const double left = secular.stiffness(k) + secular.lower;
    if (left <= SquaredRangeTuning::kFlat * secular.stiffness(N - 1)) {
      if (std::abs(secular.g(k)) > secular.rounding) {
        return false;
      }
      ++free;
    } else {
      found.position[0](k) = secular.g(k) / left;
      rest -= found.position[0](k) * found.position[0](k);
    }
  }
  if (!(rest > 0.0)) {
    return false;
  }
  found.multiplier = secular.lower;
  found.count = free == 1 ? 2 : 0;
  found.position[1] = found.position[0];
  found.position[0](0) = std::sqrt(rest);
  found.position[1](0) = -std::sqrt(rest);
  return true;
}

template <int N>
SquaredRangePosition<N> minimise(Secular<N>& secular) {
  SquaredRangePosition<N> found;
  if (std::abs(secular.g(0)) <= secular.rounding) {
    if (solve_hard_case<N>(secular, found)) {
      return found;
    }
    if (secular.stiffness(0) <= SquaredRangeTuning::kFlat * secular.stiffness(N - 1)) {
      secular.g(0) = 0.0;  // flat anchors and a position among them
    }
  }
  found.count = 1;
  found.multiplier = root<N>(secular);
  for (int k = 0; k < N; ++k) {
    const double left = secular.stiffness(k) + found.multiplier;
    found.position[0](k) = secular.g(k) == 0.0 ? 0.0 : secular.g(k) / left;
  }
  return found;
}

}  // namespace

template <int N>
SquaredRangePosition<N> solve_squared_ranges(const RangeLayout<N>& layout, const RangesView& ranges,
                                             SquaredRangeWeights weights) {
  if (layout.size == 0 || layout.within(N - 2)) {
    return {};
  }
  if (weights == SquaredRangeWeights::kEqual) {
    Secular<N> secular = equal_weights<N>(layout, ranges);
    SquaredRangePosition<N> found = minimise<N>(secular);
    for (int j = 0; j < found.count; ++j) {
      const auto slot = static_cast<std::size_t>(j);
      found.position[slot] = (layout.axes * found.position[slot]).eval();
    }
    return found;
  }
  Frame<N> frame;
  weigh<N>(layout, ranges, weights, frame);
  Secular<N> secular = with_weights<N>(layout, ranges, frame);
  SquaredRangePosition<N> found = minimise<N>(secular);
  for (int j = 0; j < found.count; ++j) {
    const auto slot = static_cast<std::size_t>(j);
    found.position[slot] = (frame.centre + frame.axes * found.position[slot]).eval();
  }
  return found;
}

template <int N>
bool squared_range_gain(const RangeLayout<N>& layout, const Vector<N>& x, const RangesView& ranges,
                        SquaredRangeWeights weights, RangeGain<N>& gain) {
  Matrix<N, N> stiffness = Matrix<N, N>::Zero();
  gain.resize(N, layout.size);
  for (int i = 0; i < layout.size; ++i) {
    const double weight = weight_of(layout, ranges, weights, i);
    const Vector<N> d = x - layout.offset(i);
    stiffness += weight * d * d.transpose();
    gain.col(i) = weight * ranges[i] * d;
  }
  const Eigen::FullPivLU<Matrix<N, N>> factor(stiffness);
  if (!factor.isInvertible()) {
    return false;
  }
  gain = factor.solve(gain).eval();
  return true;
}

template <int N>
Matrix<N, N> covariance_of(const RangeLayout<N>& layout, const RangeGain<N>& gain) {
  Matrix<N, N> covariance = Matrix<N, N>::Zero();
  for (int i = 0; i < layout.size; ++i) {
    const Vector<N> column = gain.col(i) * layout.sigma[static_cast<std::size_t>(i)];
    covariance += column * column.transpose();
  }
  return covariance;
}

#define LOCFUSE_INSTANTIATE(N)                                                                    \
  template SquaredRangePosition<N> solve_squared_ranges<N>(                                       \
      const RangeLayout<N>&, const RangesView&, SquaredRangeWeights);                             \
  template bool squared_range_gain<N>(const RangeLayout<N>&, const Vector<N>&, const RangesView&, \
                                      SquaredRangeWeights, RangeGain<N>&);                        \
  template Matrix<N, N> covariance_of<N>(const RangeLayout<N>&, const RangeGain<N>&);
LOCFUSE_INSTANTIATE(2)
LOCFUSE_INSTANTIATE(3)
#undef LOCFUSE_INSTANTIATE

}  // namespace locfuse
