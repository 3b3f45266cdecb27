// SPDX-License-Identifier: Apache-2.0
#include "smoothing/sparse_problem.hpp"

#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

#include "locfuse/error.hpp"
#include "smoothing/graph_covariance.hpp"

namespace locfuse::internal {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

MotionJacobians jacobians_at(const double* first, const double* second) {
  return motion_jacobians({first[0], first[1], first[2]}, {second[0], second[1], 0.0});
}

Vector<3> error_by(const MotionJacobians& by, double turned, const Pose2& motion) {
  // The last column of `by_first` is the motion, turned.
  return {-by.by_first(1, 2) - motion.x, by.by_first(0, 2) - motion.y,
          wrap_angle(turned - motion.heading)};
}

class MotionCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  MotionCost(const Pose2& motion, const Matrix<3, 3>& whiten) : motion_(motion), whiten_(whiten) {}

  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    const MotionJacobians by = jacobians_at(x[0], x[1]);
    Eigen::Map<Vector<3>> residual(residuals);
    residual = whiten_ * error_by(by, x[1][2] - x[0][2], motion_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<RowMajor3> jacobian(jacobians[0]);
      jacobian = whiten_ * by.by_first;
    }
    if (jacobians != nullptr && jacobians[1] != nullptr) {
      Eigen::Map<RowMajor3> jacobian(jacobians[1]);
      jacobian = whiten_ * by.by_second;
    }
    return true;
  }

 private:
  Pose2 motion_;
  Matrix<3, 3> whiten_;
};

}  // namespace

Vector<3> motion_error(const double* first, const double* second, const Pose2& motion) {
  return error_by(jacobians_at(first, second), second[2] - first[2], motion);
}

void add_motion(ceres::Problem& problem, const Pose2& motion, const Matrix<3, 3>& whiten,
                double* first, double* second) {
  problem.AddResidualBlock(new MotionCost(motion, whiten), nullptr, first, second);
}

SparseSolution solve_sparse(ceres::Problem& problem, int max_iterations, double tolerance,
                            const std::string& what) {
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
  return {summary.num_successful_steps + summary.num_unsuccessful_steps, summary.initial_cost,
          summary.final_cost, summary.termination_type == ceres::CONVERGENCE, summary.message};
}

}  // namespace locfuse::internal
