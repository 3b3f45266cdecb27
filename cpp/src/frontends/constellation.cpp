// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/constellation.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <limits>

#include "locfuse/math/chi_squared.hpp"

namespace locfuse {
namespace {

/// Constants of match_constellation; docs/models/landmarks.md.
struct ConstellationTuning {
  /// Gauss-Newton steps, from a start that is nearly exact.
  static constexpr int kSteps = 3;
  /// Minimum distance between two landmarks that gives a heading [standard deviations].
  static constexpr double kMinDistanceSigmas = 3.0;
  /// First test of a pair, loose as its noise is that of the observed positions: factor of the
  /// gate, and the minimum distance on the map as a share of the observed one.
  static constexpr double kPairGateFactor = 2.0;
  static constexpr double kMinDistanceShare = 0.5;
};

/// Linearized measurement of one landmark: eq. (3.3) of
/// docs/models/landmarks.md.
struct Row {
  Vector<2> residual;
  Matrix<2, 3> jacobian;
};

Row look(const Pose2& pose, const Vector<2>& landmark, const SeenLandmark& seen) {
  const double c = std::cos(pose.heading);
  const double s = std::sin(pose.heading);
  const Vector<2> d = landmark - pose.position();
  const Vector<2> expected(c * d.x() + s * d.y(), c * d.y() - s * d.x());
  Row row;
  row.residual = seen.position - expected;
  row.jacobian << -c, -s, expected.y(), s, -c, -expected.x();
  return row;
}

/// In units of the noise.
Row whitened(Row row, const Eigen::LLT<Matrix<2, 2>>& noise) {
  noise.matrixL().solveInPlace(row.residual);
  noise.matrixL().solveInPlace(row.jacobian);
  return row;
}

/// NaN if the factorization failed.
template <int N>
double log_determinant(const Eigen::LLT<Matrix<N, N>>& factor) {
  return factor.info() == Eigen::Success ? 2.0 * factor.matrixLLT().diagonal().array().log().sum()
                                         : std::numeric_limits<double>::quiet_NaN();
}

/// The pose at which the line from `a` to `b` lies on that between two landmarks, middle on middle.
Pose2 laid_over(const SeenLandmark& a, const SeenLandmark& b, const Vector<2>& of_a,
                const Vector<2>& of_b) {
  const Vector<2> seen = b.position - a.position;
  const Vector<2> known = of_b - of_a;
  const double heading =
      angle_difference(std::atan2(known.y(), known.x()), std::atan2(seen.y(), seen.x()));
  const Pose2 turned{0.0, 0.0, heading};
  const Vector<2> at = 0.5 * (of_a + of_b) - turned.act(0.5 * (a.position + b.position));
  return {at.x(), at.y(), heading};
}

/// Gauss-Newton for three unknowns of the pose from four numbers of two positions.
std::optional<ConstellationMatch> fit(const std::array<const SeenLandmark*, 2>& seen,
                                      const std::array<Vector<2>, 2>& known, double limit) {
  const std::array<Eigen::LLT<Matrix<2, 2>>, 2> noise{seen[0]->covariance.llt(),
                                                      seen[1]->covariance.llt()};
  Pose2 pose = laid_over(*seen[0], *seen[1], known[0], known[1]);
  Matrix<3, 3> information;
  for (int step = 0; step < ConstellationTuning::kSteps; ++step) {
    information.setZero();
    Vector<3> gradient = Vector<3>::Zero();
    for (std::size_t i = 0; i < 2; ++i) {
      const Row row = whitened(look(pose, known[i], *seen[i]), noise[i]);
      information += row.jacobian.transpose() * row.jacobian;
      gradient += row.jacobian.transpose() * row.residual;
    }
    pose = retract(pose, information.llt().solve(gradient));
  }
  double squared = 0.0;
  for (std::size_t i = 0; i < 2; ++i) {
    squared += whitened(look(pose, known[i], *seen[i]), noise[i]).residual.squaredNorm();
  }
  const Eigen::LLT<Matrix<3, 3>> factor(information);
  const Matrix<3, 3> inverse = factor.solve(Matrix<3, 3>::Identity());
  const Matrix<3, 3> covariance = 0.5 * (inverse + inverse.transpose());
  const double log_volumes =
      -log_determinant(factor) - log_determinant(noise[0]) - log_determinant(noise[1]);
  if (!(squared <= limit) || !std::isfinite(log_volumes) ||
      covariance.llt().info() != Eigen::Success) {  // also where rounding leaves no digits
    return std::nullopt;
  }
  return ConstellationMatch{pose, covariance, 0.5 * (log_volumes - squared - std::log(2.0 * kPi))};
}

}  // namespace

std::vector<ConstellationMatch> match_constellation(const SeenLandmark& a, const SeenLandmark& b,
                                                    const LandmarkMap& map, double probability) {
  const double limit = chi_squared_quantile(1, probability);
  const Vector<2> between = b.position - a.position;
  const double apart = between.norm();
  const double variance = between.dot((a.covariance + b.covariance) * between) / (apart * apart);
  std::vector<ConstellationMatch> matches;
  if (!(apart > ConstellationTuning::kMinDistanceSigmas * std::sqrt(variance))) {
    return matches;
  }
  for (const Landmark& of_a : map.landmarks()) {
    if (a.id.value_or(of_a.id) != of_a.id) {
      continue;
    }
    for (const Landmark& of_b : map.landmarks()) {
      if (b.id.value_or(of_b.id) != of_b.id || of_b.id == of_a.id) {
        continue;
      }
      const double known = (of_b.position - of_a.position).norm();
      if ((known - apart) * (known - apart) >
              ConstellationTuning::kPairGateFactor * limit * variance ||
          known < ConstellationTuning::kMinDistanceShare * apart) {
        continue;
      }
      if (const auto match = fit({&a, &b}, {of_a.position, of_b.position}, limit)) {
        matches.push_back(*match);
      }
    }
  }
  return matches;
}

}  // namespace locfuse
