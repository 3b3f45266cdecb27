// SPDX-License-Identifier: Apache-2.0
// Distance field of a large map, and ray casting in the hall of scan_room.hpp.
#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include "locfuse/maps/distance_field.hpp"
#include "locfuse/maps/ray_caster.hpp"
#include "scan_room.hpp"

namespace {

using locfuse::Cell;
using locfuse::OccupancyGrid;
using locfuse::testing::ScanRoom;

/// 500 x 350 m of halls side by side in 10,000 x 7,000 cells.
std::shared_ptr<const OccupancyGrid> many_halls() {
  constexpr int kWidth = 10'000;
  constexpr int kHeight = 7'000;
  constexpr int kHall = ScanRoom::kCells;
  locfuse::testing::Rng rng(3);
  const std::vector<Cell> hall = locfuse::testing::scan_room_cells(rng);
  std::vector<Cell> cells;
  cells.reserve(std::size_t{kWidth} * kHeight);
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      cells.push_back(hall[static_cast<std::size_t>(row % kHall * kHall + column % kHall)]);
    }
  }
  return std::make_shared<const OccupancyGrid>(kWidth, kHeight, 0.05, locfuse::Pose2{},
                                               std::move(cells));
}

/// Peak resident memory of this process [MB], including the grid.
double peak_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024e-6;
}

void distance_field(benchmark::State& state) {
  const std::shared_ptr<const OccupancyGrid> grid = many_halls();
  for (auto _ : state) {
    const locfuse::DistanceField field(grid);
    benchmark::DoNotOptimize(&field);
  }
  state.counters["peak_mb"] = peak_mb();
}

void ray_scan(benchmark::State& state) {
  static const ScanRoom room = locfuse::testing::scan_room();
  const locfuse::RayCaster caster(room.map);
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        caster.scan(room.truth[k], -locfuse::kPi, 2.0 * locfuse::kPi / 360.0, 360, 20.0));
    k = (k + 1) % room.truth.size();
  }
}

BENCHMARK(distance_field)->Unit(benchmark::kMillisecond);
BENCHMARK(ray_scan)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
