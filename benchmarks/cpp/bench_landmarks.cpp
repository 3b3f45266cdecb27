// SPDX-License-Identifier: Apache-2.0
// Landmarks as states: an update compared to the memory traffic of its covariance and to dense
// Eigen, adding landmarks one by one, joint compatibility; and a known map compared to fixed-size
// Eigen.
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "locfuse/locfuse.hpp"

namespace {

using locfuse::Gate;
using locfuse::GaussianBelief;
using locfuse::kPi;
using locfuse::LandmarkEkf;
using locfuse::Pose2;
using locfuse::PoseEkf;
using locfuse::RangeBearing;
using locfuse::RangeBearingModel;
using locfuse::Slot;
using locfuse::Stamp;
using Vector2 = Eigen::Vector2d;

constexpr int kLandmarks = 200;
constexpr int kMost = 500;

/// Points on a spiral, at least 2 m apart.
Vector2 place(int k) {
  const double radius = 3.0 + 1.2 * std::sqrt(static_cast<double>(k));
  const double angle = 2.4 * k;
  return {2.0 * radius * std::cos(angle), 2.0 * radius * std::sin(angle)};
}

RangeBearing sight(const Pose2& body, const Vector2& landmark) {
  const Vector2 d = inverse(body).act(landmark);
  RangeBearing z;
  z.range = d.norm();
  z.bearing = std::atan2(d.y(), d.x());
  return z;
}

/// Belief over a body and new landmarks, all correlated.
GaussianBelief mapped(int landmarks, std::vector<Slot>& slots) {
  const RangeBearingModel model;
  GaussianBelief belief = GaussianBelief::of_pose(0, {}, 1e-3 * Eigen::Matrix3d::Identity());
  const Slot body = belief.slot("body");
  for (int k = 0; k < landmarks; ++k) {
    const RangeBearing z = sight({}, place(k));
    const RangeBearingModel::Placed placed = *model.place({}, z);
    const Eigen::Matrix2d noise =
        placed.by_observation * model.noise(z) * placed.by_observation.transpose();
    slots.push_back(augment(belief, std::to_string(k), locfuse::SlotKind::kPoint2, placed.position,
                            placed.by_pose, noise, body));
  }
  return belief;
}

using Four = double __attribute__((vector_size(4 * sizeof(double))));

/// Scales numbers by a factor, four at once where the processor supports it, like the update.
#ifdef __x86_64__
__attribute__((target_clones("avx2", "default")))
#endif
void scale(double* numbers, Eigen::Index count, double factor) {
  Eigen::Index i = 0;
  for (; i + 4 <= count; i += 4) {
    Four four;
    __builtin_memcpy(&four, numbers + i, sizeof four);
    four *= factor;
    __builtin_memcpy(numbers + i, &four, sizeof four);
  }
  for (; i < count; ++i) {
    numbers[i] *= factor;
  }
}

/// Lower bound: reads and writes each entry of the same covariance once, in order.
void traffic(benchmark::State& state, int landmarks) {
  std::vector<Slot> slots;
  GaussianBelief belief = mapped(landmarks, slots);
  double factor = 1.0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(factor);
    for (Eigen::Index column = 0; column < belief.dimension(); ++column) {
      scale(belief.P.col(column).data(), belief.dimension(), factor);
    }
    benchmark::ClobberMemory();
  }
}
BENCHMARK_CAPTURE(traffic, of_403_states, kLandmarks);
BENCHMARK_CAPTURE(traffic, of_1003_states, kMost);

void update_one(benchmark::State& state, int landmarks) {
  const RangeBearingModel model;
  std::vector<Slot> slots;
  GaussianBelief belief = mapped(landmarks, slots);
  const Slot body = belief.slot("body");
  const Gate gate(0.999);
  std::size_t k = 0;
  for (auto _ : state) {
    k = (k + 7) % slots.size();
    const auto lin = *model.linearize_with_landmark(belief.pose(body), belief.mean(slots[k]),
                                                    sight({}, place(static_cast<int>(k))));
    benchmark::DoNotOptimize(update(belief, lin, std::vector<Slot>{body, slots[k]}, gate).nis);
  }
}
BENCHMARK_CAPTURE(update_one, of_403_states, kLandmarks);
BENCHMARK_CAPTURE(update_one, of_1003_states, kMost);

