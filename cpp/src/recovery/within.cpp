// SPDX-License-Identifier: Apache-2.0
#include "recovery/within.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>

#include "locfuse/math/angle.hpp"

namespace locfuse::internal {
namespace {

constexpr double kLeastVariance = 1e-12;  // [m^2]: of less than a micrometre nobody speaks
constexpr double kTails = 8.0;            // sigmas beyond which there is nothing

/// P(X <= x) of a standard Gaussian.
double below(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

/// P(low <= X <= high), by the tail in which it does not cancel.
double between(double low, double high) {
  return low > 0.0 ? below(-low) - below(-high) : below(high) - below(low);
}

}  // namespace

/// Probability that a zero-mean Gaussian position stays within `radius`, eq. (7) of docs/health.md.
double probability_within(double radius, const Matrix<2, 2>& covariance) {
  constexpr int kAngles = 8;  // t from 0 to pi; the integrand is smooth and periodic
  const double middle = 0.5 * (covariance(0, 0) + covariance(1, 1));
  const double half = std::hypot(0.5 * (covariance(0, 0) - covariance(1, 1)), covariance(0, 1));
  double sum = 0.0;
  for (int k = 0; k < kAngles; ++k) {
    const double cosine = std::cos((k + 0.5) * kPi / kAngles);
    sum += std::exp(-0.5 * radius * radius / std::max(middle + half * cosine, 1e-300));
  }
  return 1.0 - sum / kAngles;
}

double probability_within(double radius, const Vector<2>& mean, const Matrix<2, 2>& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix<2, 2>> eigen(covariance);
  const Vector<2> sigma = eigen.eigenvalues().cwiseMax(kLeastVariance).cwiseSqrt();
  const Vector<2> centre = eigen.eigenvectors().transpose() * mean;
  // Chords of the disc across its shorter axis: x = radius sin(t).
  const auto angle_at = [&](double x) { return std::asin(std::clamp(x / radius, -1.0, 1.0)); };
  const double from = angle_at(centre.y() - kTails * sigma.y());
  const double to = angle_at(centre.y() + kTails * sigma.y());
  if (!(to > from)) {
    return 0.0;
  }
  const auto chord = [&](double t) {
    const double z = (radius * std::sin(t) - centre.y()) / sigma.y();
    const double half = radius * std::cos(t);
    return std::exp(-0.5 * z * z) * half *
           between((-half - centre.x()) / sigma.x(), (half - centre.x()) / sigma.x());
  };
  // Where the edge of the disc crosses the ridge of a thin Gaussian the integrand has a step.
  const double edge = std::acos(std::min(std::abs(centre.x()) / radius, 1.0));
  double sum = 0.0;
  double begin = from;
  for (const double end : {std::clamp(-edge, from, to), std::clamp(edge, from, to), to}) {
    sum += boost::math::quadrature::gauss<double, 30>::integrate(chord, begin, end);
    begin = end;
  }
  return std::clamp(sum / (std::sqrt(2.0 * kPi) * sigma.y()), 0.0, 1.0);
}

double probability_within(double limit, double mean, double variance) {
  const double sigma = std::sqrt(std::max(variance, kLeastVariance));
  return between((-limit - mean) / sigma, (limit - mean) / sigma);
}

}  // namespace locfuse::internal
