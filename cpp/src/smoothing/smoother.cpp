// SPDX-License-Identifier: Apache-2.0
#include "locfuse/smoothing/smoother.hpp"

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "estimators/recipe.hpp"
#include "locfuse/error.hpp"
#include "smoothing/chain_covariance.hpp"
#include "smoothing/pose_chain.hpp"

namespace locfuse {
namespace {

using internal::Measurement;
using internal::PoseChain;
using internal::RelativeMotion;
using Variables = std::array<double, 3>;  // x, y, heading, which is not wrapped
/// Id of what all sources of a kind have in common.
constexpr Id kEverySource = std::numeric_limits<Id>::min();

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Pose2 pose_of(const double* x) { return {x[0], x[1], wrap_angle(x[2])}; }

/// L^-1 of R = L L'.
Matrix<3, 3> whitening(const Matrix<3, 3>& R) {
  const Eigen::LLT<Matrix<3, 3>> factor(R);
  if (factor.info() != Eigen::Success) {
    throw NumericalError("the covariance of a motion or of the start is not positive definite");
  }
  return factor.matrixL().solve(Matrix<3, 3>::Identity());
}

/// Where the first pose is: docs/smoothing.md eq. (1).
class StartCost final : public ceres::SizedCostFunction<3, 3> {
 public:
  explicit StartCost(const PoseEstimate& start)
      : pose_(start.pose), whiten_(whitening(start.covariance)) {}

  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    Eigen::Map<Vector<3>> residual(residuals);
    residual = whiten_ * local(pose_of(x[0]), pose_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<RowMajor3> jacobian(jacobians[0]);
      jacobian = whiten_;
    }
    return true;
  }

 private:
  Pose2 pose_;
  Matrix<3, 3> whiten_;
};

/// How a pose lies to the one before: eq. (2).
class MotionCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit MotionCost(const RelativeMotion& motion)
      : motion_(motion.motion), whiten_(whitening(motion.covariance)) {}

  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    const double c = std::cos(x[0][2]);
    const double s = std::sin(x[0][2]);
    const Vector<2> d(x[1][0] - x[0][0], x[1][1] - x[0][1]);
    const Vector<2> moved(c * d.x() + s * d.y(), -s * d.x() + c * d.y());
    Eigen::Map<Vector<3>> residual(residuals);
    residual = whiten_ * Vector<3>(moved.x() - motion_.x, moved.y() - motion_.y,
                                   wrap_angle(x[1][2] - x[0][2] - motion_.heading));
    if (jacobians != nullptr) {
      Matrix<3, 3> turned;
      turned << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
      if (jacobians[0] != nullptr) {
        Matrix<3, 3> by_first = -turned;
        by_first(0, 2) = moved.y();
        by_first(1, 2) = -moved.x();
        Eigen::Map<RowMajor3> jacobian(jacobians[0]);
        jacobian = whiten_ * by_first;
      }
      if (jacobians[1] != nullptr) {
        Eigen::Map<RowMajor3> jacobian(jacobians[1]);
        jacobian = whiten_ * turned;
      }
    }
    return true;
  }

 private:
  Pose2 motion_;
  Matrix<3, 3> whiten_;
};

/// A measurement at a point: its whitened rows, eq. (3).
struct Whitened {
  Vector<3> residual = Vector<3>::Zero();
  Matrix<3, 3> by_pose = Matrix<3, 3>::Zero();
  Vector<3> by_offset = Vector<3>::Zero();
  int rows = 0;
};

Whitened whitened(const Measurement& z, const Pose2& pose, double offset) {
  Whitened found;
  const auto lin = z.linearize(pose);
  if (!lin) {
    return found;  // at this point it has no direction
  }
  const auto factor = lin->noise.llt();
  if (factor.info() != Eigen::Success) {
    throw NumericalError("the noise of a measurement is not positive definite");
  }
  found.rows = static_cast<int>(lin->residual.size());
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 3, 1> residual = lin->residual;
  if (z.offset >= 0) {
    residual(0) -= offset;
    found.by_offset(0) = -1.0 / std::sqrt(lin->noise(0, 0));
  }
  found.residual.head(found.rows) = factor.matrixL().solve(residual);
  found.by_pose.topRows(found.rows) = -factor.matrixL().solve(lin->jacobian);
  return found;
}

