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

bool are_within(double limit, const PoseEstimate& a, const PoseEstimate& b, bool with_heading) {
  // The distance along one axis is no longer than the whole: mostly it tells, without a solution.
  constexpr double kRounding = 1.0 + 1e-9;
  const double x = a.pose.x - b.pose.x;
  const double y = a.pose.y - b.pose.y;
  if (x * x > kRounding * limit * (a.covariance(0, 0) + b.covariance(0, 0)) ||
      y * y > kRounding * limit * (a.covariance(1, 1) + b.covariance(1, 1))) {
    return false;
  }
  const Vector<3> apart = local(a.pose, b.pose);
  const Matrix<3, 3> P = a.covariance + b.covariance;
  const double distance =
      with_heading ? apart.dot(P.llt().solve(apart))
                   : apart.head<2>().dot(P.topLeftCorner<2, 2>().llt().solve(apart.head<2>()));
  return distance < limit;
}

double reduce(std::vector<GaussianComponent>& components,
              const std::function<PoseEkf(const PoseEstimate&)>& filter_at) {
  std::stable_sort(components.begin(), components.end(),
                   [](const GaussianComponent& a, const GaussianComponent& b) {
                     return a.log_weight > b.log_weight;
                   });
  const double best = components.front().log_weight;
  std::vector<GaussianComponent> kept;
  std::vector<PoseEstimate> places;  // of those kept
  for (GaussianComponent& next : components) {
    next.log_weight -= best;
    if (next.log_weight < GaussianSumTuning::kMinLogWeight) {
      break;
    }
    const PoseEstimate here = next.ekf.current();
    const auto place = std::find_if(places.begin(), places.end(), [&](const PoseEstimate& there) {
      return are_within(GaussianSumTuning::kMergeDistance, there, here, true);
    });
    if (place == places.end()) {
      kept.push_back(std::move(next));
      places.push_back(here);
    } else {
      GaussianComponent& twin = kept[static_cast<std::size_t>(place - places.begin())];
      twin.ekf = filter_at(
          combined({{std::exp(twin.log_weight), *place}, {std::exp(next.log_weight), here}}));
      twin.log_weight = log_sum(twin.log_weight, next.log_weight);
      *place = twin.ekf.current();
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
        return are_within(
            by_heading ? GaussianSumTuning::kLinkedDistance : GaussianSumTuning::kSamePlaceDistance,
            here, there, by_heading);
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
