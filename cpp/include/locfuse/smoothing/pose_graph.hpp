// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "locfuse/geometry/pose2.hpp"

namespace locfuse {

/// How one pose of a graph lies to another.
struct PoseRelation {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose2 motion;  ///< T_from_to
  /// Of the errors of (x, y, heading) of `motion`, in the axes of `from`; zero along what is not
  /// known, as along a corridor.
  Matrix<3, 3> information = Matrix<3, 3>::Zero();
  bool may_be_wrong = false;  ///< as a loop may, of which no other relation depends
};

struct PoseGraphConfig {
  /// Probability that a right relation is rejected.
  double wrong_probability = 1e-3;
  int max_iterations = 100;  ///< of the solver, each time it is called
};

struct SolvedPoseGraph {
  std::vector<Pose2> poses;  ///< the first one stays
  std::vector<bool> kept;    ///< of each relation whether it is not rejected
  double cost = 0.0;         ///< half the sum of squared errors in sigmas of those that are kept
  int iterations = 0;
  bool converged = false;
  std::string termination;  ///< what the solver said last
};

/// Finds the likeliest poses of a graph from a guess, and which relations are wrong by graduated
/// non-convexity; docs/smoothing.md eq. (2) and (4).
///
/// Throws std::invalid_argument where a relation or pose is not valid, or the relations that cannot
/// be wrong do not connect all poses; NumericalError where the solver fails.
[[nodiscard]] SolvedPoseGraph solve_pose_graph(const std::vector<Pose2>& guess,
                                               const std::vector<PoseRelation>& relations,
                                               const PoseGraphConfig& config = {});

}  // namespace locfuse
