// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/clustering.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "filters/bin_index.hpp"
#include "filters/fast_math.hpp"

namespace locfuse {
namespace {

using internal::Binning;
using internal::heading_of;
using internal::Occupied;

/// Share of the heaviest bin below which a bin ends its cluster.
constexpr double kMinClusterBinShare = 0.05;

}  // namespace

std::vector<ParticleCluster> clusters_of(const ParticleBelief& belief, const ParticleBins& bins,
                                         int max_clusters) {
  const Binning binning(bins);
  const Occupied in = internal::occupied(belief, binning);
  // Neighbours are mostly in one bin: their sums stay in registers.
  const auto each_run = [&](const auto& run) {
    const std::size_t size = in.of_particle.size();
    for (std::size_t begin = 0, end = 0; begin < size; begin = end) {
      const std::int32_t bin = in.of_particle[begin];
      for (end = begin + 1; end < size && in.of_particle[end] == bin; ++end) {
      }
      run(static_cast<std::size_t>(bin), begin, end);
    }
  };
  std::vector<double> weight(in.numbers.size(), 0.0);
  each_run([&](std::size_t bin, std::size_t begin, std::size_t end) {
    weight[bin] += std::accumulate(&belief.weight[begin], &belief.weight[0] + end, 0.0);
  });
  // What lies between two clusters, thinly spread, must not join them.
  const double min_weight = kMinClusterBinShare * *std::max_element(weight.begin(), weight.end());
  std::vector<int> cluster_of(weight.size(), -1);
  int count = 0;
  std::vector<std::int32_t> open;
  for (std::size_t start = 0; start < weight.size(); ++start) {
    if (cluster_of[start] >= 0 || weight[start] < min_weight) {
      continue;
    }
    cluster_of[start] = count;
    open.assign(1, static_cast<std::int32_t>(start));
    while (!open.empty()) {
      const std::int64_t number = in.numbers[static_cast<std::size_t>(open.back())];
      open.pop_back();
      binning.around(number, [&](std::int64_t next) {
        const auto found = in.at.find(next);
        if (found == in.at.end()) {
          return;
        }
        const auto neighbour = static_cast<std::size_t>(found->second);
        if (cluster_of[neighbour] < 0) {
          cluster_of[neighbour] = count;
          if (weight[neighbour] >= min_weight) {  // a thin one ends the cluster
            open.push_back(found->second);
          }
        }
      });
    }
    ++count;
  }
  struct Sums {
    double w = 0.0;
    Vector<4> pose = Vector<4>::Zero();  // x, y, cosine, sine
    Matrix<3, 3> scatter = Matrix<3, 3>::Zero();
  };
  std::vector<Sums> sums(static_cast<std::size_t>(count));
  each_run([&](std::size_t bin, std::size_t begin, std::size_t end) {
    if (cluster_of[bin] < 0) {
      return;
    }
    double weights = 0.0;
    Vector<4> poses = Vector<4>::Zero();
    for (std::size_t k = begin; k < end; ++k) {
      const auto w = static_cast<double>(belief.weight[k]);
      weights += w;
      poses += w * Vector<4>(belief.x[k], belief.y[k], belief.c[k], belief.s[k]);
    }
    Sums& sum = sums[static_cast<std::size_t>(cluster_of[bin])];
    sum.w += weights;
    sum.pose += poses;
  });
  std::vector<ParticleCluster> clusters(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    Vector<4>& pose = sums[i].pose;
    clusters[i].weight = sums[i].w;
    clusters[i].mean = {pose.x() / sums[i].w, pose.y() / sums[i].w, std::atan2(pose.w(), pose.z())};
    pose.tail<2>().normalize();
  }
  each_run([&](std::size_t bin, std::size_t begin, std::size_t end) {
    if (cluster_of[bin] < 0) {
      return;
    }
    const auto cluster = static_cast<std::size_t>(cluster_of[bin]);
    const Pose2& mean = clusters[cluster].mean;
    const auto c = static_cast<float>(sums[cluster].pose.z());
    const auto s = static_cast<float>(sums[cluster].pose.w());
    Matrix<3, 3> scatter = Matrix<3, 3>::Zero();
    for (std::size_t k = begin; k < end; ++k) {
      const Vector<3> off(static_cast<double>(belief.x[k]) - mean.x,
                          static_cast<double>(belief.y[k]) - mean.y,
                          static_cast<double>(heading_of(belief.c[k] * c + belief.s[k] * s,
                                                         belief.s[k] * c - belief.c[k] * s)));
      const Vector<3> weighed = static_cast<double>(belief.weight[k]) * off;
      scatter.noalias() += weighed * off.transpose();
    }
    sums[cluster].scatter += scatter;
  });
  for (std::size_t i = 0; i < sums.size(); ++i) {
    clusters[i].covariance = sums[i].scatter / sums[i].w;
  }
  clusters.erase(std::remove_if(clusters.begin(), clusters.end(),
                                [](const ParticleCluster& c) { return !(c.weight > 0.0); }),
                 clusters.end());
  std::stable_sort(clusters.begin(), clusters.end(),
                   [](const auto& a, const auto& b) { return a.weight > b.weight; });
  if (clusters.size() > static_cast<std::size_t>(max_clusters)) {
    clusters.resize(static_cast<std::size_t>(max_clusters));
  }
  return clusters;
}

}  // namespace locfuse
