// SPDX-License-Identifier: Apache-2.0
// Range-only positioning: locfuse compared to Ceres with automatic derivatives and
// ceres::TinySolver, both started from the centre of the box.
#include <benchmark/benchmark.h>
#include <ceres/autodiff_cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <ceres/tiny_solver.h>

#include <cmath>
#include <random>
#include <vector>

#include "locfuse/frontends/range_batch.hpp"

namespace {

using locfuse::Multilateration;
using locfuse::Vector;

constexpr int kTrials = 10'000;
constexpr double kSigma = 0.1;

/// Ranges from uniform points of a box of 10 m to anchors on its edge.
template <int N>
struct Input {
  int size = 0;
  std::vector<double> anchors, points, ranges;
  std::vector<double> sigma;

  [[nodiscard]] locfuse::AnchorTable table() const {
    return {locfuse::RowsView(anchors.data(), size, N), {}};
  }
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> sigmas() const { return {sigma.data(), size}; }
};

template <int N>
Input<N> make_input(std::vector<double> anchors) {
  Input<N> in;
  in.size = static_cast<int>(anchors.size()) / N;
  in.anchors = std::move(anchors);
  in.sigma.assign(static_cast<std::size_t>(in.size), kSigma);
  std::mt19937_64 rng(100);
  std::uniform_real_distribution<double> place(0.5, 9.5);
  std::normal_distribution<double> noise(0.0, kSigma);
  for (int trial = 0; trial < kTrials; ++trial) {
    Vector<N> x;
    for (int k = 0; k < N; ++k) {
      x(k) = place(rng);
      in.points.push_back(x(k));
    }
    for (int i = 0; i < in.size; ++i) {
      const Eigen::Map<const Vector<N>> a(in.anchors.data() + i * N);
      in.ranges.push_back(std::max(0.01, (x - a).norm() + noise(rng)));
    }
  }
  return in;
}

const Input<2>& plane() {
  static const Input<2> input = make_input<2>({0, 0, 10, 0, 10, 10, 0, 10, 5, 0});
  return input;
}

const Input<3>& space() {
  static const Input<3> input = make_input<3>(
      {0, 0, 0, 10, 0, 0, 0, 10, 0, 10, 10, 0, 0, 0, 10, 10, 0, 10, 0, 10, 10, 10, 10, 10});
  return input;
}

template <int N>
void report(benchmark::State& state, const Input<N>& in, const std::vector<double>& found,
            int solves) {
  double squared = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    squared += (found[i] - in.points[i]) * (found[i] - in.points[i]);
  }
  state.counters["rmse_m"] = std::sqrt(squared / (static_cast<double>(found.size()) / N));
  state.SetItemsProcessed(state.iterations() * solves);
}

using Numbers = Eigen::Map<const Eigen::VectorXd>;

/// One solve per call of `solve(ranges, x)`.
template <int N, class Solve>
void one_by_one(benchmark::State& state, const Input<N>& in, int trials, const Solve& solve) {
  std::vector<double> found(static_cast<std::size_t>(trials * N));
  for (auto _ : state) {
    for (int trial = 0; trial < trials; ++trial) {
      solve(in.ranges.data() + trial * in.size, found.data() + trial * N);
    }
    benchmark::DoNotOptimize(found.data());
  }
  report(state, in, found, trials);
}

template <int N>
void fast(benchmark::State& state, const Input<N>& in) {
  const Multilateration<N> solver(in.table(), in.sigmas(), {});
  one_by_one(state, in, kTrials, [&](const double* ranges, double* x) {
    Eigen::Map<Vector<N>> position(x);
    position = solver.solve(Numbers(ranges, in.size)).position;
  });
}

template <int N>
void squared_ranges(benchmark::State& state, const Input<N>& in) {
  const locfuse::RangeLayout<N> layout(in.table(), in.sigmas());
  one_by_one(state, in, kTrials, [&](const double* ranges, double* x) {
    Eigen::Map<Vector<N>> position(x);
    position = layout.centre +
               locfuse::solve_squared_ranges<N>(layout, Numbers(ranges, in.size)).position[0];
  });
}

template <int N>
void with_ceres(benchmark::State& state, const Input<N>& in, locfuse::RangeLossKind loss,
                bool warm = true) {
  const locfuse::RangeLayout<N> layout(in.table(), in.sigmas());
  one_by_one(state, in, 500, [&](const double* epoch, double* x) {
    const Numbers ranges(epoch, in.size);
    Eigen::Map<Vector<N>> position(x);
    Vector<N> start = locfuse::solve_squared_ranges<N>(layout, ranges).position[0];
    if (warm && loss != locfuse::RangeLossKind::kNone) {  // as in locate: near the minimum
      start = locfuse::fit_ranges<N>(layout, ranges, start, {loss, 0.0}).position;
    }
    position =
        layout.centre + locfuse::fit_ranges_ceres<N>(layout, ranges, start, {loss, 0.0}).position;
  });
}

