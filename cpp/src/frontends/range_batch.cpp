// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/range_batch.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "frontends/range_lanes.hpp"
#include "math/processor.hpp"

namespace locfuse {

namespace {

/// The ranges of one epoch that were heard, and their rows.
struct Heard {
  std::array<int, kMaxRanges> row = {};
  std::array<double, kMaxRanges> range = {};
  int size = 0;
  bool good = true;  ///< every one is a length
};

Heard heard_in(const double* ranges, int size) {
  Heard heard;
  for (int i = 0; i < size; ++i) {
    if (std::isnan(ranges[i])) {
      continue;
    }
    heard.good = heard.good && is_length(ranges[i]);
    heard.row[static_cast<std::size_t>(heard.size)] = i;
    heard.range[static_cast<std::size_t>(heard.size++)] = ranges[i];
  }
  return heard;
}

template <int N>
void write(const RangePosition<N>& found, std::size_t epoch, const PositionRows& out) {
  out.status[epoch] = found.status;
  const double missing = std::numeric_limits<double>::quiet_NaN();
  const bool has = found.has_position;
  out.cost[epoch] = has ? found.cost : missing;
  for (int k = 0; k < N; ++k) {
    out.position[epoch * N + static_cast<std::size_t>(k)] = has ? found.position(k) : missing;
  }
  for (int k = 0; k < N * N; ++k) {
    out.covariance[epoch * N * N + static_cast<std::size_t>(k)] =
        has ? found.covariance(k / N, k % N) : missing;
  }
}

/// SR-LS or SR-WLS alone.
template <int N>
RangePosition<N> by_squares(const RangeLayout<N>& layout, const double* ranges,
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

template <int N>
RangePosition<N> by_ceres(const Multilateration<N>& solver, const RangeLayout<N>& layout,
                          const double* ranges) {
  RangePosition<N> result = solver.solve_over(layout, ranges);
  const SquaredRangePosition<N> start = solve_squared_ranges<N>(layout, ranges);
  if (start.count == 0) {
    return result;
  }
  const bool robust = solver.config().loss.kind != RangeLossKind::kNone;
  const Vector<N> near =
      robust || start.count > 1 ? Vector<N>(result.position - layout.centre) : start.position[0];
  const RangeFit<N> fit = fit_ranges_ceres<N>(layout, ranges, near, solver.config().loss);
  if (fit.converged && fit.cost <= result.cost + 1e-6 * (1.0 + result.cost)) {
    result.position = layout.centre + fit.position;
    result.cost = fit.cost;
  } else if (!fit.converged) {
    result.status = PositionStatus::kNotConverged;
  }
  return result;
}

template <int N>
RangePosition<N> solve_one(const Multilateration<N>& solver, RangeSolver method,
                           const RangeLayout<N>& layout, const double* ranges) {
  switch (method) {
    case RangeSolver::kSquaredRange:
      return by_squares<N>(layout, ranges, SquaredRangeWeights::kEqual);
    case RangeSolver::kWeightedSquaredRange:
      return by_squares<N>(layout, ranges, SquaredRangeWeights::kVariance);
    case RangeSolver::kCeres:
      return by_ceres<N>(solver, layout, ranges);
    case RangeSolver::kMaximumLikelihood:
      break;
  }
  return solver.solve_over(layout, ranges);
}

void expect_finite(const AnchorTable& table, std::size_t epoch) {
  for (int i = 0; i < table.size * table.columns; ++i) {
    if (!(std::abs(table.rows[i]) <= kLongest)) {
      throw std::invalid_argument("anchor " + std::to_string(i / table.columns) + " of epoch " +
                                  std::to_string(epoch) + " has a coordinate " +
                                  std::to_string(table.rows[i]) +
                                  ", expected finite numbers within 1e12");
    }
  }
}

internal::LaneSolver lanes() {
#ifdef LOCFUSE_LANES_AVX2
  if (internal::has_avx2()) {
    return internal::avx2::range_lanes();
  }
#endif
  return internal::portable::range_lanes();
}

template <int N>
internal::LaneLayout lane_layout(const Multilateration<N>& solver) {
  const RangeLayout<N>& layout = solver.layout();
  internal::LaneLayout view;
  view.size = layout.size;
  view.height_squared = layout.height_squared.data();
  view.information = layout.information.data();
  view.strong_below = solver.strong_below();
  for (int k = 0; k < N; ++k) {
    view.anchor[k] = layout.anchor[static_cast<std::size_t>(k)].data();
    view.stiffness[k] = 4.0 * layout.spread(k);
    for (int l = 0; l < N; ++l) {
      view.axes[k][l] = layout.axes(k, l);
    }
  }
  return view;
}

template <int N>
void write(const Multilateration<N>& solver, const internal::LaneResult& found, int lane,
           std::size_t epoch, const PositionRows& out) {
  const RangeLayout<N>& layout = solver.layout();
  out.cost[epoch] = found.cost[lane];
  out.status[epoch] = found.cost[lane] > solver.cost_limit(layout.size)
                          ? PositionStatus::kInconsistent
                          : PositionStatus::kUnique;
  double* position = out.position + epoch * N;
  double* covariance = out.covariance + epoch * N * N;
  for (int k = 0; k < N; ++k) {
    position[k] = layout.centre(k) + found.position[k][lane];
    for (int l = 0; l <= k; ++l) {
      const double entry = found.covariance[k * (k + 1) / 2 + l][lane];
      covariance[k * N + l] = entry;
      covariance[l * N + k] = entry;
    }
  }
}

template <int N>
void solve_epoch(const Multilateration<N>& solver, RangeSolver method, const double* anchors,
                 const double* ranges, std::size_t epoch, const PositionRows& out) {
  AnchorTable table = solver.table();
  const auto size = static_cast<std::size_t>(table.size);
  const Heard heard = heard_in(ranges + epoch * size, table.size);
  if (!heard.good) {
    RangePosition<N> refused;
    refused.status = PositionStatus::kBadRange;
    write<N>(refused, epoch, out);
    return;
  }
  if (anchors == nullptr && heard.size == table.size) {
    write<N>(method == RangeSolver::kMaximumLikelihood
                 ? solver.solve(heard.range.data())
                 : solve_one<N>(solver, method, solver.layout(), heard.range.data()),
             epoch, out);
    return;
  }
  if (anchors != nullptr) {
    table.rows = anchors + epoch * size * static_cast<std::size_t>(table.columns);
    expect_finite(table, epoch);
  }
  const RangeLayout<N> layout(table, solver.sigma(), heard.row.data(), heard.size);
  write<N>(solve_one<N>(solver, method, layout, heard.range.data()), epoch, out);
}

/// Epochs by the group, as far as the lanes can do them. Returns how many are done.
template <int N>
std::size_t solve_groups(const Multilateration<N>& solver, const double* ranges, std::size_t epochs,
                         const PositionRows& out) {
  const internal::LaneSolver by_lanes = lanes();
  const internal::LaneLayout view = lane_layout<N>(solver);
  const auto size = static_cast<std::size_t>(view.size);
  const auto width = static_cast<std::size_t>(by_lanes.lanes);
  internal::LaneResult found = {};
  std::size_t epoch = 0;
  for (; epoch + width <= epochs; epoch += width) {
    (N == 2 ? by_lanes.solve2 : by_lanes.solve3)(view, ranges + epoch * size, found);
    for (int lane = 0; lane < by_lanes.lanes; ++lane) {
      const std::size_t each = epoch + static_cast<std::size_t>(lane);
      if (found.solved[lane]) {
        write<N>(solver, found, lane, each, out);
      } else {
        solve_epoch<N>(solver, RangeSolver::kMaximumLikelihood, nullptr, ranges, each, out);
      }
    }
  }
  return epoch;
}

}  // namespace

template <int N>
void locate_batch(const Multilateration<N>& solver, RangeSolver method, const double* anchors,
                  const double* ranges, std::size_t epochs, const PositionRows& out) {
  const bool by_groups = anchors == nullptr && method == RangeSolver::kMaximumLikelihood &&
                         solver.config().loss.kind == RangeLossKind::kNone &&
                         solver.strong_below() > 0.0;
  std::size_t epoch = by_groups ? solve_groups<N>(solver, ranges, epochs, out) : 0;
  for (; epoch < epochs; ++epoch) {
    solve_epoch<N>(solver, method, anchors, ranges, epoch, out);
  }
}

#define LOCFUSE_INSTANTIATE(N)                                                         \
  template void locate_batch<N>(const Multilateration<N>&, RangeSolver, const double*, \
                                const double*, std::size_t, const PositionRows&);
LOCFUSE_INSTANTIATE(2)
LOCFUSE_INSTANTIATE(3)
#undef LOCFUSE_INSTANTIATE

}  // namespace locfuse
