// SPDX-License-Identifier: Apache-2.0
// One prediction and five ranges on three states, per step: a hand-written Joseph-form reference,
// our models and filter functions, the whole PoseEkf with checks, gates and outcomes, the same with
// health, the same with an offset of each anchor as a state, Orocos BFL.
#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <memory>

#include "circle.hpp"
#include "locfuse/locfuse.hpp"
#include "support/allocation_counter.hpp"
#ifdef LOCFUSE_WITH_BFL
#include "bfl_peer.hpp"
#endif

namespace {

using locfuse::Linearization;
using locfuse::Pose2;
using locfuse::PoseEkf;
using locfuse::testing::allocations;

const Circle& input() {
  static const Circle circle;
  return circle;
}

// Every run writes the estimates and returns the number of heap allocations of its steps.

/// Fixed-size Eigen, specialized for this problem: no checks, no gate, no outcome.
std::size_t run_reference(const Circle& in, std::vector<double>& out) {
  Eigen::Vector3d x(in.start[0], in.start[1], in.start[2]);
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d Q = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i) {
    P(i, i) = Circle::kSigmaStart[i] * Circle::kSigmaStart[i];
    Q(i, i) = Circle::kSigmaMotion[i] * Circle::kSigmaMotion[i];
  }
  const double R = Circle::kSigmaRange * Circle::kSigmaRange;
  Eigen::Matrix3d F = I;
  Eigen::Matrix3d G = I;
  const std::size_t before = allocations();
  for (std::size_t k = 0; k < Circle::kSteps; ++k) {
    const double c = std::cos(x(2));
    const double s = std::sin(x(2));
    const double ux = in.u[3 * k];
    const double uy = in.u[3 * k + 1];
    F(0, 2) = -s * ux - c * uy;
    F(1, 2) = c * ux - s * uy;
    G(0, 0) = c;
    G(0, 1) = -s;
    G(1, 0) = s;
    G(1, 1) = c;
    x += Eigen::Vector3d(c * ux - s * uy, s * ux + c * uy, in.u[3 * k + 2]);
    P = (F * P * F.transpose() + G * Q * G.transpose()).eval();
    for (std::size_t i = 0; i < Circle::kAnchors; ++i) {
      const double dx = x(0) - Circle::kAnchorXY[i][0];
      const double dy = x(1) - Circle::kAnchorXY[i][1];
      const double r = std::sqrt(dx * dx + dy * dy);
      const Eigen::Vector3d H(dx / r, dy / r, 0.0);
      const Eigen::Vector3d PH = P * H;
      const Eigen::Vector3d K = PH / (H.dot(PH) + R);
      x += K * (in.z[5 * k + i] - r);
      const Eigen::Matrix3d A = I - K * H.transpose();
      P = (A * P * A.transpose() + K * R * K.transpose()).eval();
    }
    x(2) = std::remainder(x(2), 2.0 * locfuse::kPi);
    out[3 * k] = x(0);
    out[3 * k + 1] = x(1);
    out[3 * k + 2] = x(2);
  }
  return allocations() - before;
}

std::shared_ptr<const locfuse::AnchorMap> anchor_map() {
  std::vector<locfuse::Anchor> anchors;
  for (locfuse::Id i = 0; i < Circle::kAnchors; ++i) {
    anchors.push_back({i, {Circle::kAnchorXY[i][0], Circle::kAnchorXY[i][1], 0.0}});
  }
  return std::make_shared<const locfuse::AnchorMap>(anchors);
}

locfuse::PoseEstimate start_estimate(const Circle& in) {
  const auto sigma = Eigen::Map<const Eigen::Vector3d>(Circle::kSigmaStart);
  return {0, {in.start[0], in.start[1], in.start[2]}, sigma.cwiseAbs2().asDiagonal()};
}

// The input's noise is the same for every 5 cm step: as a random walk over distance,
// sigma^2 = per_sqrt_m^2 * 0.05 m on average.
locfuse::OdometryMotion::Config motion_config() {
  locfuse::OdometryMotion::Config config;
  const double root = std::sqrt(0.05);
  config.sigma_longitudinal_per_sqrt_m = Circle::kSigmaMotion[0] / root;
  config.sigma_lateral_per_sqrt_m = Circle::kSigmaMotion[1] / root;
  config.sigma_heading_per_sqrt_m = Circle::kSigmaMotion[2] / root;
  config.sigma_heading_per_sqrt_rad = 0.0;
  return config;
}

/// The parts: models and filter functions, called as an estimator calls them.
std::size_t run_functions(const Circle& in, std::vector<double>& out) {
  const locfuse::OdometryMotion motion(motion_config());
  const locfuse::RangeModel model({Circle::kSigmaRange, 0.0}, anchor_map(), {{0, {0, 0, 0}}});
  const locfuse::PoseEstimate start = start_estimate(in);
  auto belief = locfuse::GaussianBelief::of_pose(0, start.pose, start.covariance);
  const locfuse::Slot body = belief.slot("body");
  const locfuse::Gate gate;
  const std::size_t before = allocations();
  for (std::size_t k = 0; k < Circle::kSteps; ++k) {
    const Pose2 step{in.u[3 * k], in.u[3 * k + 1], in.u[3 * k + 2]};
    locfuse::predict(belief, motion.propagate(belief.pose(body), step, 0.0), body);
    for (int i = 0; i < Circle::kAnchors; ++i) {
      const locfuse::Range z{0, 0, i, in.z[5 * k + static_cast<std::size_t>(i)], {}};
      locfuse::update(belief, *model.linearize(belief.pose(body), z), body, gate);
    }
    for (int i = 0; i < 3; ++i) {
      out[3 * k + static_cast<std::size_t>(i)] = belief.x(i);
    }
  }
  return allocations() - before;
}

