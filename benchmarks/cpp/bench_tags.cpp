// SPDX-License-Identifier: Apache-2.0
// Three tags as twelve states: a prediction and the 15 rows of celan2017, compared to fixed-size
// Eigen.
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

#include "locfuse/locfuse.hpp"

namespace {

using locfuse::Pose2;
using locfuse::PositionFix;
using locfuse::Stamp;
using locfuse::TagTriangleEkf;
using locfuse::Velocity;

constexpr int kSteps = 1000;
constexpr double kPeriod = 0.13;
constexpr double kForward = 0.33;
constexpr double kTurnRate = 0.1;
constexpr double kVariance = 0.0225;

const std::vector<locfuse::Tag>& tags() {
  static const std::vector<locfuse::Tag> triangle = {
      {0, {0.6, 0.0, 1.0}}, {1, {-0.45, 0.25, 1.0}}, {2, {-0.45, -0.25, 1.0}}};
  return triangle;
}

/// Circle with wheel odometry and a fix of each tag in every step.
struct Circle {
  std::vector<Velocity> wheels;
  std::vector<PositionFix> fixes;  // three per step

  Circle() {
    std::mt19937_64 rng(1);
    std::normal_distribution<double> normal;
    Pose2 body;
    for (int i = 0; i < kSteps; ++i) {
      const Stamp stamp = (i + 1) * static_cast<Stamp>(kPeriod * 1e9);
      body = body * locfuse::arc(kForward * kPeriod, 0.0, kTurnRate * kPeriod);
      wheels.push_back({stamp, kForward + 0.02 * normal(rng), kTurnRate + 0.02 * normal(rng)});
      for (const locfuse::Tag& tag : tags()) {
        PositionFix z;
        z.stamp = stamp;
        z.tag = tag.id;
        z.position = body.act(tag.position.head<2>()) +
                     std::sqrt(kVariance) * Eigen::Vector2d{normal(rng), normal(rng)};
        z.covariance = kVariance * Eigen::Matrix2d::Identity();
        fixes.push_back(z);
      }
    }
  }
};

const Circle& circle() {
  static const Circle input;
  return input;
}

TagTriangleEkf start(bool heading_is_known) {
  TagTriangleEkf::Config config;
  config.heading_is_known = heading_is_known;
  config.position.gate = config.velocity.gate = 1.0;
  return {config, {{}, tags()}, locfuse::PoseEstimate{0, {}, 0.01 * Eigen::Matrix3d::Identity()}};
}

void drive(benchmark::State& state, bool heading_is_known) {
  const TagTriangleEkf first = start(heading_is_known);
  TagTriangleEkf ekf = first;
  for (auto _ : state) {
    ekf = first;
    for (std::size_t i = 0; i < kSteps; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        ekf.on(circle().fixes[3 * i + k]);
      }
      if (ekf.on(circle().wheels[i]).verdict != locfuse::Verdict::kFused) {
        state.SkipWithError("a message was not fused");
      }
    }
    benchmark::DoNotOptimize(ekf);
  }
  state.SetItemsProcessed(state.iterations() * kSteps);
}

/// As in the paper: the heading is taken as known.
void tags_ekf_of_the_paper(benchmark::State& state) { drive(state, true); }
BENCHMARK(tags_ekf_of_the_paper)->Unit(benchmark::kMicrosecond);

/// With the Jacobian of the heading.
void tags_ekf(benchmark::State& state) { drive(state, false); }
BENCHMARK(tags_ekf)->Unit(benchmark::kMicrosecond);

