// SPDX-License-Identifier: Apache-2.0
#include "locfuse/smoothing/smoother.hpp"

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>

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
#include "smoothing/graph_covariance.hpp"
#include "smoothing/pose_chain.hpp"
#include "smoothing/rejection.hpp"
#include "smoothing/sparse_problem.hpp"

namespace locfuse {
namespace {

using internal::Measurement;
using internal::pose_of;
using internal::PoseChain;
using internal::RelativeMotion;
using Variables = std::array<double, 3>;  // x, y, heading, which is not wrapped
/// Id of what all sources of a kind have in common.
constexpr Id kEverySource = std::numeric_limits<Id>::min();

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
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> jacobian(jacobians[0]);
      jacobian = whiten_;
    }
    return true;
  }

 private:
  Pose2 pose_;
  Matrix<3, 3> whiten_;
};

/// A measurement at a point: its whitened rows, eq. (3).
struct Whitened {
  Vector<3> residual = Vector<3>::Zero();
  Matrix<3, 3> by_pose = Matrix<3, 3>::Zero();
  Matrix<3, internal::kMaxShared> by_shared = Matrix<3, internal::kMaxShared>::Zero();
  int rows = 0;
};

Whitened whitened(const Measurement& z, const Pose2& pose, const Measurement::Values& values) {
  Whitened found;
  const auto measured = z.linearize(pose, values);
  if (!measured) {
    return found;  // at this point it has no direction
  }
  const auto& lin = measured->by_pose;
  if (lin.residual.size() == 1 && lin.noise(0, 0) > 0.0) {  // of ranges, which are most
    const double inverse = 1.0 / std::sqrt(lin.noise(0, 0));
    found.rows = 1;
    found.residual(0) = inverse * lin.residual(0);
    found.by_pose.row(0) = -inverse * lin.jacobian.row(0);
    if (z.shared[0] >= 0) {
      found.by_shared.row(0) = -inverse * measured->by_shared.row(0);
    }
    return found;
  }
  const auto factor = lin.noise.llt();
  if (factor.info() != Eigen::Success) {
    throw NumericalError("the noise of a measurement is not positive definite");
  }
  found.rows = static_cast<int>(lin.residual.size());
  found.residual.head(found.rows) = factor.matrixL().solve(lin.residual);
  found.by_pose.topRows(found.rows) = -factor.matrixL().solve(lin.jacobian);
  if (z.shared[0] >= 0) {
    found.by_shared.topRows(found.rows) = -factor.matrixL().solve(measured->by_shared);
  }
  return found;
}

/// A measurement with a weight.
class MeasurementCost final : public ceres::CostFunction {
 public:
  MeasurementCost(const Measurement& z, int rows, double weight) : z_(z), root_(std::sqrt(weight)) {
    set_num_residuals(rows);
    mutable_parameter_block_sizes()->push_back(3);
    for (; shared_ < z.shared.size() && z.shared[shared_] >= 0; ++shared_) {
      mutable_parameter_block_sizes()->push_back(1);
    }
  }

  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    Measurement::Values values{};
    for (std::size_t i = 0; i < shared_; ++i) {
      values[i] = x[i + 1][0];
    }
    const Whitened found = whitened(z_, pose_of(x[0]), values);
    const int rows = num_residuals();
    Eigen::Map<Eigen::VectorXd>(residuals, rows) = root_ * found.residual.head(rows);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(jacobians[0], rows, 3) =
          root_ * found.by_pose.topRows(rows);
    }
    for (std::size_t i = 0; jacobians != nullptr && i < shared_; ++i) {
      if (jacobians[i + 1] != nullptr) {
        Eigen::Map<Eigen::VectorXd>(jacobians[i + 1], rows) =
            root_ * found.by_shared.col(static_cast<Eigen::Index>(i)).head(rows);
      }
    }
    return true;
  }

 private:
  const Measurement& z_;
  std::size_t shared_ = 0;
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

/// What is known of a shared variable before anything is measured.
class PriorCost final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit PriorCost(const internal::SharedVariable& variable)
      : mean_(variable.mean), root_(1.0 / variable.sigma) {}
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    residuals[0] = root_ * (x[0][0] - mean_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      jacobians[0][0] = root_;
    }
    return true;
  }

 private:
  double mean_;
  double root_;
};

