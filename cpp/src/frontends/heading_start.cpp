// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/heading_start.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include "locfuse/math/chi_squared.hpp"

namespace locfuse {
namespace {

/// docs/start.md, "Constants".
struct HeadingTuning {
  /// Steps from the best heading from which on another one is another pose.
  static constexpr int kApart = 3;
  /// Sigmas of the position by which the mean distance of the right heading exceeds that of a wrong
  /// one at most.
  static constexpr double kSeveralSigmas = 1.0;
  /// Sigmas of the position that the end points lie off at the right heading at most.
  static constexpr double kFitSigmas = 2.0;
  /// Share of the angle by which a position that is off turns a room seen at the typical range:
  /// walls to the other side hold against it.
  static constexpr double kTurnShare = 0.5;
};

constexpr int kSteps = HeadingSearch::kSteps;

int steps_between(int a, int b) {
  const int apart = std::abs(a - b);
  return std::min(apart, kSteps - apart);
}

/// Sums per beam. At a minimum the value between the steps: both neighbours rise equally from it.
std::array<double, kSteps> mean_distances(const HeadingSearch& search) {
  std::array<double, kSteps> means{};
  for (int k = 0; k < kSteps; ++k) {
    const auto at = [&](int step) {
      return search.sums[static_cast<std::size_t>((step + kSteps) % kSteps)] / search.returns;
    };
    const bool is_minimum = at(k) <= at(k - 1) && at(k) <= at(k + 1);
    const double between = is_minimum ? 0.5 * std::abs(at(k + 1) - at(k - 1)) : 0.0;
    means[static_cast<std::size_t>(k)] = std::max(0.0, at(k) - between);
  }
  return means;
}

/// The scan as a body would see it that has its origin at `point` of the body.
LaserScan seen_from(const LaserScan& scan, const Vector<2>& point) {
  LaserScan moved = scan;
  if (scan.geometry) {  // else refused by whoever takes it
    LaserGeometry geometry = *scan.geometry;
    geometry.pose_in_body = Pose2{-point.x(), -point.y(), 0.0} * geometry.pose_in_body;
    moved.geometry = std::make_shared<const LaserGeometry>(geometry);
  }
  return moved;
}

}  // namespace

RangePosition<2> locate_by_squares(const AnchorTable& anchors, const RangesView& ranges,
                                   const RangesView& sigma) {
  validate(anchors, sigma);
  for (const double range : ranges) {
    if (!is_length(range)) {
      throw std::invalid_argument("a range is " + std::to_string(range) + " m, expected a length");
    }
  }
  const RangeLayout<2> layout(anchors, sigma);
  RangePosition<2> found = solve_by_squares<2>(layout, ranges, SquaredRangeWeights::kEqual);
  if (layout.size < 3) {
    found.status = PositionStatus::kUnderdetermined;
  }
  if (found.status != PositionStatus::kUnique) {
    return found;
  }
  const PositionRules rules;
  found.status =
      internal::judge<2>(internal::find_minima<2>(layout, ranges, RangeLoss{}, -1.0), layout,
                         ranges, internal::side_margin(rules.wrong_side_probability));
  const int dof = layout.size - 2;
  if (found.cost > chi_squared_quantile(dof, 1.0 - rules.false_alarm_probability)) {
    found.covariance *= found.cost / dof;
  }
  return found;
}

HeadingStart start_by_headings(const ScanMatcher& matcher, const LaserScan& scan,
                               const Pivot& pivot) {
  HeadingStart start;
  start.search = heading_search(matcher.map(), seen_from(scan, pivot.in_body), pivot.position);
  if (!start.search.heading) {
    return start;
  }
  constexpr double kStep = 2.0 * kPi / kSteps;
  const double cell = matcher.map().grid().resolution();
  const double turned = HeadingTuning::kTurnShare * pivot.sigma / start.search.rms_range;
  start.sigma = std::hypot(kStep / std::sqrt(12.0), turned);
  start.limit = HeadingTuning::kFitSigmas * pivot.sigma + cell +
                0.5 * matcher.config().outlier_share * start.search.rms_range;
  const std::array<double, kSteps> means = mean_distances(start.search);
  const auto best =
      static_cast<int>(std::min_element(start.search.sums.begin(), start.search.sums.end()) -
                       start.search.sums.begin());
  start.distance = means[static_cast<std::size_t>(best)];
  if (start.distance > start.limit) {
    return start;
  }
  const double several = start.distance + HeadingTuning::kSeveralSigmas * pivot.sigma + cell;
  start.headings.push_back(*start.search.heading);
  for (int k = 0; k < kSteps; ++k) {
    if (steps_between(k, best) >= HeadingTuning::kApart &&
        means[static_cast<std::size_t>(k)] <= several) {
      start.headings.push_back(wrap_angle(k * kStep));
    }
  }
  return start;
}

}  // namespace locfuse