/// A measurement with a weight.
class MeasurementCost final : public ceres::CostFunction {
 public:
  MeasurementCost(const Measurement& z, int rows, double weight) : z_(z), root_(std::sqrt(weight)) {
    set_num_residuals(rows);
    mutable_parameter_block_sizes()->push_back(3);
    if (z.offset >= 0) {
      mutable_parameter_block_sizes()->push_back(1);
    }
  }

  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    const Whitened found = whitened(z_, pose_of(x[0]), z_.offset >= 0 ? x[1][0] : 0.0);
    const int rows = num_residuals();
    Eigen::Map<Eigen::VectorXd>(residuals, rows) = root_ * found.residual.head(rows);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(jacobians[0], rows, 3) =
          root_ * found.by_pose.topRows(rows);
    }
    if (jacobians != nullptr && z_.offset >= 0 && jacobians[1] != nullptr) {
      jacobians[1][0] = root_ * found.by_offset(0);
    }
    return true;
  }

 private:
  const Measurement& z_;
  double root_;
};

/// Minus twice the log likelihood of Student's noise, of a squared residual: eq. (4).
class StudentLoss final : public ceres::LossFunction {
 public:
  StudentLoss(double dof, int rows) : dof_(dof), power_(dof + rows) {}
  void Evaluate(double s, double rho[3]) const override {
    const double sum = dof_ + s;
    rho[0] = power_ * std::log1p(s / dof_);
    rho[1] = power_ / sum;
    rho[2] = -power_ / (sum * sum);
  }

 private:
  double dof_;
  double power_;
};