/// All poses and what they share, and what weighs on them.
class Batch {
 public:
  Batch(const SmootherConfig& config, const World& world, const PoseEstimate& start,
        const PoseChain& chain)
      : config_(config),
        world_(world),
        start_(start),
        chain_(chain),
        poses_(chain.stamps.size()),
        shared_(chain.shared.size()),
        inside_(chain.measurements.size(), 1.0) {
    begin();
  }

  /// Goes to the first guess, of which nothing is rejected.
  void begin() {
    double heading = chain_.guess.front().heading;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      heading += wrap_angle(chain_.guess[i].heading - heading);
      poses_[i] = {chain_.guess[i].x, chain_.guess[i].y, heading};
    }
    std::transform(chain_.shared.begin(), chain_.shared.end(), shared_.begin(),
                   [](const internal::SharedVariable& one) { return one.guess; });
    std::fill(inside_.begin(), inside_.end(), 1.0);
  }

  /// Finds the poses by all measurements as they are weighed now.
  void solve(Smoothed& found, double tolerance = 1e-10, bool heavy_tailed = false) {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    ceres::Problem problem(options);
    problem.AddResidualBlock(new StartCost(start_), nullptr, poses_.front().data());
    for (std::size_t i = 0; i < chain_.motions.size(); ++i) {
      const RelativeMotion& motion = chain_.motions[i];
      internal::add_motion(problem, motion.motion, whitening(motion.covariance), poses_[i].data(),
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
      if (z.dof > 0.0 || (heavy_tailed && is_gated(k))) {
        losses.push_back(std::make_unique<StudentLoss>(std::max(z.dof, 1.0), rows));
        loss = losses.back().get();
      }
      std::vector<double*> blocks{poses_[z.pose].data()};
      for (std::size_t i = 0; i < z.shared.size() && z.shared[i] >= 0; ++i) {
        blocks.push_back(&shared_[static_cast<std::size_t>(z.shared[i])]);
      }
      problem.AddResidualBlock(new MeasurementCost(z, rows, inside_[k]), loss, blocks);
    }
    for (std::size_t i = 0; i < shared_.size(); ++i) {
      problem.AddResidualBlock(new PriorCost(chain_.shared[i]), nullptr, &shared_[i]);
    }
    const internal::SparseSolution solution =
        internal::solve_sparse(problem, config_.max_iterations, tolerance, "the smoother");
    if (found.iterations == 0) {
      found.initial_cost = solution.initial_cost;
    }
    internal::note_solution(solution, found);
  }

  /// Squared residual of a measurement in sigmas of its noise.
  [[nodiscard]] double squared(std::size_t k) const { return at(k).residual.squaredNorm(); }

  /// What is beyond its gate loses its weight, little by little; eq. (4).
  void reject(Smoothed& found) {
    std::size_t solved = 0;
    internal::reject_gradually(
        inside_, [&](std::size_t k) { return is_gated(k); },
        [&](std::size_t k) { return squared(k) / chain_.measurements[k].limit; },
        [&] {
          solve(found, 1e-4);
          ++solved;
        });
    if (solved > 0) {
      decide(found);
    }
  }

  /// Where many are rejected, what they say together may have misled the start: another one from
  /// the first guess with heavy tails is taken if its sum is less.
  void reconsider(Smoothed& found) {
    constexpr double kMany = 0.005;
    const auto rejected = std::count(inside_.begin(), inside_.end(), 0.0);
    if (static_cast<double>(rejected) <= kMany * static_cast<double>(inside_.size())) {
      return;
    }
    const Batch first = *this;
    const Smoothed found_first = found;
    bool is_solved = true;
    try {
      begin();
      solve(found, 1e-6, true);
      decide(found);
    } catch (const NumericalError&) {
      is_solved = false;
    }
    if (!is_solved || total(found_first, first.inside_) <= total(found, inside_)) {
      poses_ = first.poses_;
      shared_ = first.shared_;
      inside_ = first.inside_;
      const int iterations = found.iterations;
      found = found_first;
      found.iterations = iterations;
    }
  }

  /// Every verdict agrees with its limit in the end, if there is an end.
  void decide(Smoothed& found) {
    const std::size_t count = chain_.measurements.size();
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
    internal::ChainInformation information(std::move(seconds), shared_.size());
    add_information(information);
    const internal::ChainCovariance covariance = information.covariance();
    found.poses.reserve(poses_.size());
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      found.poses.push_back({chain_.stamps[i], pose_of(poses_[i].data()), covariance.poses[i]});
    }
    report_shared(covariance.globals, found);
    found.outcomes = chain_.outcomes;
    for (std::size_t k = 0; k < chain_.measurements.size(); ++k) {
      const Measurement& z = chain_.measurements[k];
      Outcome& outcome = found.outcomes[z.message];
      const auto rows = z.linearize(pose_of(poses_[z.pose].data()), values_of(z));
      outcome.nis = squared(k);
      outcome.residual = rows ? rows->by_pose.residual(0) : outcome.residual;
      outcome.verdict = inside_[k] > 0.0 ? Verdict::kFused : Verdict::kGated;
      outcome.reason = inside_[k] > 0.0 ? Reason::kNone : Reason::kUnlikely;
    }
    found.cost = total(found, inside_);
  }

 private:
  /// Places and errors of radios, and places of landmarks.
  void report_shared(const Eigen::MatrixXd& covariance, Smoothed& found) const {
    const World& world = world_;
    const Calibration::Config& errors = config_.estimator.calibration;
    found.anchors = internal::anchors_of(world)->anchors();
    found.landmarks = internal::landmarks_of(world)->landmarks();
    found.tags = world.tags;
    std::vector<int> columns;  // shared variables of the coordinates, or -1
    const auto read = [&](int variable, double& into) {
      if (variable >= 0) {
        into = shared_[static_cast<std::size_t>(variable)];
      }
    };
    std::vector<double> slopes;  // of the coordinates by their variables
    const auto place = [&](const internal::SharedPlaces& variables, Eigen::Index axes, auto& into) {
      for (Eigen::Index axis = 0; axis < axes; ++axis) {
        const int variable = variables[static_cast<std::size_t>(axis)];
        columns.push_back(variable);
        slopes.push_back(1.0);
        read(variable, into(axis));
        if (variable >= 0 && chain_.shared[static_cast<std::size_t>(variable)].is_climb) {
          // Near 0 a square root has no slope: its error is that of the root of a sigma there.
          const double sigma = std::sqrt(covariance(variable, variable));
          slopes.back() = 0.5 / std::sqrt(std::max(into(axis), sigma));
          into(axis) = world.tags.front().position.z() + std::sqrt(std::max(into(axis), 0.0));
        }
      }
    };
    for (std::size_t i = 0; i < found.anchors.size(); ++i) {
      Anchor& anchor = found.anchors[i];
      const internal::SharedPlaces& radio = chain_.radios[i];
      place(radio, 3, anchor.position);
      const auto learn = [&](const char* name, int variable, double sigma_start) {
        if (variable >= 0) {
          const double variance = covariance(variable, variable);
          found.errors.push_back({name, anchor.id, shared_[static_cast<std::size_t>(variable)],
                                  std::sqrt(variance), sigma_start});
          return found.errors.back().value;
        }
        return 0.0;
      };
      anchor.offset +=
          learn("anchor_offset_m", radio[internal::kOffset], errors.sigma_anchor_offset_m);
      anchor.scale += learn("anchor_scale", radio[internal::kScale], errors.sigma_anchor_scale);
    }
    for (std::size_t i = 0; i < found.landmarks.size(); ++i) {
      place(chain_.landmarks[i], 2, found.landmarks[i].position);
    }
    for (std::size_t i = 0; i < found.tags.size(); ++i) {
      place(chain_.tags[i], 2, found.tags[i].position);
    }
    const auto size = static_cast<Eigen::Index>(columns.size());
    found.places_covariance = Eigen::MatrixXd::Zero(size, size);
    for (Eigen::Index i = 0; i < size; ++i) {
      for (Eigen::Index j = 0; j < size; ++j) {
        const int a = columns[static_cast<std::size_t>(i)];
        const int b = columns[static_cast<std::size_t>(j)];
        const double slope =
            slopes[static_cast<std::size_t>(i)] * slopes[static_cast<std::size_t>(j)];
        found.places_covariance(i, j) = a >= 0 && b >= 0 ? slope * covariance(a, b) : 0.0;
      }
    }
  }

  /// The cost with that of each outlier at its limit.
  [[nodiscard]] double total(const Smoothed& found, const std::vector<double>& inside) const {
    double sum = found.cost;
    for (std::size_t k = 0; k < inside.size(); ++k) {
      sum += inside[k] > 0.0 ? 0.0 : 0.5 * chain_.measurements[k].limit;
    }
    return sum;
  }
  [[nodiscard]] bool is_gated(std::size_t k) const {
    return chain_.measurements[k].dof == 0.0 && std::isfinite(chain_.measurements[k].limit);
  }
  [[nodiscard]] Measurement::Values values_of(const Measurement& z) const {
    Measurement::Values values{};
    for (std::size_t i = 0; i < z.shared.size() && z.shared[i] >= 0; ++i) {
      values[i] = shared_[static_cast<std::size_t>(z.shared[i])];
    }
    return values;
  }
  [[nodiscard]] Whitened at(std::size_t k) const {
    const Measurement& z = chain_.measurements[k];
    return whitened(z, pose_of(poses_[z.pose].data()), values_of(z));
  }

  void add_information(internal::ChainInformation& information) const {
    const Matrix<3, 3> of_start = whitening(start_.covariance);
    information.add(0, of_start.transpose() * of_start);
    for (std::size_t i = 0; i < chain_.motions.size(); ++i) {
      const auto by =
          internal::motion_jacobians(pose_of(poses_[i].data()), pose_of(poses_[i + 1].data()));
      const Matrix<3, 3> whiten = whitening(chain_.motions[i].covariance);
      const Matrix<3, 3> by_first = whiten * by.by_first;
      const Matrix<3, 3> by_second = whiten * by.by_second;
      information.add(i, by_first.transpose() * by_first);
      information.add(i + 1, by_second.transpose() * by_second);
      information.add_next(i, by_first.transpose() * by_second);
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
        internal::MeasuredRow measured{z.pose, root * found.by_pose.row(row).transpose(), z.shared};
        for (std::size_t i = 0; i < z.shared.size() && z.shared[i] >= 0; ++i) {
          measured.by_shared[i] = root * found.by_shared(row, static_cast<Eigen::Index>(i));
        }
        measured.variance = stated + z.wanders;
        measured.lasting = {
            share(learnt, std::tuple(z.source, z.id, row), stated * (errors.share - errors.common),
                  estimator.correlation_s),
            share(learnt, std::tuple(z.source, kEverySource, row), stated * errors.common,
                  estimator.correlation_s),
            share(wandering, z.id, z.wanders, estimator.calibration.anchor_offset_correlation_s)};
        information.add(measured);
      }
    }
    for (std::size_t i = 0; i < shared_.size(); ++i) {
      information.add_global(i, 1.0 / (chain_.shared[i].sigma * chain_.shared[i].sigma));
    }
  }

  const SmootherConfig& config_;
  const World& world_;
  const PoseEstimate& start_;
  const PoseChain& chain_;
  std::vector<Variables> poses_;
  std::vector<double> shared_;
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
        given.sigma_range_delay_s, config.estimator.adaptive.messages}) {
    if (other != 0.0) {
      throw std::invalid_argument(
          "the smoother learns sigma_anchor_offset_m and sigma_anchor_scale alone of calibration, "
          "and no adaptive noise; set the others to 0");
    }
  }
}

}  // namespace

Smoothed smooth(const SmootherConfig& config, const World& world, const PoseEstimate& start,
                const std::vector<Message>& messages) {
  check(config);
  const PoseChain chain = internal::make_pose_chain(config, world, start, messages);
  Batch batch(config, world, start, chain);
  Smoothed found;
  batch.solve(found);
  batch.reject(found);
  batch.reconsider(found);
  batch.report(found);
  return found;
}

}  // namespace locfuse
