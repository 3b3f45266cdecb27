// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "locfuse/math/chi_squared.hpp"
#include "locfuse/smoothing/pose_graph.hpp"
#include "smoothing/graph_covariance.hpp"
#include "support/expect.hpp"
#include "support/random.hpp"

namespace locfuse {
namespace {

using testing::expect_near;
using testing::expect_pose_near;
using testing::expect_refused;
using testing::normal;
using testing::Rng;
using testing::uniform;

const Vector<3> kSigma(0.05, 0.05, 0.01);

Matrix<3, 3> information() { return kSigma.cwiseAbs2().cwiseInverse().asDiagonal(); }

/// A walk on streets a block apart, as odometry reports it, with loops where it crosses itself.
struct Walk {
  explicit Walk(std::uint64_t seed, int steps = 300) {
    Rng rng(seed);
    truth = guess = {Pose2{}};
    for (int k = 0; k < steps; ++k) {
      const double turn = k % 4 == 3 ? 0.5 * kPi * std::floor(uniform(rng, -1.0, 2.0)) : 0.0;
      const double back = truth.back().position().norm() > 12.0 && k % 4 == 3 ? kPi : turn;
      truth.push_back(truth.back() * Pose2{1.0, 0.0, back});
      relate(rng, truth.size() - 2, truth.size() - 1, false);
      guess.push_back(guess.back() * relations.back().motion);
    }
    for (std::size_t i = 0; i < truth.size(); i += 3) {
      for (std::size_t k = i + 20; k < truth.size(); k += 5) {
        if ((truth[i].position() - truth[k].position()).norm() < 1.5) {
          relate(rng, i, k, true);
        }
      }
    }
    right = relations.size();
  }

  void relate(Rng& rng, std::size_t from, std::size_t to, bool may_be_wrong) {
    const Pose2 exact = inverse(truth[from]) * truth[to];
    const Pose2 motion =
        retract(exact, {normal(rng, kSigma.x()), normal(rng, kSigma.y()), normal(rng, kSigma.z())});
    relations.push_back({from, to, motion, information(), may_be_wrong});
  }

  /// Places that only look the same.
  void add_wrong_loops(Rng& rng, std::size_t count) {
    const auto last = static_cast<double>(truth.size());
    while (relations.size() < right + count) {
      const auto from = static_cast<std::size_t>(uniform(rng, 0.0, last));
      const auto to = static_cast<std::size_t>(uniform(rng, 0.0, last));
      if ((truth[from].position() - truth[to].position()).norm() > 5.0) {
        relations.push_back({from, to, testing::random_pose(rng, 2.0), information(), true});
      }
    }
  }

  std::vector<Pose2> truth, guess;
  std::vector<PoseRelation> relations;
  std::size_t right = 0;
};

TEST(PoseGraph, finds_the_optimum_of_the_clean_graph_among_wrong_loops) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    Walk walk(seed);
    const PoseGraphConfig config{1e-6, 100};
    const SolvedPoseGraph clean = solve_pose_graph(walk.guess, walk.relations, config);
    const std::size_t loops = walk.right - (walk.truth.size() - 1);
    ASSERT_GT(loops, 50U);
    EXPECT_TRUE(clean.converged);
    EXPECT_EQ(std::count(clean.kept.begin(), clean.kept.end(), false), 0);
    Rng rng(seed + 100);
    walk.add_wrong_loops(rng, loops / 4);
    const SolvedPoseGraph found = solve_pose_graph(walk.guess, walk.relations, config);
    EXPECT_NEAR(found.cost, clean.cost, 1e-6 * clean.cost);
    for (std::size_t k = 0; k < walk.relations.size(); ++k) {
      EXPECT_EQ(found.kept[k], k < walk.right) << k;
    }
    for (std::size_t i = 0; i < walk.truth.size(); ++i) {
      expect_pose_near(found.poses[i], clean.poses[i], 1e-4);
    }
    // The sum of squares is that of chi squared.
    const int dof = 3 * static_cast<int>(loops);
    EXPECT_LT(2.0 * clean.cost, chi_squared_quantile(dof, 0.9999));
    EXPECT_GT(2.0 * clean.cost, chi_squared_quantile(dof, 0.0001));
  }
}

TEST(PoseGraph, leaves_alone_what_a_relation_does_not_know) {
  const Matrix<3, 3> along = Vector<3>(0.0, 1e4, 1e4).asDiagonal();  // as in a corridor
  const std::vector<PoseRelation> relations = {
      {0, 1, {2.0, 0.0, 0.0}, Matrix<3, 3>::Identity(), false},
      {0, 1, {7.0, 0.3, 0.1}, along, true}};
  const SolvedPoseGraph found = solve_pose_graph({Pose2{}, Pose2{2.0, 0.0, 0.0}}, relations);
  EXPECT_TRUE(found.kept[1]);
  EXPECT_NEAR(found.poses[1].x, 2.0, 1e-6);
  EXPECT_NEAR(found.poses[1].y, 0.3, 1e-3);
  EXPECT_NEAR(found.poses[1].heading, 0.1, 1e-3);
}

