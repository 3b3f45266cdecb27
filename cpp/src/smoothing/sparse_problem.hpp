// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locfuse/geometry/pose2.hpp"

namespace ceres {
class Problem;
}  // namespace ceres

namespace locfuse::internal {

/// Pose of a solver's variables: x, y, and a heading that is not wrapped.
[[nodiscard]] inline Pose2 pose_of(const double* x) { return {x[0], x[1], wrap_angle(x[2])}; }

/// How a pose lies to another, less the `motion` that was measured, in the axes of the first pose:
/// docs/smoothing.md eq. (2).
[[nodiscard]] Vector<3> motion_error(const double* first, const double* second,
                                     const Pose2& motion);

/// Adds a motion between two poses; `whiten` takes its errors to sigmas.
void add_motion(ceres::Problem& problem, const Pose2& motion, const Matrix<3, 3>& whiten,
                double* first, double* second);

/// How a problem was solved.
struct SparseSolution {
  int iterations = 0;
  double initial_cost = 0.0;
  double cost = 0.0;
  bool converged = false;
  std::string termination;
};

/// Solves a sparse problem of least squares, on one thread, so that results repeat to the bit.
/// Throws NumericalError, which names `what`, where there is no solution.
[[nodiscard]] SparseSolution solve_sparse(ceres::Problem& problem, int max_iterations,
                                          double tolerance, const std::string& what);

/// Notes a solution in what is returned to the user.
template <class Found>
void note_solution(const SparseSolution& solution, Found& found) {
  found.iterations += solution.iterations;
  found.cost = solution.cost;
  found.converged = solution.converged;
  found.termination = solution.termination;
}

}  // namespace locfuse::internal