/// Hand-written Eigen: P - K S K' over the whole matrix, no gate, no checks, no Joseph form.
void dense_eigen_of_403_states(benchmark::State& state) {
  const RangeBearingModel model;
  std::vector<Slot> slots;
  GaussianBelief belief = mapped(kLandmarks, slots);
  Eigen::VectorXd x = belief.x;
  Eigen::MatrixXd P = belief.P;
  std::size_t k = 0;
  for (auto _ : state) {
    k = (k + 7) % kLandmarks;
    const auto row = static_cast<Eigen::Index>(3 + 2 * k);
    const auto lin = *model.linearize_with_landmark({x(0), x(1), x(2)}, x.segment<2>(row),
                                                    sight({}, place(static_cast<int>(k))));
    const Eigen::Matrix<double, Eigen::Dynamic, 2> PHt =
        P.leftCols<3>() * lin.jacobian.leftCols<3>().transpose() +
        P.middleCols<2>(row) * lin.jacobian.rightCols<2>().transpose();
    const Eigen::Matrix2d S = lin.jacobian.leftCols<3>() * PHt.topRows<3>() +
                              lin.jacobian.rightCols<2>() * PHt.middleRows<2>(row) + lin.noise;
    const Eigen::Matrix<double, Eigen::Dynamic, 2> K = S.llt().solve(PHt.transpose()).transpose();
    x += K * lin.residual;
    P.noalias() -= K * PHt.transpose();
    benchmark::DoNotOptimize(P.data());
  }
}
BENCHMARK(dense_eigen_of_403_states);

/// Adding landmarks one by one; per landmark.
void augment_to(benchmark::State& state) {
  const auto landmarks = static_cast<int>(state.range(0));
  for (auto _ : state) {
    std::vector<Slot> slots;
    benchmark::DoNotOptimize(mapped(landmarks, slots).x.data());
  }
  state.SetItemsProcessed(state.iterations() * landmarks);
}
BENCHMARK(augment_to)->Arg(125)->Arg(250)->Arg(500)->Unit(benchmark::kMillisecond);

/// Eight observations without ids against fifty landmarks, association and fusion.
void joint_8_of_50(benchmark::State& state) {
  std::vector<locfuse::KnownLandmark> known;
  for (int k = 0; k < 50; ++k) {
    known.push_back({k, place(k), 0.01 * Eigen::Matrix2d::Identity()});
  }
  LandmarkEkf::Config config;
  config.known = known;
  const LandmarkEkf start(config, {}, {0, {}, 0.01 * Eigen::Matrix3d::Identity()});
  std::vector<RangeBearing> sightings;
  for (int k = 0; k < 8; ++k) {
    sightings.push_back(sight({0.05, 0.05, 0.02}, place(5 * k)));
  }
  LandmarkEkf ekf = start;
  for (auto _ : state) {
    ekf = start;
    for (const locfuse::Outcome& outcome : ekf.on_joint(sightings)) {
      if (outcome.verdict != locfuse::Verdict::kFused) {
        state.SkipWithError("an observation was not fused");
      }
    }
  }
}
BENCHMARK(joint_8_of_50)->Unit(benchmark::kMicrosecond);

/// Association alone in an ambiguous case: all eight observations match several landmarks.
void joint_compatibility_8_of_50(benchmark::State& state) {
  std::vector<Slot> slots;
  const GaussianBelief belief = mapped(50, slots);
  Eigen::MatrixXd P = belief.P;
  P.topLeftCorner<3, 3>() += Eigen::Vector3d(4.0, 4.0, 0.04).asDiagonal();
  const RangeBearingModel model;
  locfuse::Pairings pairings;
  for (int i = 0; i < 8; ++i) {
    pairings.emplace_back();
    for (int k = 0; k < 50; ++k) {
      const auto lin =
          *model.linearize_with_landmark({0.2, 0.2, 0.03}, place(k), sight({}, place(6 * i)));
      pairings.back().push_back(
          {k, {lin.residual, lin.jacobian, lin.noise}, {0, 1, 2, 3 + 2 * k, 4 + 2 * k}, 0.0});
    }
  }
  std::size_t left = 0;
  for (auto _ : state) {
    locfuse::Pairings gated = pairings;
    locfuse::compare(P, 0.999, gated);
    benchmark::DoNotOptimize(joint_compatibility(P, gated, 0.999));
    left = 0;
    for (const auto& of_one : gated) {
      left += of_one.size();
    }
  }
  state.counters["candidates"] = static_cast<double>(left);
}
BENCHMARK(joint_compatibility_8_of_50)->Unit(benchmark::kMicrosecond);

// One prediction and three observations of a known map, per step.

constexpr int kSteps = 1000;

struct Circle {
  std::vector<Pose2> motions;
  std::vector<RangeBearing> sightings;  // three per step

  Circle() {
    std::mt19937_64 rng(1);
    std::normal_distribution<double> normal;
    Pose2 body;
    for (int i = 0; i < kSteps; ++i) {
      body = body * Pose2{0.05, 0.0, 0.01};
      motions.push_back({0.05 + 0.002 * normal(rng), 0.0, 0.01 + 0.002 * normal(rng)});
      for (int k = 0; k < 3; ++k) {
        RangeBearing z = sight(body, place(k));
        z.stamp = (i + 1) * Stamp{50'000'000};
        z.landmark = k;
        *z.range += 0.1 * normal(rng);
        *z.bearing = locfuse::wrap_angle(*z.bearing + 0.02 * normal(rng));
        sightings.push_back(z);
      }
    }
  }
};

const Circle& circle() {
  static const Circle input;
  return input;
}

