// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "locfuse/frontends/range_layout.hpp"
#include "support/random.hpp"

namespace locfuse::testing {

/// View of the numbers of a vector.
[[nodiscard]] inline Eigen::Map<const Eigen::VectorXd> view(const std::vector<double>& numbers) {
  return {numbers.data(), static_cast<Eigen::Index>(numbers.size())};
}

/// Anchors with the memory that AnchorTable views.
struct Anchors {
  std::vector<double> rows;
  int columns = 2;
  std::optional<double> height = {};

  [[nodiscard]] int size() const { return static_cast<int>(rows.size()) / columns; }
  [[nodiscard]] AnchorTable table() const {
    return {RowsView(rows.data(), size(), columns), height};
  }
  [[nodiscard]] std::vector<double> sigmas(double sigma) const {
    return std::vector<double>(static_cast<std::size_t>(size()), sigma);
  }
  /// Distances of a position (2 or 3) from the anchors.
  [[nodiscard]] std::vector<double> ranges_from(const Eigen::VectorXd& position) const {
    std::vector<double> ranges;
    for (int i = 0; i < size(); ++i) {
      double squared = 0.0;
      for (int k = 0; k < columns; ++k) {
        const double x = k < position.size() ? position(k) : *height;
        const double d = x - rows[static_cast<std::size_t>(i * columns + k)];
        squared += d * d;
      }
      ranges.push_back(std::sqrt(squared));
    }
    return ranges;
  }
};

[[nodiscard]] inline Anchors random_anchors(Rng& rng, int size, int columns, double extent = 10.0) {
  Anchors anchors;
  anchors.columns = columns;
  for (int i = 0; i < size * columns; ++i) {
    anchors.rows.push_back(uniform(rng, 0.0, extent));
  }
  return anchors;
}

[[nodiscard]] inline Eigen::VectorXd random_point(Rng& rng, int size, double extent = 10.0) {
  return Eigen::VectorXd::NullaryExpr(size, [&] { return uniform(rng, 0.0, extent); });
}

inline void add_noise(Rng& rng, double sigma, std::vector<double>& ranges) {
  for (double& range : ranges) {
    range = std::abs(range + normal(rng, sigma));
  }
}

/// Five anchors around a room of 10 m.
[[nodiscard]] inline Anchors room() {
  return {{0.0, 0.0, 10.0, 0.0, 10.0, 10.0, 0.0, 10.0, 5.0, 0.0}, 2, {}};
}

}  // namespace locfuse::testing
