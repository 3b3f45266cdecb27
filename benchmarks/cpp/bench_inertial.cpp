// SPDX-License-Identifier: Apache-2.0
// An inertial body: a prediction by a sample at 200 Hz and five ranges, compared to fixed-size
// Eigen.
#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "locfuse/locfuse.hpp"

namespace {

using locfuse::AirEkf;
using locfuse::Imu;
using locfuse::InertialMotion;
using locfuse::Range;
using locfuse::Stamp;
using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

constexpr int kSteps = 1000;
constexpr int kAnchors = 5;
constexpr double kPeriod = 0.005;
constexpr double kSigma = 0.1;
const Vector3 kTag{0.1, 0.0, 0.05};

const std::vector<locfuse::Anchor>& anchors() {
  static const std::vector<locfuse::Anchor> all = {{0, {-6.0, -6.0, 0.2}},
                                                   {1, {6.0, -6.0, 4.0}},
                                                   {2, {6.0, 6.0, 0.4}},
                                                   {3, {-6.0, 6.0, 3.5}},
                                                   {4, {0.0, -6.0, 2.0}}};
  return all;
}

/// A level body that swings along x, y and z and turns.
struct Swing {
  std::vector<Imu> samples;
  std::vector<Range> ranges;  // five per step

  Swing() {
    std::mt19937_64 rng(1);
    std::normal_distribution<double> normal;
    const auto place = [](double t) {
      return Vector3(std::sin(t), std::cos(0.8 * t), 1.5 + 0.3 * std::sin(1.3 * t));
    };
    for (int i = 0; i <= kSteps; ++i) {
      const double t = i * kPeriod;
      const Vector3 pushed(-std::sin(t), -0.64 * std::cos(0.8 * t),
                           InertialMotion::kGravity - 0.3 * 1.69 * std::sin(1.3 * t));
      const Matrix3 R = Eigen::AngleAxisd(0.3 * t, Vector3::UnitZ()).toRotationMatrix();
      const Stamp stamp = i * static_cast<Stamp>(kPeriod * 1e9);
      samples.push_back({stamp, Vector3(0.0, 0.0, 0.3), Vector3(R.transpose() * pushed)});
      for (const locfuse::Anchor& anchor : anchors()) {
        const double distance = (place(t) + R * kTag - anchor.position).norm();
        ranges.push_back({stamp, 0, anchor.id, distance + kSigma * normal(rng), {}});
      }
    }
  }
};

const Swing& swing() {
  static const Swing input;
  return input;
}

AirEkf start(double correlation_s) {
  AirEkf::Config config;
  config.motion = locfuse::AirMotion::kInertial;
  config.range.sigma_m = kSigma;
  config.range.gate = 1.0;
  config.correlation_s = correlation_s;
  AirEkf ekf(config, {std::make_shared<locfuse::AnchorMap>(anchors()), {{0, kTag}}},
             {0, {0.0, 1.0, 0.0}, 1.5, 0.01 * Eigen::Matrix4d::Identity()});
  ekf.on(swing().samples.front());
  return ekf;
}

void fly(benchmark::State& state, double correlation_s) {
  const AirEkf first = start(correlation_s);
  AirEkf ekf = first;
  for (auto _ : state) {
    ekf = first;
    for (std::size_t i = 1; i <= kSteps; ++i) {
      ekf.on(swing().samples[i]);
      for (std::size_t k = 0; k < kAnchors; ++k) {
        if (ekf.on(swing().ranges[kAnchors * i + k]).verdict != locfuse::Verdict::kFused) {
          state.SkipWithError("a range was not fused");
        }
      }
    }
    benchmark::DoNotOptimize(ekf);
  }
  state.SetItemsProcessed(state.iterations() * kSteps);
}

void inertial_ekf(benchmark::State& state) { fly(state, 0.0); }
BENCHMARK(inertial_ekf)->Unit(benchmark::kMicrosecond);

/// With the share of errors that last.
void inertial_ekf_correlated(benchmark::State& state) { fly(state, 10.0); }
BENCHMARK(inertial_ekf_correlated)->Unit(benchmark::kMicrosecond);

Matrix3 cross(const Vector3& v) {
  Matrix3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Matrix3 rotation(const Vector3& v) {
  const double angle = v.norm();
  return angle > 0.0 ? Eigen::AngleAxisd(angle, v / angle).toRotationMatrix() : Matrix3::Identity();
}

/// Fixed-size Eigen, specialized for this problem: position, velocity, attitude and biases, dense
/// covariance, one row at a time, no checks, no gate, no outcome.
void inertial_fixed_size_eigen(benchmark::State& state) {
  using Vector15 = Eigen::Matrix<double, 15, 1>;
  using Matrix15 = Eigen::Matrix<double, 15, 15>;
  const double T = kPeriod;
  Vector15 variance;
  variance << 0.01, 0.01, 0.01, 1.0, 1.0, 0.25, 0.0225, 0.0225, 0.01, 4e-4, 4e-4, 4e-4, 0.04, 0.04,
      0.04;
  Matrix15 Q = Matrix15::Zero();
  Q.block<3, 3>(0, 0).diagonal().setConstant(2.5e-3 * T * T * T / 3.0);
  Q.block<3, 3>(0, 3).diagonal().setConstant(2.5e-3 * T * T / 2.0);
  Q.block<3, 3>(3, 0).diagonal().setConstant(2.5e-3 * T * T / 2.0);
  Q.block<3, 3>(3, 3).diagonal().setConstant(2.5e-3 * T);
  Q.block<3, 3>(6, 6).diagonal().setConstant(4e-6 * T);
  Q.block<3, 3>(9, 9).diagonal().setConstant(1e-8 * T);
  Q.block<3, 3>(12, 12).diagonal().setConstant(1e-6 * T);
  for (auto _ : state) {
    Vector3 p(0.0, 1.0, 1.5);
    Vector3 v = Vector3::Zero();
    Matrix3 R = Matrix3::Identity();
    Vector3 rate_bias = Vector3::Zero();
    Vector3 force_bias = Vector3::Zero();
    Matrix15 P = variance.asDiagonal();
    for (std::size_t i = 1; i <= kSteps; ++i) {
      const Imu& before = swing().samples[i - 1];
      const Imu& now = swing().samples[i];
      const Vector3 turn = T * (0.5 * (before.angular_rate + now.angular_rate) - rate_bias);
      const Matrix3 middle = R * rotation(0.5 * turn);
      const Vector3 pushed =
          middle * (0.5 * (*before.specific_force + *now.specific_force) - force_bias);
      const Vector3 a = pushed - Vector3(0.0, 0.0, InertialMotion::kGravity);
      p += T * v + 0.5 * T * T * a;
      v += T * a;
      R *= rotation(turn);
      Matrix15 F = Matrix15::Identity();
      F.block<3, 3>(0, 3).diagonal().setConstant(T);
      F.block<3, 3>(3, 6) = -T * cross(pushed);
      F.block<3, 3>(0, 6) = 0.5 * T * F.block<3, 3>(3, 6);
      F.block<3, 3>(3, 12) = -T * middle;
      F.block<3, 3>(0, 12) = 0.5 * T * F.block<3, 3>(3, 12);
      F.block<3, 3>(6, 9) = -T * middle;
      P = (F * P * F.transpose() + Q).eval();
      for (std::size_t k = 0; k < kAnchors; ++k) {
        const Vector3 arm = R * kTag;
        const Vector3 d = p + arm - anchors()[k].position;
        const double distance = d.norm();
        const Vector3 u = d / distance;
        Vector15 H = Vector15::Zero();
        H.head<3>() = u;
        H.segment<3>(6) = arm.cross(u);
        const Vector15 PHt = P * H;
        const Vector15 K = PHt / (H.dot(PHt) + kSigma * kSigma);
        const Vector15 moved = K * (swing().ranges[kAnchors * i + k].range - distance);
        const Matrix15 half = P - K * PHt.transpose();
        P = half - (half * H - K * (kSigma * kSigma)) * K.transpose();
        P = (0.5 * (P + P.transpose())).eval();
        p += moved.head<3>();
        v += moved.segment<3>(3);
        R = rotation(moved.segment<3>(6)) * R;
        rate_bias += moved.segment<3>(9);
        force_bias += moved.segment<3>(12);
      }
    }
    benchmark::DoNotOptimize(p.data());
    benchmark::DoNotOptimize(P.data());
  }
  state.SetItemsProcessed(state.iterations() * kSteps);
}
BENCHMARK(inertial_fixed_size_eigen)->Unit(benchmark::kMicrosecond);

}  // namespace
