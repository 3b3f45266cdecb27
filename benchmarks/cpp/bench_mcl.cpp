// SPDX-License-Identifier: Apache-2.0
// A step of Monte Carlo localization (predict, weight, resample) in the hall of scan_room.hpp,
// compared to the same step written as plain loops.
#include <benchmark/benchmark.h>

#include <cmath>
#include <utility>

#include "locfuse/maps/distance_field.hpp"
#include "locfuse/particles/mcl.hpp"
#include "locfuse/replay/live_mcl.hpp"
#include "scan_room.hpp"
#include "support/rooms.hpp"

namespace {

using locfuse::Mcl;
using locfuse::Pose2;
using locfuse::testing::ScanRoom;

constexpr locfuse::Stamp kStep = 200'000'000;

const ScanRoom& room() {
  static const ScanRoom made = locfuse::testing::scan_room();
  return made;
}

/// Every particle is propagated, weighted and resampled at every scan; no recovery particles.
Mcl::Config settings(int particles, int beams, int threads) {
  Mcl::Config config;
  config.min_particles = config.max_particles = particles;
  config.beams = beams;
  config.threads = threads;
  config.resample_below = 1.0;
  config.scouts = 0;
  config.odometry = {0.05, 0.03, 0.04, 0.05, 0.0, 0.0};
  return config;
}

Mcl started(int particles, int beams, int threads, Mcl::Proposal proposal) {
  Mcl::Config config = settings(particles, beams, threads);
  config.proposal = proposal;
  Mcl mcl(config, locfuse::testing::on_map(room().map), 0);
  const locfuse::Vector<3> sigma(0.1, 0.1, 0.05);
  mcl.start_at({{{0, room().truth[0], sigma.cwiseAbs2().asDiagonal()}, 1.0}});
  return mcl;
}

/// Particles are drawn from a `proposal`.
void step(benchmark::State& state, Mcl::Proposal proposal) {
  const auto particles = static_cast<int>(state.range(0));
  const auto beams = static_cast<int>(state.range(1));
  const Mcl fresh = started(particles, beams, static_cast<int>(state.range(2)), proposal);
  Mcl mcl = fresh;
  std::size_t k = 0;
  double squares = 0.0;
  int count = 0;
  for (auto _ : state) {
    if (++k == room().scans.size()) {
      state.PauseTiming();
      mcl = fresh;
      k = 1;
      state.ResumeTiming();
    }
    const auto stamp = static_cast<locfuse::Stamp>(k) * kStep;
    const Pose2 motion = inverse(room().truth[k - 1]) * room().truth[k];
    mcl.on(locfuse::Increment{stamp - kStep, stamp, motion});
    locfuse::LaserScan scan = room().scans[k];
    scan.stamp = stamp;
    mcl.on(scan);
    const Pose2 off = inverse(room().truth[k]) * mcl.estimate().pose;
    squares += k > 10 ? off.position().squaredNorm() : 0.0;
    count += k > 10 ? 1 : 0;
  }
  state.counters["rmse_m"] = std::sqrt(squares / std::max(count, 1));
}

/// The same steps through a LiveMcl, which keeps snapshots for late messages.
void live_step(benchmark::State& state) {
  const Mcl fresh = started(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)),
                            static_cast<int>(state.range(2)), Mcl::Proposal::kOdometry);
  locfuse::LiveMcl live(fresh);
  std::size_t k = 0;
  for (auto _ : state) {
    if (++k == room().scans.size()) {
      state.PauseTiming();
      live = locfuse::LiveMcl(fresh);
      k = 1;
      state.ResumeTiming();
    }
    const auto stamp = static_cast<locfuse::Stamp>(k) * kStep;
    const Pose2 motion = inverse(room().truth[k - 1]) * room().truth[k];
    live.on(locfuse::Increment{stamp - kStep, stamp, motion});
    locfuse::LaserScan scan = room().scans[k];
    scan.stamp = stamp - 1;
    live.on(scan);
  }
}

/// A snapshot of a tracked robot, or of one that is sought everywhere.
void snapshot(benchmark::State& state) {
  const Mcl mcl = state.range(0) > 0
                      ? started(static_cast<int>(state.range(0)), 60, 1, Mcl::Proposal::kOdometry)
                      : Mcl(settings(5000, 60, 1), locfuse::testing::on_map(room().map), 0);
  for (auto _ : state) {
    Mcl copy = mcl;
    benchmark::DoNotOptimize(copy);
  }
  state.counters["particles"] = mcl.belief().size;
}

/// The same step as plain loops over floats: the cost of the method without a library.
class Plain {
 public:
  Plain(int particles, int beams) : beams_(static_cast<std::size_t>(beams)) {
    const locfuse::DistanceField field(room().map, 0.0);
    const int map = ScanRoom::kCells;
    table_.assign(static_cast<std::size_t>(kSide) * kSide, std::log(0.05F / 30.0F));
    for (int row = 0; row < map; ++row) {
      for (int column = 0; column < map; ++column) {
        const double d = field.distance(room().map->to_world({column + 0.5, row + 0.5}));
        table_[static_cast<std::size_t>((row + kRim) * kSide + column + kRim)] =
            static_cast<float>(std::log(0.95 / (0.2 * 2.5066) * std::exp(-12.5 * d * d) + 0.0017));
      }
    }
    const Pose2& start = room().truth[0];
    for (int i = 0; i < particles; ++i) {
      x_.push_back(static_cast<float>((start.x + 10.0) / 0.05) + 2.0F * normal());
      y_.push_back(static_cast<float>((start.y + 10.0) / 0.05) + 2.0F * normal());
      const float heading = static_cast<float>(start.heading) + 0.05F * normal();
      c_.push_back(std::cos(heading));
      s_.push_back(std::sin(heading));
    }
    weight_.resize(x_.size());
  }