template <int N>
void batch(benchmark::State& state, const Input<N>& in) {
  const Multilateration<N> solver(in.table(), in.sigmas(), {});
  std::vector<double> position(kTrials * N);
  std::vector<double> covariance(kTrials * N * N);
  std::vector<double> cost(kTrials);
  std::vector<locfuse::PositionStatus> status(kTrials);
  for (auto _ : state) {
    locfuse::locate_batch<N>(solver, locfuse::RangeSolver::kNewton, {},
                             locfuse::RowsView(in.ranges.data(), kTrials, in.size),
                             {{position.data(), kTrials, N},
                              {covariance.data(), kTrials, N * N},
                              {cost.data(), kTrials},
                              {status.data(), kTrials}});
    benchmark::DoNotOptimize(position.data());
  }
  report(state, in, position, kTrials);
}

template <int N>
struct AutoDiffRange {
  const double* anchor;
  double range;
  template <class T>
  bool operator()(const T* x, T* residual) const {
    T squared(0.0);
    for (int k = 0; k < N; ++k) {
      const T d = x[k] - anchor[k];
      squared += d * d;
    }
    residual[0] = ceres::sqrt(squared) - range;
    return true;
  }
};

template <int N>
void ceres_autodiff(benchmark::State& state, const Input<N>& in, ceres::LinearSolverType linear) {
  one_by_one(state, in, 500, [&](const double* ranges, double* x) {
    ceres::Problem problem;
    std::fill(x, x + N, 5.0);
    for (int i = 0; i < in.size; ++i) {
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<AutoDiffRange<N>, 1, N>(
                                   new AutoDiffRange<N>{in.anchors.data() + i * N, ranges[i]}),
                               nullptr, x);
    }
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.linear_solver_type = linear;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
  });
}

template <int N, int M>
struct TinyRanges {
  using Scalar = double;
  enum { NUM_RESIDUALS = M, NUM_PARAMETERS = N };
  const double* anchors;
  const double* ranges;
  bool operator()(const double* x, double* residuals, double* jacobian) const {
    for (int i = 0; i < M; ++i) {
      const Vector<N> d =
          Eigen::Map<const Vector<N>>(x) - Eigen::Map<const Vector<N>>(anchors + i * N);
      const double h = d.norm();
      residuals[i] = h - ranges[i];
      for (int k = 0; jacobian != nullptr && k < N; ++k) {
        jacobian[k * M + i] = d(k) / h;
      }
    }
    return true;
  }
};

template <int N, int M>
void tiny_solver(benchmark::State& state, const Input<N>& in) {
  one_by_one(state, in, kTrials, [&](const double* ranges, double* x) {
    const TinyRanges<N, M> function{in.anchors.data(), ranges};
    ceres::TinySolver<TinyRanges<N, M>> solver;
    Vector<N> at = Vector<N>::Constant(5.0);
    solver.Solve(function, &at);
    Eigen::Map<Vector<N>> position(x);
    position = at;
  });
}

void plane_fast(benchmark::State& state) { fast<2>(state, plane()); }
void space_fast(benchmark::State& state) { fast<3>(state, space()); }
void plane_srls(benchmark::State& state) { squared_ranges<2>(state, plane()); }
void space_srls(benchmark::State& state) { squared_ranges<3>(state, space()); }
void plane_batch(benchmark::State& state) { batch<2>(state, plane()); }
void space_batch(benchmark::State& state) { batch<3>(state, space()); }
void plane_ceres(benchmark::State& state) {
  with_ceres<2>(state, plane(), locfuse::RangeLossKind::kNone);
}
void plane_ceres_huber(benchmark::State& state) {
  with_ceres<2>(state, plane(), locfuse::RangeLossKind::kHuber);
}
void plane_ceres_cauchy(benchmark::State& state) {
  with_ceres<2>(state, plane(), locfuse::RangeLossKind::kCauchy);
}
void plane_ceres_cauchy_from_srls(benchmark::State& state) {
  with_ceres<2>(state, plane(), locfuse::RangeLossKind::kCauchy, false);
}
void plane_ceres_one_sided_from_srls(benchmark::State& state) {
  with_ceres<2>(state, plane(), locfuse::RangeLossKind::kOneSided, false);
}
void plane_ceres_one_sided(benchmark::State& state) {
  with_ceres<2>(state, plane(), locfuse::RangeLossKind::kOneSided);
}
void plane_ceres_autodiff(benchmark::State& state) {
  ceres_autodiff<2>(state, plane(), ceres::Solver::Options().linear_solver_type);
}
void plane_ceres_autodiff_qr(benchmark::State& state) {
  ceres_autodiff<2>(state, plane(), ceres::DENSE_QR);
}
void plane_tiny_solver(benchmark::State& state) { tiny_solver<2, 5>(state, plane()); }
void space_tiny_solver(benchmark::State& state) { tiny_solver<3, 8>(state, space()); }

BENCHMARK(plane_fast);
BENCHMARK(plane_srls);
BENCHMARK(plane_batch);
BENCHMARK(plane_ceres);
BENCHMARK(plane_ceres_huber);
BENCHMARK(plane_ceres_cauchy);
BENCHMARK(plane_ceres_one_sided);
BENCHMARK(plane_ceres_cauchy_from_srls);
BENCHMARK(plane_ceres_one_sided_from_srls);
BENCHMARK(plane_ceres_autodiff);
BENCHMARK(plane_ceres_autodiff_qr);
BENCHMARK(plane_tiny_solver);
BENCHMARK(space_fast);
BENCHMARK(space_srls);
BENCHMARK(space_batch);
BENCHMARK(space_tiny_solver);

}  // namespace

BENCHMARK_MAIN();
