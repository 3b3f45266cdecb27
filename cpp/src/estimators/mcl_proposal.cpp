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

Vector<3> difference(const Pose2& a, const Pose2& b) {
  return {a.x - b.x, a.y - b.y, angle_difference(a.heading, b.heading)};
}

}  // namespace

/// Returns false, and moves nothing, where there is no match to draw from.
bool Mcl::settle_by_match(const LaserScan& z) {
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
  const Vector<3> pull_back = prior.covariance.llt().solve(difference(match.pose, prior.pose));

  const double r = grid().resolution();
  Matrix<3, 3> to_world = Matrix<3, 3>::Identity();
  const double turn = grid().origin().heading;
  to_world.topLeftCorner<2, 2>() << r * std::cos(turn), -r * std::sin(turn), r * std::sin(turn),
      r * std::cos(turn);
  const Matrix<3, 3> from_world = to_world.inverse();
  const Proposal q{to_cells(match.pose), from_world * P * scan * to_world,
                   from_world * P * (share * pull_back),
                   (from_world * P * from_world.transpose()).llt().matrixL(),
                   to_world.transpose() * precision * to_world};

  UncertainMotion step = pending_;
  step.motion.x /= r;
  step.motion.y /= r;
  step.covariance.setZero();
  const std::uint64_t key = next_key();
  move(belief_, step, next_key(), *recipe_->workers);
  correction_.assign(static_cast<std::size_t>(belief_.size), 0.0F);
  recipe_->workers->share(belief_.size, 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const std::uint64_t n = 3 * static_cast<std::uint64_t>(i);
      const Pose2 moved{static_cast<double>(belief_.x[k]), static_cast<double>(belief_.y[k]),
                        static_cast<double>(std::atan2(belief_.s[k], belief_.c[k]))};
      const Vector<3> normal(random_normal(key, n), random_normal(key, n + 1),
                             random_normal(key, n + 2));
      const Vector<3> by = q.pull * difference(q.place, moved) + q.shift + q.L * normal;
      correction_[k] = static_cast<float>(0.5 * (normal.squaredNorm() - by.dot(q.precision * by)));
      const double heading = moved.heading + by.z();
      belief_.x[k] = static_cast<float>(moved.x + by.x());
      belief_.y[k] = static_cast<float>(moved.y + by.y());
      belief_.c[k] = static_cast<float>(std::cos(heading));
      belief_.s[k] = static_cast<float>(std::sin(heading));
    }
  });
  reweigh(belief_, correction_, 1.0, 1.0);
  return true;
}

}  // namespace locfuse