/// All poses and offsets, and what weighs on them.
class Batch {
 public:
  Batch(const SmootherConfig& config, const PoseEstimate& start, const PoseChain& chain)
      : config_(config),
        start_(start),
        chain_(chain),
        poses_(chain.stamps.size()),
        offsets_(chain.anchors.size(), 0.0),
        inside_(chain.measurements.size(), 1.0) {
    double heading = chain.guess.front().heading;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      heading += wrap_angle(chain.guess[i].heading - heading);
      poses_[i] = {chain.guess[i].x, chain.guess[i].y, heading};
    }
    const double sigma = config.estimator.calibration.sigma_anchor_offset_m;
    offset_information_ = offsets_.empty() ? 0.0 : 1.0 / (sigma * sigma);
  }

  /// Finds the poses by all measurements as they are weighed now.
  void solve(Smoothed& found, double tolerance = 1e-10) {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    ceres::Problem problem(options);
    problem.AddResidualBlock(new StartCost(start_), nullptr, poses_.front().data());
    for (std::size_t i = 0; i < chain_.motions.size(); ++i) {
      problem.AddResidualBlock(new MotionCost(chain_.motions[i]), nullptr, poses_[i].data(),
                               poses_[i + 1].data());
    }
    std::vector<std::unique_ptr<ceres::LossFunction>> losses;
    for (std::size_t k = 0; k < chain_.measurements.size(); ++k) {
      const Measurement& z = chain_.measurements[k];
      if (inside_[k] == 0.0) {
        continue;
      }
      ceres::LossFunction* loss = nullptr;
      const int rows = chain_.outcomes[z.message].dof;
      if (z.dof > 0.0) {
        losses.push_back(std::make_unique<StudentLoss>(z.dof, rows));
        loss = losses.back().get();
      }
      std::vector<double*> blocks{poses_[z.pose].data()};
      if (z.offset >= 0) {
        blocks.push_back(&offsets_[static_cast<std::size_t>(z.offset)]);
      }
      problem.AddResidualBlock(new MeasurementCost(z, rows, inside_[k]), loss, blocks);
    }
    for (double& offset : offsets_) {
      problem.AddResidualBlock(new OffsetCost(std::sqrt(offset_information_)), nullptr, &offset);
    }
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    solver.logging_type = ceres::SILENT;
    solver.num_threads = 1;
    solver.max_num_iterations = config_.max_iterations;
    solver.function_tolerance = tolerance;
    solver.parameter_tolerance = 1e-10;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (!summary.IsSolutionUsable()) {
      throw NumericalError("the smoother has no solution: " + summary.message);
    }
    if (found.iterations == 0) {
      found.initial_cost = summary.initial_cost;
    }
    found.iterations += summary.num_successful_steps + summary.num_unsuccessful_steps;
    found.cost = summary.final_cost;
    found.converged = summary.termination_type == ceres::CONVERGENCE;
    found.termination = summary.message;
  }

  /// Squared residual of a measurement in sigmas of its noise.
  [[nodiscard]] double squared(std::size_t k) const { return at(k).residual.squaredNorm(); }

  /// Truncated least squares by graduated non-convexity (Yang et al., 2020): from a problem without
  /// local minima to the one in which what is beyond its gate has no weight; eq. (4).
  void reject(Smoothed& found) {
    constexpr double kGrowth = 4.0;
    const std::size_t count = chain_.measurements.size();
    double worst = 0.0;
    for (std::size_t k = 0; k < count; ++k) {
      if (is_gated(k)) {
        worst = std::max(worst, squared(k) / chain_.measurements[k].limit);
      }
    }
    if (worst <= 1.0) {
      return;
    }
    double mu = 1.0 / std::max(2.0 * worst - 1.0, 1.0);
    for (int round = 0; round < 60; ++round) {
      bool decided = true;
      for (std::size_t k = 0; k < count; ++k) {
        if (!is_gated(k)) {
          continue;
        }
        const double share = squared(k) / chain_.measurements[k].limit;
        if (share <= mu / (mu + 1.0)) {
          inside_[k] = 1.0;
        } else if (share >= (mu + 1.0) / mu) {
          inside_[k] = 0.0;
        } else {
          inside_[k] = std::sqrt(mu * (mu + 1.0) / share) - mu;
          decided = decided && (inside_[k] < 1e-3 || inside_[k] > 1.0 - 1e-3);
        }
      }
      solve(found, 1e-4);
      if (decided && mu >= 1.0) {
        break;
      }
      mu *= kGrowth;
    }
    // Every verdict agrees with its limit in the end, if there is an end.
    for (int round = 0; round < 10; ++round) {
      std::vector<double> decided = inside_;
      for (std::size_t k = 0; k < count; ++k) {
        decided[k] = !is_gated(k) || squared(k) <= chain_.measurements[k].limit ? 1.0 : 0.0;
      }
      if (round > 0 && decided == inside_) {
        break;
      }
      inside_ = std::move(decided);
      solve(found);
    }
  }

  void report(Smoothed& found) const {
    std::vector<double> seconds;
    seconds.reserve(poses_.size());
    for (const Stamp stamp : chain_.stamps) {
      seconds.push_back(seconds_between(chain_.stamps.front(), stamp));
    }
    internal::ChainInformation information(std::move(seconds), offsets_.size());
    add_information(information);
    const internal::ChainCovariance covariance = information.covariance();
    found.poses.reserve(poses_.size());
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      found.poses.push_back({chain_.stamps[i], pose_of(poses_[i].data()), covariance.poses[i]});
    }
    for (std::size_t a = 0; a < offsets_.size(); ++a) {
      const auto place = static_cast<Eigen::Index>(a);
      found.errors.push_back({"anchor_offset_m", chain_.anchors[a], offsets_[a],
                              std::sqrt(covariance.globals(place, place)),
                              config_.estimator.calibration.sigma_anchor_offset_m});
    }
    found.outcomes = chain_.outcomes;
    for (std::size_t k = 0; k < chain_.measurements.size(); ++k) {
      const Measurement& z = chain_.measurements[k];
      Outcome& outcome = found.outcomes[z.message];
      const auto lin = z.linearize(pose_of(poses_[z.pose].data()));
      outcome.nis = squared(k);
      outcome.residual = lin ? lin->residual(0) - offset_of(z) : outcome.residual;
      outcome.verdict = inside_[k] > 0.0 ? Verdict::kFused : Verdict::kGated;
      outcome.reason = inside_[k] > 0.0 ? Reason::kNone : Reason::kUnlikely;
    }
  }

 private:
  /// That an offset is about 0.
  class OffsetCost final : public ceres::SizedCostFunction<1, 1> {
   public:
    explicit OffsetCost(double root_information) : root_(root_information) {}
    bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
      residuals[0] = root_ * x[0][0];
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        jacobians[0][0] = root_;
      }
      return true;
    }

   private:
    double root_;
  };

  [[nodiscard]] bool is_gated(std::size_t k) const {
    return chain_.measurements[k].dof == 0.0 && std::isfinite(chain_.measurements[k].limit);
  }
  [[nodiscard]] double offset_of(const Measurement& z) const {
    return z.offset >= 0 ? offsets_[static_cast<std::size_t>(z.offset)] : 0.0;
  }
  [[nodiscard]] Whitened at(std::size_t k) const {
    const Measurement& z = chain_.measurements[k];
    return whitened(z, pose_of(poses_[z.pose].data()), offset_of(z));
  }

  void add_information(internal::ChainInformation& information) const {
    const auto evaluate = [&](const ceres::CostFunction& cost, std::size_t pose, bool is_pair) {
      std::array<const double*, 2> x{poses_[pose].data(),
                                     is_pair ? poses_[pose + 1].data() : nullptr};
      Vector<3> residual;
      std::array<RowMajor3, 2> by;
      std::array<double*, 2> jacobians{by[0].data(), is_pair ? by[1].data() : nullptr};
      cost.Evaluate(x.data(), residual.data(), jacobians.data());
      information.add(pose, by[0].transpose() * by[0]);
      if (is_pair) {
        information.add(pose + 1, by[1].transpose() * by[1]);
        information.add_next(pose, by[0].transpose() * by[1]);
      }
    };
    evaluate(StartCost(start_), 0, false);
    for (std::size_t i = 0; i < chain_.motions.size(); ++i) {
      evaluate(MotionCost(chain_.motions[i]), i, true);
    }
    const PoseEkf::Config& estimator = config_.estimator;
    std::map<std::tuple<Source, Id, int>, int> learnt;  // errors that last, by source and row
    std::map<Id, int> wandering;                        // offsets of anchors
    const auto share = [&](auto& processes, const auto& key, double variance, double lasts_s) {
      if (!(variance > 0.0)) {
        return internal::MeasuredRow::Lasting{};
      }
      auto found = processes.find(key);
      if (found == processes.end()) {
        found = processes.emplace(key, information.add_process(lasts_s)).first;
      }
      return internal::MeasuredRow::Lasting{found->second, std::sqrt(variance)};
    };
    for (std::size_t k = 0; k < chain_.measurements.size(); ++k) {
      const Measurement& z = chain_.measurements[k];
      double weight = inside_[k];
      if (weight == 0.0) {
        continue;
      }
      const Whitened found = at(k);
      if (z.dof > 0.0) {
        std::array<double, 3> rho{};
        StudentLoss(z.dof, found.rows).Evaluate(found.residual.squaredNorm(), rho.data());
        weight = rho[1] * (z.dof + found.rows) / (z.dof + found.rows + 2.0);  // eq. (5)
      }
      const internal::LastingErrors& errors = chain_.lasting[static_cast<std::size_t>(z.source)];
      const double root = std::sqrt(weight);
      for (int row = 0; row < found.rows; ++row) {
        // R is what was stated and what wanders: the filter has learnt of the first alone.
        const double stated = errors.factor * (1.0 - z.wanders);
        internal::MeasuredRow measured{z.pose, root * found.by_pose.row(row).transpose(), z.offset,
                                       root * found.by_offset(row), stated + z.wanders};
        measured.lasting = {
            share(learnt, std::tuple(z.source, z.id, row), stated * (errors.share - errors.common),
                  estimator.correlation_s),
            share(learnt, std::tuple(z.source, kEverySource, row), stated * errors.common,
                  estimator.correlation_s),
            share(wandering, z.id, z.wanders, estimator.calibration.anchor_offset_correlation_s)};
        information.add(measured);
      }
    }
    for (std::size_t a = 0; a < offsets_.size(); ++a) {
      information.add_global(a, offset_information_);
    }
  }

  const SmootherConfig& config_;
  const PoseEstimate& start_;
  const PoseChain& chain_;
  std::vector<Variables> poses_;
  std::vector<double> offsets_;
  double offset_information_ = 0.0;
  std::vector<double> inside_;  // their weights: 0 is an outlier
};

