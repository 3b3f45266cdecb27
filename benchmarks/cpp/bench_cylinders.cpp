// SPDX-License-Identifier: Apache-2.0
// Cylinder detection in the world of wells with and without walls, 360 beams with 1 cm of noise.
#include <benchmark/benchmark.h>

#include "locfuse/frontends/cylinder_detector.hpp"
#include "support/discs.hpp"

namespace {

using locfuse::CylinderDetector;
using locfuse::CylinderDetectorConfig;
using locfuse::LaserScan;
using locfuse::Pose2;
using locfuse::testing::Walls;

/// Scans from a circle of 0.8 m in the middle, where all four cylinders are visible.
std::vector<LaserScan> scans_of_wells(bool walled) {
  locfuse::testing::Rng rng(3);
  Walls walls;
  if (walled) {
    locfuse::testing::add_box(walls, {}, 9.0, 8.0);
  }
  std::vector<LaserScan> scans;
  for (int k = 0; k < 50; ++k) {
    const double turned = 2.0 * locfuse::kPi * k / 50;
    const Pose2 eye{0.8 * std::cos(turned), 0.8 * std::sin(turned), locfuse::wrap_angle(turned)};
    scans.push_back(locfuse::testing::scan_of(locfuse::testing::cylinders_of_wells(), walls, eye,
                                              rng, 0.01, locfuse::testing::turning_laser()));
  }
  return scans;
}

void detect(benchmark::State& state, double radius, bool walled) {
  const std::vector<LaserScan> scans = scans_of_wells(walled);
  CylinderDetectorConfig config;
  config.radius_m = radius;
  const CylinderDetector detector(config);
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(detector.detect(scans[k]));
    k = (k + 1) % scans.size();
  }
}

BENCHMARK_CAPTURE(detect, radius_known, 1.0, false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(detect, radius_free, 0.0, false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(detect, radius_known_walls, 1.0, true)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(detect, radius_free_walls, 0.0, true)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
