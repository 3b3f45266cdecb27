// SPDX-License-Identifier: Apache-2.0
// Heading search, registration, global initialization and scan odometry in the hall of
// scan_room.hpp, compared to PCL.
#include <benchmark/benchmark.h>

#include "icp_peer.hpp"
#include "locfuse/frontends/scan_odometry.hpp"
#include "scan_room.hpp"

namespace {

using locfuse::Pose2;
using locfuse::ScanMatch;
using locfuse::ScanMatcher;
using locfuse::testing::ScanRoom;

const ScanRoom& room() {
  static const ScanRoom made = locfuse::testing::scan_room();
  return made;
}

/// Success rate and error of the results.
class Errors {
 public:
  void add(const Pose2& pose, const Pose2& truth) {
    const locfuse::Vector<3> e = locfuse::local(pose, truth);
    const double off = e.head<2>().norm();
    right_ += static_cast<int>(off < 0.05 && std::abs(e.z()) < locfuse::kPi / 180.0);
    squares_ += off * off;
    ++count_;
  }
  void report(benchmark::State& state) const {
    state.counters["within_5cm_1deg"] = static_cast<double>(right_) / count_;
    state.counters["rmse_m"] = std::sqrt(squares_ / count_);
  }

 private:
  int right_ = 0;
  int count_ = 0;
  double squares_ = 0.0;
};

void prepare(benchmark::State& state) {
  for (auto _ : state) {
    const ScanMatcher matcher(room().map);
    benchmark::DoNotOptimize(&matcher);
  }
}

template <class Search>
void heading(benchmark::State& state, const Search& search) {
  const ScanMatcher matcher(room().map);
  std::size_t k = 0;
  int right = 0;
  int count = 0;
  for (auto _ : state) {
    const locfuse::HeadingSearch found =
        search(matcher.map(), room().scans[k], room().guess[k].position());
    right += static_cast<int>(
        std::abs(locfuse::angle_difference(*found.heading, room().truth[k].heading)) < 0.0875);
    ++count;
    k = (k + 1) % room().scans.size();
  }
  state.counters["within_5deg"] = static_cast<double>(right) / count;
}

void refine(benchmark::State& state, bool exact) {
  locfuse::ScanMatcherConfig config;
  config.sigma_range_m = 0.02;
  config.exact_neighbours = exact;
  const ScanMatcher matcher(room().map, config);
  std::size_t k = 0;
  Errors errors;
  double iterations = 0.0;
  for (auto _ : state) {
    const ScanMatch match = matcher.refine(room().scans[k], room().guess[k]);
    errors.add(match.pose, room().truth[k]);
    iterations += match.iterations;
    k = (k + 1) % room().scans.size();
  }
  errors.report(state);
  state.counters["iterations"] = iterations / static_cast<double>(state.iterations());
}

void power_up(benchmark::State& state) {
  locfuse::ScanMatcherConfig config;
  config.sigma_range_m = 0.02;
  const ScanMatcher matcher(room().map, config);
  const locfuse::Matrix<2, 2> covariance = 0.0225 * locfuse::Matrix<2, 2>::Identity();
  std::size_t k = 0;
  Errors errors;
  for (auto _ : state) {
    const locfuse::ScanSearch found =
        matcher.search(room().scans[k], room().guess[k].position(), covariance);
    errors.add(found.hypotheses.at(0).match.pose, room().truth[k]);
    k = (k + 1) % room().scans.size();
  }
  errors.report(state);
}

locfuse::LocalMapConfig noise_of_room() {
  locfuse::LocalMapConfig config;
  config.sigma_range_m = 0.02;
  return config;
}

/// Matches each scan to the previous one, 20 cm back.
void scan_to_scan(benchmark::State& state) {
  std::vector<locfuse::LocalMap> maps;
  for (std::size_t k = 0; k < room().scans.size(); ++k) {
    const locfuse::PlacedScan placed{room().scans[k], room().truth[k]};
    maps.emplace_back(std::vector{placed}, noise_of_room());
  }
  std::size_t k = 1;
  Errors errors;
  for (auto _ : state) {
    const ScanMatch match = maps[k - 1].match(room().scans[k], room().guess[k]);
    errors.add(match.pose, room().truth[k]);
    k = k + 1 < room().scans.size() ? k + 1 : 1;
  }
  errors.report(state);
}

/// A drive, key scans included.
void scan_odometry(benchmark::State& state) {
  locfuse::ScanOdometryConfig config;
  config.map = noise_of_room();
  const locfuse::Matrix<3, 3> covariance = 1e-4 * locfuse::Matrix<3, 3>::Identity();
  std::vector<Pose2> increments;
  for (std::size_t k = 0; k + 1 < room().scans.size(); ++k) {
    const Pose2 motion = inverse(room().truth[k]) * room().truth[k + 1];
    increments.push_back(retract(motion, {0.01, -0.01, 0.01}));
  }
  std::vector<locfuse::LaserScan> scans = room().scans;
  for (std::size_t k = 0; k < scans.size(); ++k) {
    scans[k].stamp = static_cast<locfuse::Stamp>(k);
  }
  for (auto _ : state) {
    locfuse::ScanOdometry odometry(config);
    for (std::size_t k = 0; k < scans.size(); ++k) {
      const locfuse::ScanMotion now =
          odometry.on(scans[k], k > 0 ? increments[k - 1] : Pose2{}, covariance);
      benchmark::DoNotOptimize(&now);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(scans.size()));
}

BENCHMARK(prepare)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(heading, pcl_kdtree, locfuse::heading_search)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(heading, lookup, locfuse::heading_search_by_lookup)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(refine, lookup, false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(refine, exact, true)->Unit(benchmark::kMicrosecond);
BENCHMARK(scan_to_scan)->Unit(benchmark::kMicrosecond);
BENCHMARK(scan_odometry)->Unit(benchmark::kMicrosecond);
BENCHMARK(power_up)->Unit(benchmark::kMillisecond);

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  register_icp_peer();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
