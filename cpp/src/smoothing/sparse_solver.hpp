// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/problem.h>
#include <ceres/solver.h>

#include <string>

#include "locfuse/error.hpp"

namespace locfuse::internal {

/// Solves a sparse problem of least squares, on one thread, so that results repeat to the bit, and
/// notes how in `found`. Throws NumericalError, which names `what`, where there is no solution.
template <class Found>
ceres::Solver::Summary solve_sparse(ceres::Problem& problem, int max_iterations, double tolerance,
                                    const std::string& what, Found& found) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  solver.max_num_iterations = max_iterations;
  solver.function_tolerance = tolerance;
  solver.parameter_tolerance = 1e-10;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) {
    throw NumericalError(what + " has no solution: " + summary.message);
  }
  found.iterations += summary.num_successful_steps + summary.num_unsuccessful_steps;
  found.cost = summary.final_cost;
  found.converged = summary.termination_type == ceres::CONVERGENCE;
  found.termination = summary.message;
  return summary;
}

}  // namespace locfuse::internal