locfuse::LandmarkSensor known_map(int count) {
  std::vector<locfuse::Landmark> places;
  for (int k = 0; k < count; ++k) {
    places.push_back({k, place(k), 0.0});
  }
  return {std::make_shared<locfuse::LandmarkMap>(places), {}};
}

const locfuse::PoseEstimate kStart{0, {}, 0.01 * Eigen::Matrix3d::Identity()};

template <class Filter>
void drive_on_known_map(benchmark::State& state, const Filter& start) {
  for (auto _ : state) {
    Filter ekf = start;
    for (std::size_t i = 0; i < kSteps; ++i) {
      const Stamp begin = static_cast<Stamp>(i) * 50'000'000;
      ekf.on(locfuse::Increment{begin, begin + 50'000'000, circle().motions[i]});
      for (std::size_t k = 0; k < 3; ++k) {
        ekf.on(circle().sightings[3 * i + k]);
      }
    }
    benchmark::DoNotOptimize(ekf);
  }
  state.SetItemsProcessed(state.iterations() * kSteps);
}

void known_map_pose_ekf(benchmark::State& state) {
  drive_on_known_map(state, PoseEkf(PoseEkf::Config{}, {{}, {}, known_map(3)}, kStart));
}
BENCHMARK(known_map_pose_ekf)->Unit(benchmark::kMicrosecond);

/// The same with detection of kidnapping.
void known_map_recovering_ekf(benchmark::State& state) {
  locfuse::RecoveringEkf ekf({}, {{}, {}, known_map(3)});
  ekf.start_at(kStart);
  drive_on_known_map(state, ekf);
  if (ekf.alarms() != 0 || ekf.is_lost()) {
    state.SkipWithError("it was lost");
  }
}
BENCHMARK(known_map_recovering_ekf)->Unit(benchmark::kMicrosecond);

/// All poses consistent with two observations without ids among the given number of landmarks.
void constellations_of(benchmark::State& state) {
  const locfuse::LandmarkSensor known = known_map(static_cast<int>(state.range(0)));
  const Eigen::Matrix2d covariance = 0.01 * Eigen::Matrix2d::Identity();
  const locfuse::SeenLandmark a{place(0), covariance, {}};
  const locfuse::SeenLandmark b{place(7), covariance, {}};
  for (auto _ : state) {
    benchmark::DoNotOptimize(locfuse::match_constellation(a, b, *known.map, 0.999));
  }
}
BENCHMARK(constellations_of)->Arg(50)->Arg(500)->Unit(benchmark::kMicrosecond);

/// Fixed-size Eigen, specialized for this problem: no checks, no gate, no outcome.
void known_map_fixed_size_eigen(benchmark::State& state) {
  const Vector2 places[] = {place(0), place(1), place(2)};
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Eigen::Matrix2d R = Eigen::Vector2d(0.01, 0.0004).asDiagonal();
  const Eigen::Matrix3d Q = Eigen::Vector3d(4.5e-5, 5e-6, 3e-5).asDiagonal();
  for (auto _ : state) {
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    Eigen::Matrix3d P = 0.01 * I;
    for (std::size_t i = 0; i < kSteps; ++i) {
      const Pose2& u = circle().motions[i];
      const double c = std::cos(x(2));
      const double s = std::sin(x(2));
      Eigen::Matrix3d F = I;
      F(0, 2) = -s * u.x - c * u.y;
      F(1, 2) = c * u.x - s * u.y;
      Eigen::Matrix3d G = I;
      G.topLeftCorner<2, 2>() << c, -s, s, c;
      x += Eigen::Vector3d(c * u.x - s * u.y, s * u.x + c * u.y, u.heading);
      P = (F * P * F.transpose() + G * Q * G.transpose()).eval();
      for (std::size_t k = 0; k < 3; ++k) {
        const RangeBearing& z = circle().sightings[3 * i + k];
        const Vector2 d = places[k] - x.head<2>();
        const double squared = d.squaredNorm();
        const double range = std::sqrt(squared);
        Eigen::Matrix<double, 2, 3> H;
        H << -d.x() / range, -d.y() / range, 0.0, d.y() / squared, -d.x() / squared, -1.0;
        double turn = *z.bearing - std::atan2(d.y(), d.x()) + x(2);
        turn -= 2.0 * kPi * std::round(turn / (2.0 * kPi));
        const Vector2 r(*z.range - range, turn);
        const Eigen::Matrix<double, 3, 2> PHt = P * H.transpose();
        const Eigen::Matrix2d S = H * PHt + R;
        const Eigen::Matrix<double, 3, 2> K = S.llt().solve(PHt.transpose()).transpose();
        x += K * r;
        const Eigen::Matrix3d A = I - K * H;
        P = (A * P * A.transpose() + K * R * K.transpose()).eval();
      }
    }
    benchmark::DoNotOptimize(x.data());
  }
  state.SetItemsProcessed(state.iterations() * kSteps);
}
BENCHMARK(known_map_fixed_size_eigen)->Unit(benchmark::kMicrosecond);

}  // namespace
