// SPDX-License-Identifier: Apache-2.0
// Draws each particle from odometry and the lines that it sees: equations of
// docs/models/particles.md.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "locfuse/filters/kalman.hpp"
#include "locfuse/models/measurement/line.hpp"
#include "locfuse/particles/mcl_particle_filter.hpp"
#include "particles/mcl_tuning.hpp"

namespace locfuse::internal {
namespace {

/// A line of the scan, and the walls that it may be of.
struct SeenLine {
  LineFeature feature;
  double independent_beams;
  std::vector<Line2> walls;
};

/// Whether a wall stands where a line is seen from a pose, its free side to the pose.
bool may_be(const Pose2& pose, const Line2& seen, const Line2& wall, double slack) {
  const double off = wall.direction().dot(pose.act(seen.middle) - wall.middle);
  return std::abs(off) <= wall.half_length + LineProposalTuning::kBeyondWall + slack &&
         LineModel::predict(pose, wall).x() > 0.0;
}

double nis_of(const Linearization<2, 3>& lin, const Matrix<3, 3>& P) {
  const Matrix<2, 2> S = lin.jacobian * P * lin.jacobian.transpose() + lin.noise;
  const double determinant = S(0, 0) * S(1, 1) - S(0, 1) * S(1, 0);
  const Vector<2>& e = lin.residual;
  return (S(1, 1) * e.x() * e.x() - 2.0 * S(0, 1) * e.x() * e.y() + S(0, 0) * e.y() * e.y()) /
         determinant;
}

/// Linearization of a line of the scan as that of a wall.
Linearization<2, 3> linearize(const LineModel& model, const Pose2& pose, const Line2& wall,
                              const SeenLine& line) {
  const LineFeature& feature = line.feature;
  return LineModel::linearize(
      pose, wall, feature.line,
      model.noise(pose, wall, feature.line, feature.covariance, line.independent_beams));
}

/// Whether walls that a line may be of say the same of the pose.
bool agree(const std::vector<Linearization<2, 3>>& walls, double limit) {
  return std::all_of(walls.begin(), walls.end(), [&](const Linearization<2, 3>& wall) {
    const Linearization<2, 3>& first = walls.front();
    Linearization<2, 3> apart = first;
    apart.residual -= wall.residual;
    apart.noise += wall.noise;
    return nis_of(apart, Matrix<3, 3>::Zero()) <= limit;
  });
}

/// Lines of the scan of which a wall passes the gate from where particles are; each beam counts as
/// `share` independent ones.
std::vector<SeenLine> lines_of(const LaserScan& z, const std::vector<LineFeature>& walls,
                               const LineModel& model, double share, const PoseEstimate& at,
                               double limit) {
  std::vector<SeenLine> lines;
  const double slack = LineProposalTuning::kCandidateSigmas * at.sigma_position();
  const double max_nis =
      LineProposalTuning::kCandidateSigmas * LineProposalTuning::kCandidateSigmas;
  for (const LineFeature& feature : scan_line_features(z)) {
    SeenLine line{feature, share * (feature.last - feature.first + 1), {}};
    std::vector<Linearization<2, 3>> fitting;
    for (const LineFeature& of_map : walls) {
      const Line2& wall = of_map.line;
      const double turn = wrap_angle(feature.line.alpha - wall.alpha + at.pose.heading);
      if (std::abs(turn) > LineProposalTuning::kMaxTurn ||
          !may_be(at.pose, feature.line, wall, slack)) {
        continue;
      }
      const Linearization<2, 3> lin = linearize(model, at.pose, wall, line);
      const double nis = nis_of(lin, at.covariance);
      if (nis <= max_nis) {
        line.walls.push_back(wall);
      }
      if (nis <= limit) {
        fitting.push_back(lin);
      }
    }
    if (!fitting.empty() && agree(fitting, limit)) {
      lines.push_back(std::move(line));
    }
  }
  return lines;
}

/// Corrects the Gaussian of a particle by a line, if a wall passes the gate under the covariance of
/// all particles; returns the line's log density: eq. (2.7).
double correct(GaussianBelief& particle, Slot body, const LineModel& model, const SeenLine& line,
               const Matrix<3, 3>& P_all, double limit) {
  const Pose2 pose = particle.pose(body);
  Linearization<2, 3> nearest;
  double min_nis = std::numeric_limits<double>::infinity();
  for (const Line2& wall : line.walls) {
    const Linearization<2, 3> lin = linearize(model, pose, wall, line);
    const double nis = nis_of(lin, P_all);
    if (nis < min_nis && may_be(pose, line.feature.line, wall, 0.0)) {
      nearest = lin;
      min_nis = nis;
    }
  }
  if (min_nis <= limit) {
    return update(particle, nearest, body, {}).log_likelihood();
  }
  // As of one that just passes.
  if (!std::isfinite(min_nis)) {
    nearest = linearize(model, pose, line.walls.front(), line);
    min_nis = nis_of(nearest, P_all);
  }
  const Matrix<3, 3> P = particle.P;
  const Matrix<2, 2> S = nearest.jacobian * P * nearest.jacobian.transpose() + nearest.noise;
  const double nis = limit / min_nis * nis_of(nearest, P);
  return -0.5 * (nis + std::log(S.determinant())) - std::log(2.0 * kPi);
}

/// The scan without the beams on those lines.
LaserScan without(const LaserScan& z, const std::vector<SeenLine>& lines) {
  constexpr double kLeftOut = 0.0;  // too near for a return
  LaserScan rest = z;
  for (const SeenLine& line : lines) {
    for (int i = line.feature.first; i <= line.feature.last; ++i) {
      rest.ranges[static_cast<std::size_t>(i)] = kLeftOut;
    }
  }
  return rest;
}

/// Variance of a wall where a beam meets it: on an exact map what end points scatter more than they
/// would, on others what they scatter at all, as for the likelihood that weighs the draws.
double wall_variance(const MclConfig& config, double sigma_hit) {
  const double least = config.field.sigma_hit_m;
  return config.sigma_map_m > 0.0 ? config.sigma_map_m * config.sigma_map_m + sigma_hit * sigma_hit
                                  : std::max(sigma_hit * sigma_hit - least * least, 0.0);
}

/// log N(x; m, Q) / N(x; mu, P) of a draw x = mu + L normal, with P = L L': eq. (2.5).
double log_ratio(const Vector<3>& from_prior, const Matrix<3, 3>& Q, const Matrix<3, 3>& L,
                 const Vector<3>& normal) {
  const Eigen::LLT<Matrix<3, 3>> prior(Q);
  return 0.5 * (normal.squaredNorm() - prior.matrixL().solve(from_prior).squaredNorm()) +
         L.diagonal().array().log().sum() - prior.matrixLLT().diagonal().array().log().sum();
}

}  // namespace

std::optional<LaserScan> ParticleFilter::propagate_by_lines(const LaserScan& z, double sigma_hit,
                                                            RandomKeys& keys) {
  static const double limit = Gate(LineProposalTuning::kGateConfidence).limit(2);
  const UncertainMotion step = pending_;
  const PoseEstimate there = predicted(overall());
  const LineModel model({std::sqrt(wall_variance(recipe_->config, sigma_hit))});
  const double share = recipe_->config.independent_beams / static_cast<double>(z.ranges.size());
  const std::vector<SeenLine> lines =
      there.covariance.allFinite() && step.covariance.trace() < LineProposalTuning::kMaxVariance
          ? lines_of(z, recipe_->walls, model, share, there, limit)
          : std::vector<SeenLine>{};
  if (lines.empty()) {
    propagate(keys);
    return std::nullopt;
  }
  const bool is_exact = recipe_->config.sigma_map_m == 0.0;  // lines measure, too
  const std::uint64_t key = keys.next();
  correction_.assign(static_cast<std::size_t>(belief_.size), 0.0F);
  recipe_->workers->share(belief_.size, 1, [&](int begin, int end) {
    GaussianBelief particle = GaussianBelief::of_pose(stamp_, there.pose, there.covariance);
    const Slot body = particle.slot("body");
    for (int i = begin; i < end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Pose2 before = recipe_->to_world(belief_.pose(k));
      Matrix<3, 3> Q = covariance_after(before, Matrix<3, 3>::Zero(), step.motion, step.covariance);
      Q.diagonal().array() += kPositionBounds.min * kPositionBounds.min;
      const Pose2 moved = before * step.motion;
      predict(particle, Propagation<Pose2, 3>{moved, Matrix<3, 3>::Zero(), Q}, body);
      double log_density = 0.0;
      for (const SeenLine& line : lines) {
        log_density += correct(particle, body, model, line, there.covariance, limit);
      }
      const Matrix<3, 3> L = Matrix<3, 3>(particle.P).llt().matrixL();
      const Vector<3> normal = random_normal3(key, static_cast<std::uint64_t>(i));
      const Pose2 drawn = retract(particle.pose(body), L * normal);
      correction_[k] =
          static_cast<float>(is_exact ? log_density : log_ratio(local(drawn, moved), Q, L, normal));
      belief_.put(k, recipe_->to_cells(drawn));
    }
  });
  const bool weighs = recipe_->config.proposal == MclConfig::Proposal::kLineEkf;
  if (weighs) {
    reweigh(belief_, correction_, 1.0,
            is_exact ? recipe_->config.effective_share * effective_size(belief_) : 1.0);
  }
  finish_propagation(pending_in_cells());
  return weighs && is_exact ? std::optional(without(z, lines)) : std::nullopt;
}

}  // namespace locfuse::internal
