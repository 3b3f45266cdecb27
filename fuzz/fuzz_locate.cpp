// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>

#include "checks.hpp"
#include "codec.hpp"
#include "locfuse/frontends/locate.hpp"
#include "locfuse/frontends/range_batch.hpp"

namespace {

using namespace locfuse;

/// Checks that an epoch of a batch, solved in SIMD lanes, equals the same epoch solved alone.
template <int N>
void require_equal_to_single(const RangePosition<N>& alone, PositionStatus status,
                             const Vector<N>& position) {
  fuzz::require(status == alone.status,
                "an epoch of a batch has the status of the single solution");
  if (status == PositionStatus::kUnique) {
    const Vector<N> d = position - alone.position;
    fuzz::require(d.dot(alone.covariance.llt().solve(d)) < 1e-4,
                  "an epoch of a batch equals the single solution to a hundredth of its sigma");
  }
}

/// Solves the first epoch alone, then all epochs as a batch.
template <int N>
void solve(const fuzz::Reader& io, const AnchorTable& table, const std::vector<double>& ranges,
           std::size_t epochs, const RangesView& sigma, const RangeLoss& loss) {
  const auto epoch_ranges = [&](std::size_t i) {
    const auto size = static_cast<std::size_t>(table.size());
    return Eigen::Map<const Eigen::VectorXd>(ranges.data() + i * size, table.size());
  };
  const Multilateration<N> solver(table, sigma, {loss, {}});
  const RangePosition<N> found = solver.solve(epoch_ranges(0));
  if (found.has_position) {
    fuzz::require(found.position.allFinite(), "a position is finite");
  }
  if (found.status == PositionStatus::kUnique) {
    fuzz::require(found.has_position, "a unique solution has a position");
    fuzz::require_covariance(io, found.covariance);
  }
  for (const RangeSolver method :
       {RangeSolver::kSquaredRange, RangeSolver::kWeightedSquaredRange, RangeSolver::kNewton}) {
    std::vector<Vector<N>> position(epochs);
    std::vector<Matrix<N, N>> covariance(epochs);
    std::vector<double> cost(epochs);
    std::vector<PositionStatus> status(epochs);
    const auto count = static_cast<Eigen::Index>(epochs);
    locate_batch<N>(solver, method, {}, RowsView(ranges.data(), count, table.size()),
                    {{position.front().data(), count, N},
                     {covariance.front().data(), count, N * N},
                     {cost.data(), count},
                     {status.data(), count}});
    for (std::size_t i = 0; i < epochs; ++i) {
      if (status[i] == PositionStatus::kUnique) {
        fuzz::require(position[i].allFinite(), "a position of a batch is finite");
        if (method == RangeSolver::kNewton) {
          fuzz::require_covariance(io, covariance[i]);
        }
      }
      if (io.plausible() && method == RangeSolver::kNewton &&
          status[i] != PositionStatus::kBadRange) {
        require_equal_to_single<N>(solver.solve(epoch_ranges(i)), status[i], position[i]);
      }
    }
  }
}

}  // namespace

/// Multilateration from arbitrary ranges and anchors, in the plane, in space and at a known height.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Reader io(data, size);
  std::uint8_t way = 0;
  code(io, way, 3);
  std::uint8_t anchors = 0;
  code(io, anchors, 12);
  const int columns = way == 0 ? 2 : 3;
  std::vector<double> rows(static_cast<std::size_t>(anchors * columns));
  std::vector<double> ranges(anchors);
  std::vector<double> sigma(anchors);
  for (double& coordinate : rows) {
    code(io, coordinate, -20.0, 20.0);
  }
  for (double& range : ranges) {
    code(io, range, 0.0, 40.0);
  }
  for (double& s : sigma) {
    code(io, s, 1e-3, 2.0);
  }
  AnchorTable table{RowsView(rows.data(), anchors, columns), {}};
  const Eigen::Map<const Eigen::VectorXd> sigmas(sigma.data(), anchors);
  if (way == 2) {
    table.height.emplace();
    code(io, *table.height, -5.0, 5.0);
  }
  LocateOptions options;
  std::uint8_t loss = 0;
  code(io, loss, 4);
  options.loss.kind = static_cast<RangeLossKind>(loss);
  code(io, options.loss.scale, 0.0, 5.0);
  std::uint8_t ml = 0;
  code(io, ml, 3);
  options.ml = static_cast<RangeMl>(ml);
  bool weighted = false;
  code(io, weighted);
  options.weights = weighted ? SquaredRangeWeights::kVariance : SquaredRangeWeights::kEqual;
  bool has_prior = false;
  code(io, has_prior);
  const int dimensions = table.dimensions();
  if (has_prior) {
    options.prior = {Eigen::VectorXd(dimensions), Eigen::VectorXd(dimensions)};
    options.box = {Eigen::VectorXd(dimensions), Eigen::VectorXd(dimensions)};
    for (int axis = 0; axis < dimensions; ++axis) {
      code(io, options.prior->mean(axis), -20.0, 20.0);
      code(io, options.prior->sigma(axis), 1e-3, 10.0);
      code(io, options.box->low(axis), -30.0, 0.0);
      code(io, options.box->high(axis), 0.0, 30.0);
    }
  }
  std::uint8_t more = 0;  // epochs; lanes solve four at once
  code(io, more, 10);
  ranges.resize(ranges.size() * (more + 1U));
  for (auto range = ranges.begin() + anchors; range != ranges.end(); ++range) {
    code(io, *range, 0.0, 40.0);
  }
  fuzz::returns([&] {
    const PositionSolution found =
        locate(table, Eigen::Map<const Eigen::VectorXd>(ranges.data(), anchors), sigmas, options);
    fuzz::require((found.status == PositionStatus::kUnique) == found.reason.empty(),
                  "a status other than UNIQUE has a reason");
    for (const PositionHypothesis& hypothesis : found.hypotheses) {
      fuzz::require(hypothesis.position.allFinite(), "a hypothesis is finite");
      fuzz::require(!io.plausible() || hypothesis.cost >= 0.0, "a cost is not negative");
    }
    if (found.status == PositionStatus::kUnique) {
      fuzz::require_covariance(io, found.hypotheses.front().covariance);
    }
  });
  fuzz::returns([&] {
    if (dimensions == 2) {
      solve<2>(io, table, ranges, more + 1U, sigmas, options.loss);
    } else {
      solve<3>(io, table, ranges, more + 1U, sigmas, options.loss);
    }
  });
  return 0;
}
