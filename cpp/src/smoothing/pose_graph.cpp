// SPDX-License-Identifier: Apache-2.0
#include "locfuse/smoothing/pose_graph.hpp"

#include <ceres/problem.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <stdexcept>

#include "locfuse/math/chi_squared.hpp"
#include "smoothing/graph_covariance.hpp"
#include "smoothing/rejection.hpp"
#include "smoothing/sparse_problem.hpp"

namespace locfuse {
namespace {

using internal::pose_of;

/// W with W'W = information, a row for each axis of its ellipsoid.
Matrix<3, 3> whitening_of(const Matrix<3, 3>& information) {
  const Eigen::SelfAdjointEigenSolver<Matrix<3, 3>> axes(information);
  return axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         axes.eigenvectors().transpose();
}

/// Number of axes that a relation knows.
int rank_of(const Matrix<3, 3>& whiten) {
  return static_cast<int>((whiten.rowwise().squaredNorm().array() > 0.0).count());
}

std::string named(std::size_t relation) { return "relation " + std::to_string(relation); }

void check(const std::vector<Pose2>& guess, const std::vector<PoseRelation>& relations,
           const PoseGraphConfig& config) {
  if (guess.empty()) {
    throw std::invalid_argument("a pose graph has no pose, expected one or more");
  }
  if (!(config.wrong_probability > 0.0 && config.wrong_probability < 1.0) ||
      config.max_iterations < 1) {
    throw std::invalid_argument(
        "PoseGraphConfig: expected a wrong_probability between 0 and 1, "
        "and at least 1 of max_iterations");
  }
  for (const Pose2& pose : guess) {
    if (!std::isfinite(pose.x + pose.y + pose.heading)) {
      throw std::invalid_argument("a pose of the graph is not finite");
    }
  }
  std::vector<std::size_t> group(guess.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  const auto first_of = [&](std::size_t pose) {
    while (group[pose] != pose) {
      group[pose] = group[group[pose]];
      pose = group[pose];
    }
    return pose;
  };
  for (std::size_t k = 0; k < relations.size(); ++k) {
    const PoseRelation& one = relations[k];
    if (one.from >= guess.size() || one.to >= guess.size() || one.from == one.to) {
      throw std::invalid_argument(named(k) + " is from pose " + std::to_string(one.from) + " to " +
                                  std::to_string(one.to) + ", expected two of " +
                                  std::to_string(guess.size()));
    }
    const Matrix<3, 3>& I = one.information;
    if (!std::isfinite(one.motion.x + one.motion.y + one.motion.heading) || !I.allFinite() ||
        !I.isApprox(I.transpose(), 1e-6) ||
        !(Eigen::SelfAdjointEigenSolver<Matrix<3, 3>>(I, Eigen::EigenvaluesOnly).eigenvalues()(0) >=
          -1e-9 * I.trace())) {
      throw std::invalid_argument(named(k) +
                                  " is not finite, or its information is not a symmetric positive "
                                  "semidefinite matrix");
    }
    if (!one.may_be_wrong) {
      group[first_of(one.from)] = first_of(one.to);
    }
  }
  for (std::size_t pose = 1; pose < guess.size(); ++pose) {
    if (first_of(pose) != first_of(0)) {
      throw std::invalid_argument("pose " + std::to_string(pose) +
                                  " of the graph is tied to the "
                                  "first by no relation that is surely right");
    }
  }
}

class Graph {
  /// How far beyond its limit a squared error may be for a relation to be asked again.
  static constexpr double kSecondChance = 2.0;

 public:
  Graph(const std::vector<Pose2>& guess, const std::vector<PoseRelation>& relations,
        const PoseGraphConfig& config)
      : relations_(relations),
        config_(config),
        poses_(guess.size()),
        weights_(relations.size(), 1.0) {
    for (std::size_t i = 0; i < guess.size(); ++i) {
      poses_[i] = {guess[i].x, guess[i].y, guess[i].heading};
    }
    for (const PoseRelation& relation : relations) {
      whiten_.push_back(whitening_of(relation.information));
      const int rank = rank_of(whiten_.back());
      limits_.push_back(rank > 0 ? chi_squared_quantile(rank, 1.0 - config.wrong_probability)
                                 : 1.0);
    }
  }

  SolvedPoseGraph solved() {
    SolvedPoseGraph found;
    const auto is_gated = [&](std::size_t k) { return relations_[k].may_be_wrong; };
    const auto share = [&](std::size_t k) { return squared(k) / limits_[k]; };
    if (!relations_.empty()) {
      solve(found, 1e-12);
      bool is_exact = true;
      internal::reject_gradually(weights_, is_gated, share, [&] {
        solve(found, 1e-4);
        is_exact = false;
      });
      for (const bool is_asked_again : {false, true, false}) {
        std::vector<double> decided = weights_;
        for (std::size_t k = 0; k < decided.size(); ++k) {
          decided[k] = !is_gated(k) || share(k) <= 1.0 ? 1.0 : 0.0;
        }
        if (is_asked_again) {
          ask_again(decided);
        }
        if (decided != weights_ || !is_exact) {
          weights_ = std::move(decided);
          solve(found, 1e-12);
          is_exact = true;
        }
      }
    }
    for (const auto& pose : poses_) {
      found.poses.push_back(pose_of(pose.data()));
    }
    for (const double weight : weights_) {
      found.kept.push_back(weight > 0.0);
    }
    return found;
  }

 private:
  /// Gives rejected relations their weight back that may be right: one that takes no part is as far
  /// off as it and all the others are unsure.
  void ask_again(std::vector<double>& weights) const {
    if (std::all_of(weights.begin(), weights.end(), [](double one) { return one > 0.0; })) {
      return;
    }
    std::vector<Pose2> poses;
    std::vector<bool> kept;
    for (const auto& pose : poses_) {
      poses.push_back(pose_of(pose.data()));
    }
    std::transform(weights.begin(), weights.end(), std::back_inserter(kept),
                   [](double one) { return one > 0.0; });
    const internal::GraphCovariance covariance(poses, relations_, kept);
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const PoseRelation& one = relations_[k];
      if (kept[k]) {
        continue;
      }
      const Vector<3> off = local(inverse(poses[one.from]) * poses[one.to], one.motion);
      const Matrix<3, 3> P = covariance.between(one.from, one.to);
      weights[k] =
          off.dot(internal::less_sure(one.information, P) * off) <= kSecondChance * limits_[k]
              ? 1.0
              : 0.0;
    }
  }

  void solve(SolvedPoseGraph& found, double tolerance) {
    ceres::Problem problem;
    for (auto& pose : poses_) {
      problem.AddParameterBlock(pose.data(), 3);
    }
    problem.SetParameterBlockConstant(poses_.front().data());
    for (std::size_t k = 0; k < relations_.size(); ++k) {
      if (weights_[k] > 0.0) {
        internal::add_motion(problem, relations_[k].motion, std::sqrt(weights_[k]) * whiten_[k],
                             poses_[relations_[k].from].data(), poses_[relations_[k].to].data());
      }
    }
    internal::note_solution(
        internal::solve_sparse(problem, config_.max_iterations, tolerance, "the pose graph"),
        found);
  }

  [[nodiscard]] double squared(std::size_t k) const {
    const PoseRelation& relation = relations_[k];
    const Vector<3> error = internal::motion_error(poses_[relation.from].data(),
                                                   poses_[relation.to].data(), relation.motion);
    return (whiten_[k] * error).squaredNorm();
  }

  const std::vector<PoseRelation>& relations_;
  const PoseGraphConfig& config_;
  std::vector<std::array<double, 3>> poses_;
  std::vector<Matrix<3, 3>> whiten_;
  std::vector<double> limits_;   // of squared errors
  std::vector<double> weights_;  // 0 is wrong
};

}  // namespace

SolvedPoseGraph solve_pose_graph(const std::vector<Pose2>& guess,
                                 const std::vector<PoseRelation>& relations,
                                 const PoseGraphConfig& config) {
  check(guess, relations, config);
  return Graph(guess, relations, config).solved();
}

}  // namespace locfuse