/// Fixed-size Eigen, specialized for this problem: one update of 15 rows, no checks, no gate, no
/// outcome, the heading by the closed form without weights.
void tags_fixed_size_eigen(benchmark::State& state) {
  using Vector12 = Eigen::Matrix<double, 12, 1>;
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  using Vector15 = Eigen::Matrix<double, 15, 1>;
  using Rows = Eigen::Matrix<double, 15, 12>;
  using Noise = Eigen::Matrix<double, 15, 15>;
  Eigen::Matrix<double, 2, 3> body;
  for (int k = 0; k < 3; ++k) {
    body.col(k) = tags()[static_cast<std::size_t>(k)].position.head<2>();
  }
  const Eigen::Vector2d middle = body.rowwise().mean();
  Eigen::Vector3d lengths;
  for (int k = 0; k < 3; ++k) {
    lengths(k) = (body.col((k + 1) % 3) - body.col(k)).norm();
  }
  const Matrix12 I = Matrix12::Identity();
  const double T = kPeriod;
  const double q = 0.04;
  Matrix12 F = I;
  F.topRightCorner<6, 6>().diagonal().setConstant(T);
  Matrix12 Q = Matrix12::Zero();
  Q.topLeftCorner<6, 6>().diagonal().setConstant(q * T * T * T / 3.0);
  Q.topRightCorner<6, 6>().diagonal().setConstant(q * T * T / 2.0);
  Q.bottomLeftCorner<6, 6>().diagonal().setConstant(q * T * T / 2.0);
  Q.bottomRightCorner<6, 6>().diagonal().setConstant(q * T);
  const TagTriangleEkf first = start(true);
  for (auto _ : state) {
    Vector12 x = first.belief().x;
    Matrix12 P = first.belief().P;
    for (std::size_t i = 0; i < kSteps; ++i) {
      x = (F * x).eval();
      P = (F * P * F.transpose() + Q).eval();
      Vector15 r;
      Rows H = Rows::Zero();
      Noise R = Noise::Zero();
      Eigen::Vector2d turn = Eigen::Vector2d::Zero();
      const Eigen::Vector2d centre = (x.segment<2>(0) + x.segment<2>(2) + x.segment<2>(4)) / 3.0;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector2d b = body.col(k) - middle;
        const Eigen::Vector2d w = x.segment<2>(2 * k) - centre;
        turn += Eigen::Vector2d(b.dot(w), b.x() * w.y() - b.y() * w.x());
      }
      const double heading = std::atan2(turn.y(), turn.x());
      const double c = std::cos(heading);
      const double s = std::sin(heading);
      const Velocity& u = circle().wheels[i];
      Eigen::Matrix<double, 6, 3> B;
      for (int k = 0; k < 3; ++k) {
        r.segment<2>(2 * k) =
            circle().fixes[3 * i + static_cast<std::size_t>(k)].position - x.segment<2>(2 * k);
        const double forward = u.forward - u.turn_rate * body(1, k);
        const double left = u.turn_rate * body(0, k);
        r.segment<2>(6 + 2 * k) = Eigen::Vector2d(c * forward - s * left, s * forward + c * left) -
                                  x.segment<2>(6 + 2 * k);
        B.row(2 * k) << c, -s, -c * body(1, k) - s * body(0, k);
        B.row(2 * k + 1) << s, c, -s * body(1, k) + c * body(0, k);
        const int next = (k + 1) % 3;
        const Eigen::Vector2d d = x.segment<2>(2 * next) - x.segment<2>(2 * k);
        const double length = d.norm();
        r(12 + k) = lengths(k) - length;
        H.block<1, 2>(12 + k, 2 * k) = -d.transpose() / length;
        H.block<1, 2>(12 + k, 2 * next) = d.transpose() / length;
      }
      H.topLeftCorner<12, 12>().setIdentity();
      R.diagonal().head<6>().setConstant(kVariance);
      R.block<6, 6>(6, 6) = B * Eigen::Vector3d(4e-4, 1e-4, 4e-4).asDiagonal() * B.transpose();
      R.block<6, 6>(6, 6).diagonal().array() += 1e-4;
      R.diagonal().tail<3>().setConstant(2.5e-5);
      const Eigen::Matrix<double, 12, 15> PHt = P * H.transpose();
      const Noise S = H * PHt + R;
      const Eigen::Matrix<double, 12, 15> K = S.llt().solve(PHt.transpose()).transpose();
      x += K * r;
      const Matrix12 A = I - K * H;
      P = (A * P * A.transpose() + K * R * K.transpose()).eval();
    }
    benchmark::DoNotOptimize(x.data());
  }
  state.SetItemsProcessed(state.iterations() * kSteps);
}
BENCHMARK(tags_fixed_size_eigen)->Unit(benchmark::kMicrosecond);

}  // namespace
