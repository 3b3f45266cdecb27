// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/range_batch.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "frontends/range_lanes.hpp"
#include "math/processor.hpp"

namespace locfuse {

namespace {

/// The ranges of one epoch that were received, and their anchors.
struct Received {
  RangeIndices row;
  Ranges range;
  bool are_lengths = true;
};

Received received_in(const RowsView& ranges, Eigen::Index epoch) {
  Received received;
  received.row.resize(ranges.cols());
  received.range.resize(ranges.cols());
  int count = 0;
  for (int i = 0; i < ranges.cols(); ++i) {
    const double range = ranges(epoch, i);
    if (std::isnan(range)) {
      continue;
    }
    received.are_lengths = received.are_lengths && is_length(range);
    received.row(count) = i;
    received.range(count++) = range;
  }
  received.row.conservativeResize(count);
  received.range.conservativeResize(count);
  return received;
}

template <int N>
void write(const RangePosition<N>& found, Eigen::Index epoch, PositionRows<N>& out) {
  out.status(epoch) = found.status;
  const double missing = std::numeric_limits<double>::quiet_NaN();
  const bool has = found.has_position;
  out.cost(epoch) = has ? found.cost : missing;
  for (int k = 0; k < N; ++k) {
    out.position(epoch, k) = has ? found.position(k) : missing;
  }
  for (int k = 0; k < N * N; ++k) {
    out.covariance(epoch, k) = has ? found.covariance(k / N, k % N) : missing;
  }
}

template <int N>
RangePosition<N> solve_one(const Multilateration<N>& solver, RangeSolver method,
                           const RangeLayout<N>& layout, const RangesView& ranges) {
  switch (method) {
    case RangeSolver::kSquaredRange:
      return solve_by_squares<N>(layout, ranges, SquaredRangeWeights::kEqual);
    case RangeSolver::kWeightedSquaredRange:
      return solve_by_squares<N>(layout, ranges, SquaredRangeWeights::kVariance);
    case RangeSolver::kCeres:
      return solver.solve_over(layout, ranges, RangeMl::kCeres);
    case RangeSolver::kNewton:
      break;
  }
  return solver.solve_over(layout, ranges);
}

void expect_finite(const AnchorTable& table, Eigen::Index epoch) {
  for (int i = 0; i < table.size(); ++i) {
    for (int k = 0; k < table.columns(); ++k) {
      if (!(std::abs(table.rows(i, k)) <= kMaxLength)) {
        throw std::invalid_argument("anchor " + std::to_string(i) + " of epoch " +
                                    std::to_string(epoch) + " has a coordinate " +
                                    std::to_string(table.rows(i, k)) +
                                    ", expected finite numbers within 1e12");
      }
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
           Eigen::Index epoch, PositionRows<N>& out) {
  const RangeLayout<N>& layout = solver.layout();
  out.cost(epoch) = found.cost[lane];
  out.status(epoch) = found.cost[lane] > solver.cost_limit(layout.size)
                          ? PositionStatus::kInconsistent
                          : PositionStatus::kUnique;
  for (int k = 0; k < N; ++k) {
    out.position(epoch, k) = layout.centre(k) + found.position[k][lane];
    for (int l = 0; l <= k; ++l) {
      const double entry = found.covariance[k * (k + 1) / 2 + l][lane];
      out.covariance(epoch, k * N + l) = entry;
      out.covariance(epoch, l * N + k) = entry;
    }
  }
}

/// Anchors of an epoch that has its own.
template <int N>
AnchorTable own_table(const Multilateration<N>& solver, const RowsView& anchors,
                      Eigen::Index epoch) {
  const AnchorTable common = solver.table();
  AnchorTable own{RowsView(anchors.data() + epoch * common.size() * anchors.cols(), common.size(),
                           anchors.cols()),
                  common.height};
  expect_finite(own, epoch);
  return own;
}

template <int N>
void solve_epoch(const Multilateration<N>& solver, RangeSolver method,
                 const std::optional<RowsView>& anchors, const RowsView& ranges, Eigen::Index epoch,
                 PositionRows<N>& out) {
  const Received received = received_in(ranges, epoch);
  if (!received.are_lengths) {
    RangePosition<N> refused;
    refused.status = PositionStatus::kBadRange;
    write<N>(refused, epoch, out);
    return;
  }
  if (!anchors && received.range.size() == ranges.cols()) {
    write<N>(method == RangeSolver::kNewton
                 ? solver.solve(received.range)
                 : solve_one<N>(solver, method, solver.layout(), received.range),
             epoch, out);
    return;
  }
  const AnchorTable table = anchors ? own_table(solver, *anchors, epoch) : solver.table();
  const RangeLayout<N> layout(table, solver.sigma(), received.row);
  write<N>(solve_one<N>(solver, method, layout, received.range), epoch, out);
}

/// Solves whole groups of epochs in lanes. Returns the number of epochs done.
template <int N>
Eigen::Index solve_groups(const Multilateration<N>& solver, const RowsView& ranges,
                          PositionRows<N>& out) {
  const internal::LaneSolver by_lanes = lanes();
  const internal::LaneLayout view = lane_layout<N>(solver);
  const Eigen::Index width = by_lanes.lanes;
  internal::LaneResult found = {};
  Eigen::Index epoch = 0;
  for (; epoch + width <= ranges.rows(); epoch += width) {
    (N == 2 ? by_lanes.solve2 : by_lanes.solve3)(view, ranges.data() + epoch * view.size, found);
    for (int lane = 0; lane < by_lanes.lanes; ++lane) {
      const Eigen::Index each = epoch + lane;
      if (found.solved[lane]) {
        write<N>(solver, found, lane, each, out);
      } else {
        solve_epoch<N>(solver, RangeSolver::kNewton, {}, ranges, each, out);
      }
    }
  }
  return epoch;
}

template <int N>
void check_shapes(const Multilateration<N>& solver, const std::optional<RowsView>& anchors,
                  const RowsView& ranges, const PositionRows<N>& out) {
  const AnchorTable common = solver.table();
  const Eigen::Index epochs = ranges.rows();
  if (ranges.cols() != common.size()) {
    throw std::invalid_argument("ranges have " + std::to_string(ranges.cols()) +
                                " columns, expected " + std::to_string(common.size()) +
                                ", one per anchor");
  }
  if (anchors &&
      (anchors->rows() != epochs * common.size() || anchors->cols() != common.columns())) {
    throw std::invalid_argument("anchors of the epochs are " + std::to_string(anchors->rows()) +
                                " x " + std::to_string(anchors->cols()) + " numbers, expected " +
                                std::to_string(epochs * common.size()) + " x " +
                                std::to_string(common.columns()));
  }
  if (out.position.rows() != epochs || out.covariance.rows() != epochs ||
      out.cost.size() != epochs || out.status.size() != epochs) {
    throw std::invalid_argument("the output has not one row for each of " + std::to_string(epochs) +
                                " epochs");
  }
}

}  // namespace

template <int N>
void locate_batch(const Multilateration<N>& solver, RangeSolver method,
                  const std::optional<RowsView>& anchors, const RowsView& ranges,
                  PositionRows<N> out) {
  check_shapes<N>(solver, anchors, ranges, out);
  const bool by_groups = !anchors && method == RangeSolver::kNewton &&
                         solver.config().loss.kind == RangeLossKind::kNone &&
                         solver.strong_below() > 0.0;
  Eigen::Index epoch = by_groups ? solve_groups<N>(solver, ranges, out) : 0;
  for (; epoch < ranges.rows(); ++epoch) {
    solve_epoch<N>(solver, method, anchors, ranges, epoch, out);
  }
}

#define LOCFUSE_INSTANTIATE(N)                                          \
  template void locate_batch<N>(const Multilateration<N>&, RangeSolver, \
                                const std::optional<RowsView>&, const RowsView&, PositionRows<N>);
LOCFUSE_INSTANTIATE(2)
LOCFUSE_INSTANTIATE(3)
#undef LOCFUSE_INSTANTIATE

}  // namespace locfuse
