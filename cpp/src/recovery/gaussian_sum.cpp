// SPDX-License-Identifier: Apache-2.0
#include "locfuse/recovery/gaussian_sum.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "recovery/outlier.hpp"

namespace locfuse::internal {
namespace {

/// What shapes the sum; distances are squared Mahalanobis distances.
struct GaussianSumTuning {
  static constexpr double kMinLogWeight = -30.0;  ///< beside the largest; below it one is dropped
  static constexpr double kMergeDistance = 0.3;   ///< of two components that become one
  static constexpr double kLinkedDistance = 9.0;  ///< of neighbours in a cluster, by pose
  /// Of neighbours by position, where one search for a scan serves both.
  static constexpr double kSamePlaceDistance = 1.0;
};

bool is_same(const PoseEstimate& a, const PoseEstimate& b) {
  return squared_distance(a, b, true) < GaussianSumTuning::kMergeDistance;
}

/// The moments of weighted estimates. Where headings spread all around their mean is arbitrary, and
/// the covariance is as wide.
PoseEstimate combined(const std::vector<std::pair<double, PoseEstimate>>& weighted) {
  double total = 0.0;
  Vector<2> position = Vector<2>::Zero();
  double sine = 0.0;
  double cosine = 0.0;
  for (const auto& [weight, estimate] : weighted) {
    total += weight;
    position += weight * estimate.pose.position();
    sine += weight * std::sin(estimate.pose.heading);
    cosine += weight * std::cos(estimate.pose.heading);
  }
  PoseEstimate mean{weighted.front().second.stamp, {}, Matrix<3, 3>::Zero()};
  mean.pose = {position.x() / total, position.y() / total, wrap_angle(std::atan2(sine, cosine))};
  for (const auto& [weight, estimate] : weighted) {
    const Vector<3> apart = local(estimate.pose, mean.pose);
    mean.covariance += weight / total * (estimate.covariance + apart * apart.transpose());
  }
  return mean;
}

GaussianCluster cluster(const std::vector<GaussianComponent>& components,
                        const std::vector<std::size_t>& members) {
  double log_weight = -std::numeric_limits<double>::infinity();
  for (const std::size_t member : members) {
    log_weight = log_sum(log_weight, components[member].log_weight);
  }
  std::vector<std::pair<double, PoseEstimate>> weighted;
  weighted.reserve(members.size());
  for (const std::size_t member : members) {
    weighted.emplace_back(std::exp(components[member].log_weight - log_weight),
                          components[member].ekf.current());
  }
  return {combined(weighted), log_weight};
}

}  // namespace

double squared_distance(const PoseEstimate& a, const PoseEstimate& b, bool with_heading) {
  const Vector<3> apart = local(a.pose, b.pose);
  const Matrix<3, 3> P = a.covariance + b.covariance;
  if (with_heading) {
    return apart.dot(P.llt().solve(apart));
  }
  return apart.head<2>().dot(P.topLeftCorner<2, 2>().llt().solve(apart.head<2>()));
}

double reduce(std::vector<GaussianComponent>& components,
              const std::function<PoseEkf(const PoseEstimate&)>& filter_at) {
  std::sort(components.begin(), components.end(),
            [](const GaussianComponent& a, const GaussianComponent& b) {
              return a.log_weight > b.log_weight;
            });
  const double best = components.front().log_weight;
  std::vector<GaussianComponent> kept;
  for (GaussianComponent& next : components) {
    next.log_weight -= best;
    if (next.log_weight < GaussianSumTuning::kMinLogWeight) {
      break;
    }
    const auto twin = std::find_if(kept.begin(), kept.end(), [&](const GaussianComponent& other) {
      return is_same(other.ekf.current(), next.ekf.current());
    });
    if (twin == kept.end()) {
      kept.push_back(std::move(next));
    } else {
      const PoseEstimate both = combined({{std::exp(twin->log_weight), twin->ekf.current()},
                                          {std::exp(next.log_weight), next.ekf.current()}});
      twin->ekf = filter_at(both);
      twin->log_weight = log_sum(twin->log_weight, next.log_weight);
    }
  }
  components = std::move(kept);
  return best;
}

std::vector<GaussianCluster> clusters(const std::vector<GaussianComponent>& components,
                                      bool by_heading) {
  std::vector<std::size_t> left(components.size());
  std::iota(left.begin(), left.end(), 0U);
  std::vector<GaussianCluster> found;
  while (!left.empty()) {
    std::vector<std::size_t> members{left.front()};
    left.erase(left.begin());
    for (std::size_t i = 0; i < members.size(); ++i) {  // grows while neighbours are found
      const PoseEstimate here = components[members[i]].ekf.current();
      const auto is_near = [&](std::size_t k) {
        const PoseEstimate there = components[k].ekf.current();
        return squared_distance(here, there, by_heading) <
               (by_heading ? GaussianSumTuning::kLinkedDistance
                           : GaussianSumTuning::kSamePlaceDistance);
      };
      const auto near = std::stable_partition(left.begin(), left.end(),
                                              [&](std::size_t k) { return !is_near(k); });
      members.insert(members.end(), near, left.end());
      left.erase(near, left.end());
    }
    found.push_back(cluster(components, members));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const GaussianCluster& a, const GaussianCluster& b) {
                     return a.log_weight > b.log_weight;
                   });
  return found;
}

}  // namespace locfuse::internal