  void on(const Pose2& motion, const locfuse::LaserScan& scan) {
    predict(motion);
    weigh(scan);
    resample();
  }

  [[nodiscard]] float x() const { return x_[0]; }

 private:
  static constexpr int kRim = 602;
  static constexpr int kSide = ScanRoom::kCells + 2 * kRim;

  float uniform() {
    state_ = state_ * 6364136223846793005U + 1442695040888963407U;
    return (static_cast<float>(state_ >> 40U) + 0.5F) * 0x1p-24F;
  }
  float normal() {
    return std::sqrt(-2.0F * std::log(uniform())) * std::cos(6.2831853F * uniform());
  }

  void predict(const Pose2& motion) {
    for (std::size_t i = 0; i < x_.size(); ++i) {
      const float forward = static_cast<float>(motion.x / 0.05) + 0.4F * normal();
      const float left = static_cast<float>(motion.y / 0.05) + 0.2F * normal();
      const float turn = static_cast<float>(motion.heading) + 0.02F * normal();
      const float c = c_[i];
      const float s = s_[i];
      x_[i] += c * forward - s * left;
      y_[i] += s * forward + c * left;
      c_[i] = c * std::cos(turn) - s * std::sin(turn);
      s_[i] = s * std::cos(turn) + c * std::sin(turn);
    }
  }

  void weigh(const locfuse::LaserScan& scan) {
    std::vector<float> px, py;
    for (std::size_t b = 0; b < beams_; ++b) {
      const std::size_t i = (2 * b + 1) * scan.ranges.size() / (2 * beams_);
      const double angle =
          scan.geometry->angle_min + static_cast<double>(i) * scan.geometry->angle_increment;
      px.push_back(static_cast<float>(scan.ranges[i] * std::cos(angle) / 0.05));
      py.push_back(static_cast<float>(scan.ranges[i] * std::sin(angle) / 0.05));
    }
    float most = -1e30F;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      float sum = 0.0F;
      for (std::size_t b = 0; b < px.size(); ++b) {
        const int column = static_cast<int>(x_[i] + c_[i] * px[b] - s_[i] * py[b]) + kRim;
        const int row = static_cast<int>(y_[i] + s_[i] * px[b] + c_[i] * py[b]) + kRim;
        sum += table_[static_cast<std::size_t>(row * kSide + column)];
      }
      weight_[i] = sum * 10.0F / static_cast<float>(px.size());
      most = std::max(most, weight_[i]);
    }
    for (float& w : weight_) {
      w = std::exp(w - most);
    }
  }

  void resample() {
    float total = 0.0F;
    for (const float w : weight_) {
      total += w;
    }
    const float pace = total / static_cast<float>(x_.size());
    float next = uniform() * pace;
    float passed = 0.0F;
    std::vector<float> x, y, c, s;
    for (std::size_t i = 0; i < x_.size(); ++i) {
      passed += weight_[i];
      for (; next < passed && x.size() < x_.size(); next += pace) {
        x.push_back(x_[i]);
        y.push_back(y_[i]);
        c.push_back(c_[i]);
        s.push_back(s_[i]);
      }
    }
    const std::size_t count = x_.size();
    x_ = std::move(x);
    y_ = std::move(y);
    c_ = std::move(c);
    s_ = std::move(s);
    for (std::vector<float>* column : {&x_, &y_, &c_, &s_}) {
      column->resize(count, column->back());
    }
  }

  std::size_t beams_;
  std::vector<float> table_;
  std::vector<float> x_, y_, c_, s_, weight_;
  std::uint64_t state_ = 1;
};

void plain(benchmark::State& state) {
  const Plain fresh(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  Plain filter = fresh;
  std::size_t k = 0;
  for (auto _ : state) {
    if (++k == room().scans.size()) {
      state.PauseTiming();
      filter = fresh;
      k = 1;
      state.ResumeTiming();
    }
    filter.on(inverse(room().truth[k - 1]) * room().truth[k], room().scans[k]);
    benchmark::DoNotOptimize(filter.x());
  }
}

BENCHMARK_CAPTURE(step, odometry, Mcl::Proposal::kOdometry)
    ->Name("mcl/step")
    ->Args({200, 60, 1})
    ->Args({2000, 60, 1})
    ->Args({20000, 180, 1})
    ->Args({20000, 180, 2})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(step, match, Mcl::Proposal::kScanMatch)
    ->Name("mcl/refined")
    ->Args({200, 60, 1})
    ->Args({2000, 60, 1})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();
BENCHMARK(live_step)
    ->Name("mcl/live")
    ->Args({200, 60, 1})
    ->Args({2000, 60, 1})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();
BENCHMARK(snapshot)->Name("mcl/snapshot")->Arg(2000)->Arg(0)->Unit(benchmark::kMicrosecond);
BENCHMARK(plain)
    ->Name("mcl/plain")
    ->Args({2000, 60})
    ->Args({20000, 180})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();

}  // namespace