void check(const SmootherConfig& config) {
  if (config.max_iterations < 1) {
    throw std::invalid_argument("max_iterations is " + std::to_string(config.max_iterations) +
                                ", expected at least 1");
  }
  const Calibration::Config& given = config.estimator.calibration;
  for (const double other :
       {given.sigma_scale, given.sigma_direction_rad, given.sigma_turn_scale,
        given.sigma_turn_bias_radps, given.sigma_sensor_m, given.sigma_sensor_rad,
        given.sigma_range_offset_m, given.sigma_range_scale, given.sigma_delay_s,
        given.sigma_anchor_scale, given.sigma_range_delay_s, config.estimator.adaptive.messages}) {
    if (other != 0.0) {
      throw std::invalid_argument(
          "the smoother learns sigma_anchor_offset_m alone of calibration, and no adaptive noise; "
          "set the others to 0");
    }
  }
}

}  // namespace

Smoothed smooth(const SmootherConfig& config, const World& world, const PoseEstimate& start,
                const std::vector<Message>& messages) {
  check(config);
  const PoseChain chain = internal::make_pose_chain(config, world, start, messages);
  Batch batch(config, start, chain);
  Smoothed found;
  batch.solve(found);
  batch.reject(found);
  batch.report(found);
  return found;
}

}  // namespace locfuse
