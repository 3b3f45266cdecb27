// SPDX-License-Identifier: Apache-2.0
// Where an Mcl draws its particles from: odometry and a match of the scan together.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "locfuse/estimators/mcl.hpp"
#include "locfuse/math/counter_random.hpp"

namespace locfuse {
namespace {

/// What odometry and a scan say together of a particle that odometry alone moves to m, in cells:
/// N(m + pull (place - m) + shift, L L').
struct Proposal {
  Pose2 place;  // where the match fits
  Matrix<3, 3> pull;
  Vector<3> shift;
  Matrix<3, 3> L;
  Matrix<3, 3> precision;  // of odometry alone
};

}  // namespace

/// Returns false, and moves nothing, where there is no match to draw from.
bool Mcl::settle_by_match(const LaserScan& z, const Pose2& motion_in_cells) {
  const Config& config = recipe_->config;
  if (belief_.size > config.refine_up_to || !tracking_ || belief_.stamp == stamp_) {
    return false;
  }
  const PoseEstimate& before = hypotheses_.front().estimate;
  const PoseEstimate prior = carried(before, pending_, stamp_);
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
  const double most = config.independent_beams / (2.0 * sigma_hit() * sigma_hit());
  const Eigen::SelfAdjointEigenSolver<Matrix<2, 2>> xy(match.information.topLeftCorner<2, 2>());
  const double share = std::min(1.0, most / xy.eigenvalues()(1));
  const Matrix<3, 3> scan = share * match.information;
  const Matrix<3, 3> identity = Matrix<3, 3>::Identity();
  const Matrix<3, 3> precision = odometry.solve(identity);
  const Eigen::LLT<Matrix<3, 3>> both(Matrix<3, 3>(precision + scan));
  const Matrix<3, 3> P = both.solve(identity);
  if (!precision.allFinite() || both.info() != Eigen::Success || !P.allFinite()) {
    return false;  // before anything is moved
  }
  const Vector<3> pull_back = prior.covariance.llt().solve(local(match.pose, prior.pose));

  const Matrix<3, 3> to_world = metres_per_cell();
  const Matrix<3, 3> from_world = to_world.inverse();
  const Proposal q{to_cells(match.pose), from_world * P * scan * to_world,
                   from_world * P * (share * pull_back),
                   (from_world * P * from_world.transpose()).llt().matrixL(),
                   to_world.transpose() * precision * to_world};

  const std::uint64_t key = next_key();
  move(belief_, {motion_in_cells, Matrix<3, 3>::Zero()}, next_key(), *recipe_->workers);
  correction_.assign(static_cast<std::size_t>(belief_.size), 0.0F);
  recipe_->workers->share(belief_.size, 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Pose2 moved = belief_.pose(k);
      const Vector<3> normal = random_normal3(key, static_cast<std::uint64_t>(i));
      const Vector<3> by = q.pull * local(q.place, moved) + q.shift + q.L * normal;
      correction_[k] = static_cast<float>(0.5 * (normal.squaredNorm() - by.dot(q.precision * by)));
      belief_.put(k, retract(moved, by));
    }
  });
  reweigh(belief_, correction_, 1.0, 1.0);
  return true;
}

}  // namespace locfuse
