// SPDX-License-Identifier: Apache-2.0
// The proposal of FastSLAM 2.0: draws particles from odometry and a scan match together.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "locfuse/particles/mcl_particle_filter.hpp"

namespace locfuse::internal {
namespace {

/// Where a particle that odometry alone moves to m is drawn, in cells:
/// N(m + gain (match - m) + shift, L L'); eq. (2.4) of docs/models/particles.md.
struct Proposal {
  Pose2 match;
  Matrix<3, 3> gain;
  Vector<3> shift;
  Matrix<3, 3> L;
  Matrix<3, 3> precision;  // of odometry alone
};

}  // namespace

bool ParticleFilter::propagate_by_match(const LaserScan& z, double sigma_hit, RandomKeys& keys) {
  const MclConfig& config = recipe_->config;
  const PoseEstimate& before = best().estimate;
  const PoseEstimate prior = predicted(before);
  const ScanMatch match = recipe_->matcher->refine(z, prior.pose, prior.covariance);
  Matrix<3, 3> turned = Matrix<3, 3>::Identity();
  const double c = std::cos(before.pose.heading);
  const double s = std::sin(before.pose.heading);
  turned.topLeftCorner<2, 2>() << c, -s, s, c;
  const Matrix<3, 3> Q_world = turned * pending_.covariance * turned.transpose();
  const Eigen::LLT<Matrix<3, 3>> odometry(Q_world);
  if (!match.converged || odometry.info() != Eigen::Success) {
    return false;
  }
  // No narrower than the likelihood that will weigh the draws.
  const double max_information = config.independent_beams / (2.0 * sigma_hit * sigma_hit);
  const Eigen::SelfAdjointEigenSolver<Matrix<2, 2>> xy(match.information.topLeftCorner<2, 2>());
  const double share = std::min(1.0, max_information / xy.eigenvalues()(1));
  const Matrix<3, 3> scan = share * match.information;
  const Matrix<3, 3> identity = Matrix<3, 3>::Identity();
  const Matrix<3, 3> precision = odometry.solve(identity);
  const Eigen::LLT<Matrix<3, 3>> both(Matrix<3, 3>(precision + scan));
  const Matrix<3, 3> P = both.solve(identity);
  if (!precision.allFinite() || both.info() != Eigen::Success || !P.allFinite()) {
    return false;  // before anything is moved
  }
  const Vector<3> pull_back = prior.covariance.llt().solve(local(match.pose, prior.pose));

  const Matrix<3, 3> to_world = recipe_->world_per_cell();
  const Matrix<3, 3> from_world = to_world.inverse();
  const Proposal q{recipe_->to_cells(match.pose), from_world * P * scan * to_world,
                   from_world * P * (share * pull_back),
                   (from_world * P * from_world.transpose()).llt().matrixL(),
                   to_world.transpose() * precision * to_world};

  const UncertainMotion step = pending_in_cells();
  const std::uint64_t key = keys.next();
  move(belief_, {step.motion, Matrix<3, 3>::Zero()}, keys.next(), *recipe_->workers);
  correction_.assign(static_cast<std::size_t>(belief_.size), 0.0F);
  recipe_->workers->share(belief_.size, 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Pose2 moved = belief_.pose(k);
      const Vector<3> normal = random_normal3(key, static_cast<std::uint64_t>(i));
      const Vector<3> by = q.gain * local(q.match, moved) + q.shift + q.L * normal;
      correction_[k] = static_cast<float>(0.5 * (normal.squaredNorm() - by.dot(q.precision * by)));
      belief_.put(k, retract(moved, by));
    }
  });
  reweigh(belief_, correction_, 1.0, 1.0);
  finish_propagation(step);
  return true;
}

}  // namespace locfuse::internal
