// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <random>
#include <vector>

/// Common input of the filter benchmarks: 2,000 steps on a circle of 2.5 m radius, five anchors, an
/// increment and five ranges per step; seed 1.
struct Circle {
  static constexpr int kSteps = 2000;
  static constexpr int kAnchors = 5;
  static constexpr double kSigmaMotion[3] = {0.02, 0.01, 0.01};
  static constexpr double kSigmaRange = 0.1;
  static constexpr double kSigmaStart[3] = {0.5, 0.5, 0.2};
  static constexpr double kAnchorXY[kAnchors][2] = {{0, 0}, {10, 0}, {10, 10}, {0, 10}, {5, 0.5}};

  double start[3] = {5.3, 1.8, 0.1};
  std::vector<double> u;      // 3 per step
  std::vector<double> z;      // 5 per step
  std::vector<double> truth;  // x, y per step

  Circle() {
    std::mt19937_64 engine(1);
    std::normal_distribution<double> normal;
    double x = 5.0;
    double y = 2.0;
    double heading = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      x += 0.05 * std::cos(heading);
      y += 0.05 * std::sin(heading);
      heading += 0.02;
      u.push_back(0.05 + kSigmaMotion[0] * normal(engine));
      u.push_back(kSigmaMotion[1] * normal(engine));
      u.push_back(0.02 + kSigmaMotion[2] * normal(engine));
      for (const auto& anchor : kAnchorXY) {
        z.push_back(std::hypot(x - anchor[0], y - anchor[1]) + kSigmaRange * normal(engine));
      }
      truth.push_back(x);
      truth.push_back(y);
    }
  }

  /// Position RMSE of estimates (x, y, heading per step) after convergence [m].
  [[nodiscard]] double rmse(const std::vector<double>& estimates) const {
    double sum = 0.0;
    for (int k = 100; k < kSteps; ++k) {
      const auto e = static_cast<std::size_t>(3 * k);
      const auto t = static_cast<std::size_t>(2 * k);
      sum += std::pow(estimates[e] - truth[t], 2) + std::pow(estimates[e + 1] - truth[t + 1], 2);
    }
    return std::sqrt(sum / (kSteps - 100));
  }
};