TEST(PoseGraph, covariances_are_those_of_the_whole_matrix) {
  const Walk walk(7, 40);
  const std::vector<bool> kept(walk.relations.size(), true);
  const SolvedPoseGraph found = solve_pose_graph(walk.guess, walk.relations);
  const internal::GraphCovariance covariance(found.poses, walk.relations, kept);
  const auto size = static_cast<Eigen::Index>(3 * walk.truth.size());
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
  Eigen::MatrixXd J(3, size);
  const auto jacobian = [&](std::size_t from, std::size_t to) {
    J.setZero();
    const internal::MotionJacobians by =
        internal::motion_jacobians(found.poses[from], found.poses[to]);
    J.middleCols<3>(static_cast<Eigen::Index>(3 * from)) = by.by_first;
    J.middleCols<3>(static_cast<Eigen::Index>(3 * to)) = by.by_second;
  };
  for (const PoseRelation& relation : walk.relations) {
    jacobian(relation.from, relation.to);
    H += J.transpose() * relation.information * J;
  }
  H.topLeftCorner<3, 3>() += 1e12 * Matrix<3, 3>::Identity();
  const Eigen::MatrixXd P = H.inverse();
  expect_near(covariance.of(0), Matrix<3, 3>::Zero(), 0.0);
  for (const std::size_t pose : {1U, 20U, 40U}) {
    const auto at = static_cast<Eigen::Index>(3 * pose);
    expect_near(covariance.of(pose), P.block<3, 3>(at, at), 1e-7);
    for (const std::size_t other : {0U, 13U, 39U}) {
      jacobian(other, pose);
      expect_near(covariance.between(other, pose), J * P * J.transpose(), 1e-7);
    }
  }
}

TEST(PoseGraph, jacobians_are_the_slopes_of_the_motion) {
  Rng rng(3);
  for (int k = 0; k < 20; ++k) {
    const Pose2 first = testing::random_pose(rng, 3.0);
    const Pose2 second = testing::random_pose(rng, 3.0);
    const Pose2 motion = inverse(first) * second;
    const internal::MotionJacobians by = internal::motion_jacobians(first, second);
    constexpr double kStep = 1e-6;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector<3> step = kStep * Vector<3>::Unit(axis);
      const Vector<3> of_first = local(inverse(retract(first, step)) * second, motion) / kStep;
      const Vector<3> of_second = local(inverse(first) * retract(second, step), motion) / kStep;
      expect_near(by.by_first.col(axis), of_first, 1e-4);
      expect_near(by.by_second.col(axis), of_second, 1e-4);
    }
  }
}

TEST(PoseGraph, a_further_error_makes_information_less) {
  const Matrix<3, 3> known = Vector<3>(100.0, 25.0, 0.0).asDiagonal();
  const Matrix<3, 3> less = internal::less_sure(known, 0.01 * Matrix<3, 3>::Identity());
  expect_near(less, Matrix<3, 3>(Vector<3>(50.0, 20.0, 0.0).asDiagonal()), 1e-9);
}

TEST(PoseGraph, one_pose_is_a_graph) {
  const SolvedPoseGraph found = solve_pose_graph({Pose2{1.0, 2.0, 3.0}}, {});
  expect_pose_near(found.poses[0], {1.0, 2.0, 3.0}, 0.0);
}

TEST(PoseGraph, refuses_what_is_no_graph) {
  const std::vector<Pose2> two(2);
  const PoseRelation tied{0, 1, {}, information(), false};
  expect_refused([] { (void)solve_pose_graph({}, {}); }, "no pose");
  expect_refused([&] { (void)solve_pose_graph(two, {}); }, "pose 1", "tied");
  expect_refused([&] { (void)solve_pose_graph(two, {{0, 1, {}, information(), true}}); }, "tied");
  expect_refused(
      [&] {
        (void)solve_pose_graph(two, {{0, 2, {}, information(), false}});
      },
      "relation 0", "pose 0 to 2");
  expect_refused(
      [&] {
        (void)solve_pose_graph(two, {tied, {1, 1, {}, information(), true}});
      },
      "relation 1");
  const Matrix<3, 3> negative = -information();
  expect_refused(
      [&] {
        (void)solve_pose_graph(two, {{0, 1, {}, negative, false}});
      },
      "semidefinite");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused(
      [&] {
        (void)solve_pose_graph(two, {{0, 1, {nan, 0.0, 0.0}, information(), false}});
      },
      "finite");
  expect_refused([&] { (void)solve_pose_graph({{}, {nan, 0.0, 0.0}}, {tied}); }, "finite");
  expect_refused([&] { (void)solve_pose_graph(two, {tied}, {0.0, 10}); }, "wrong_probability");
  expect_refused([&] { (void)solve_pose_graph(two, {tied}, {0.01, 0}); }, "max_iterations");
}

}  // namespace
}  // namespace locfuse