PoseEkf::Config ekf_config() {
  PoseEkf::Config config;
  config.odometry = motion_config();
  config.range = {Circle::kSigmaRange, 0.0};
  config.correlation_s = 0.0;
  return config;
}

template <class Ekf>
std::size_t run_messages(const Circle& in, Ekf& ekf, const PoseEkf& started,
                         std::vector<double>& out) {
  const std::size_t before = allocations();
  for (std::size_t k = 0; k < Circle::kSteps; ++k) {
    const auto begin = static_cast<locfuse::Stamp>(k) * 100'000'000;
    const locfuse::Stamp end = begin + 100'000'000;
    ekf.on(locfuse::Increment{begin, end, {in.u[3 * k], in.u[3 * k + 1], in.u[3 * k + 2]}});
    for (int i = 0; i < Circle::kAnchors; ++i) {
      benchmark::DoNotOptimize(
          ekf.on(locfuse::Range{end, 0, i, in.z[5 * k + static_cast<std::size_t>(i)], {}}));
    }
    for (int i = 0; i < 3; ++i) {
      out[3 * k + static_cast<std::size_t>(i)] = started.belief().x(i);
    }
  }
  return allocations() - before;
}

/// The public call: checks, time, anchor look-up, gate, outcome; the belief is restored if gated.
std::size_t run_pose_ekf(const Circle& in, std::vector<double>& out) {
  static const PoseEkf fresh(ekf_config(), {anchor_map(), {{0, {0, 0, 0}}}}, start_estimate(in));
  PoseEkf ekf = fresh;
  return run_messages(in, ekf, ekf, out);
}

/// The same with errors of each anchor that are correlated.
std::size_t run_correlated(const Circle& in, std::vector<double>& out) {
  static const PoseEkf fresh = [&] {
    PoseEkf::Config config = ekf_config();
    config.correlation_s = PoseEkf::Config{}.correlation_s;
    return PoseEkf(config, {anchor_map(), {{0, {0, 0, 0}}}}, start_estimate(in));
  }();
  PoseEkf ekf = fresh;
  return run_messages(in, ekf, ekf, out);
}

/// The same with eight states: an offset per anchor, constant or a random walk.
std::size_t run_with_offsets(double correlation_s, const Circle& in, std::vector<double>& out) {
  PoseEkf::Config config = ekf_config();
  config.calibration.sigma_anchor_offset_m = 0.05;
  config.calibration.anchor_offset_correlation_s = correlation_s;
  PoseEkf ekf(config, {anchor_map(), {{0, {0, 0, 0}}}}, start_estimate(in));
  return run_messages(in, ekf, ekf, out);
}

std::size_t run_offsets(const Circle& in, std::vector<double>& out) {
  return run_with_offsets(0.0, in, out);
}

std::size_t run_wandering(const Circle& in, std::vector<double>& out) {
  return run_with_offsets(5.0, in, out);
}

/// The same with health monitoring.
std::size_t run_recovering_ekf(const Circle& in, std::vector<double>& out) {
  static const locfuse::RecoveringEkf fresh = [&in] {
    locfuse::RecoveringEkf::Config config;
    config.start.estimator = ekf_config();
    locfuse::RecoveringEkf ekf(config, {anchor_map(), {{0, {0, 0, 0}}}});
    ekf.start_at(start_estimate(in));
    return ekf;
  }();
  locfuse::RecoveringEkf ekf = fresh;
  return run_messages(in, ekf, *ekf.estimator(), out);
}

template <class Run>
void bench(benchmark::State& state, const Run& run) {
  const Circle& in = input();
  std::vector<double> out(3 * Circle::kSteps);
  std::size_t allocated = 0;
  for (auto _ : state) {
    allocated = run(in, out);
    benchmark::DoNotOptimize(out.data());
  }
  state.SetItemsProcessed(state.iterations() * Circle::kSteps);
  state.counters["rmse_m"] = in.rmse(out);
  if (allocations() > 0) {  // never in the program that measures times
    state.counters["allocations_per_message"] =
        static_cast<double>(allocated) / (Circle::kSteps * (1 + Circle::kAnchors));
  }
  state.counters["us_per_step"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * Circle::kSteps * 1e-6,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

BENCHMARK_CAPTURE(bench, reference_joseph, run_reference);
BENCHMARK_CAPTURE(bench, models_and_filter, run_functions);
BENCHMARK_CAPTURE(bench, pose_ekf_on, run_pose_ekf);
BENCHMARK_CAPTURE(bench, correlated_on, run_correlated);
BENCHMARK_CAPTURE(bench, recovering_ekf_on, run_recovering_ekf);
BENCHMARK_CAPTURE(bench, offsets_on, run_offsets);
BENCHMARK_CAPTURE(bench, wandering_on, run_wandering);
#ifdef LOCFUSE_WITH_BFL
BENCHMARK_CAPTURE(bench, orocos_bfl, run_bfl);
#endif

}  // namespace

int main(int argc, char** argv) {
  benchmark::AddCustomContext("compiler", LOCFUSE_COMPILER);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) {
    return 1;
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
