// SPDX-License-Identifier: Apache-2.0
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "locfuse/frontends/range_fit.hpp"

namespace locfuse {

namespace {

// Squared residual beside the scale of the one-sided loss below which rho is its square.
constexpr double kMinShare = 1e-12;

/// Residual (h(x) - r) / sigma. The one-sided loss depends on the sign, which ceres::LossFunction
/// does not get: residuals of ranges that are too long are themselves mapped to sqrt(rho).
template <int N>
class RangeResidual final : public ceres::SizedCostFunction<1, N> {
 public:
  RangeResidual(const RangeLayout<N>& layout, const RangesView& ranges, int i,
                double one_sided_scale)
      : anchor_(layout.offset(i)),
        height_squared_(layout.height_squared[static_cast<std::size_t>(i)]),
        range_(ranges[i]),
        root_information_(1.0 / layout.sigma[static_cast<std::size_t>(i)]),
        one_sided_scale_(one_sided_scale) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Vector<N> d = Eigen::Map<const Vector<N>>(parameters[0]) - anchor_;
    const double h = std::sqrt(d.squaredNorm() + height_squared_);
    double z = root_information_ * (h - range_);
    double slope = root_information_;
    if (one_sided_scale_ > 0.0 && z < 0.0) {
      const double share = z * z / (one_sided_scale_ * one_sided_scale_);
      const double bent = share < kMinShare ? z : -one_sided_scale_ * std::sqrt(std::log1p(share));
      slope *= z / bent / (1.0 + share);
      z = bent;
    }
    residuals[0] = z;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Vector<N>> jacobian(jacobians[0]);
      jacobian = (h > 0.0 ? slope / h : 0.0) * d;
    }
    return true;
  }

 private:
  Vector<N> anchor_;
  double height_squared_;
  double range_;
  double root_information_;
  double one_sided_scale_;
};

/// (x_k - mean_k) / sigma_k.
template <int N>
class PriorResidual final : public ceres::SizedCostFunction<N, N> {
 public:
  explicit PriorResidual(const PositionPrior<N>& prior)
      : mean_(prior.mean), root_information_(prior.information.cwiseSqrt()) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Vector<N> x = Eigen::Map<const Vector<N>>(parameters[0]);
    Eigen::Map<Vector<N>> residual(residuals);
    residual = root_information_.cwiseProduct(x - mean_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, N, N, Eigen::RowMajor>> jacobian(jacobians[0]);
      jacobian = root_information_.asDiagonal();
    }
    return true;
  }

 private:
  Vector<N> mean_;
  Vector<N> root_information_;
};

std::unique_ptr<ceres::LossFunction> loss_function(const RangeLoss& loss) {
  if (loss.kind == RangeLossKind::kHuber) {
    return std::make_unique<ceres::HuberLoss>(loss.effective_scale());
  }
  if (loss.kind == RangeLossKind::kCauchy) {
    return std::make_unique<ceres::CauchyLoss>(loss.effective_scale());
  }
  return nullptr;
}

ceres::Problem::Options problem_options() {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  return options;
}

ceres::Solver::Options solver_options(const CeresOptions& options) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.gradient_tolerance = options.gradient_tolerance;
  solver.parameter_tolerance = options.parameter_tolerance;
  return solver;
}

/// J' W R^-1 J at the solution, without a second problem.
template <int N>
Matrix<N, N> information_at(const RangeLayout<N>& layout, const RangesView& ranges,
                            const RangeLoss& loss, const PositionPrior<N>& prior,
                            const Vector<N>& x) {
  Matrix<N, N> information = prior.information.asDiagonal();
  for (int i = 0; i < layout.size; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const Vector<N> d = x - layout.offset(i);
    const double squared = d.squaredNorm() + layout.height_squared[slot];
    const double z = (ranges[i] - std::sqrt(squared)) / layout.sigma[slot];
    const double weight = loss.weight(z) * layout.information[slot];
    information += (squared > 0.0 ? weight / squared : 0.0) * d * d.transpose();
  }
  return information;
}

}  // namespace

template <int N>
RangeFit<N> fit_ranges_ceres(const RangeLayout<N>& layout, const RangesView& ranges,
                             const Vector<N>& start, const RangeLoss& loss,
                             const PositionPrior<N>& prior, const CeresOptions& options,
                             std::string* termination) {
  const double one_sided = loss.kind == RangeLossKind::kOneSided ? loss.effective_scale() : 0.0;
  const std::unique_ptr<ceres::LossFunction> robust = loss_function(loss);
  const PriorResidual<N> from_prior(prior);
  std::array<std::optional<RangeResidual<N>>, kMaxRanges> residuals;
  RangeFit<N> fit;
  fit.position = start;
  ceres::Problem problem(problem_options());
  for (int i = 0; i < layout.size; ++i) {
    auto& residual = residuals[static_cast<std::size_t>(i)];
    residual.emplace(layout, ranges, i, one_sided);
    problem.AddResidualBlock(&*residual, robust.get(), fit.position.data());
  }
  if (!prior.information.isZero(0.0)) {
    problem.AddResidualBlock(const_cast<PriorResidual<N>*>(&from_prior), nullptr,
                             fit.position.data());
  }
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(options), &problem, &summary);
  // Where Ceres failed before its first step, its cost is undefined.
  fit.cost = summary.termination_type == ceres::FAILURE ? std::numeric_limits<double>::quiet_NaN()
                                                        : 2.0 * summary.final_cost;
  fit.iterations = std::max(0, summary.num_successful_steps + summary.num_unsuccessful_steps);
  fit.converged = summary.termination_type == ceres::CONVERGENCE;
  fit.information = information_at<N>(layout, ranges, loss, prior, fit.position);
  if (termination != nullptr) {
    *termination = summary.message;
  }
  return fit;
}

#define LOCFUSE_INSTANTIATE(N)                                                      \
  template RangeFit<N> fit_ranges_ceres<N>(                                         \
      const RangeLayout<N>&, const RangesView&, const Vector<N>&, const RangeLoss&, \
      const PositionPrior<N>&, const CeresOptions&, std::string*);
LOCFUSE_INSTANTIATE(2)
LOCFUSE_INSTANTIATE(3)
#undef LOCFUSE_INSTANTIATE

}  // namespace locfuse
