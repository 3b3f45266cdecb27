// SPDX-License-Identifier: Apache-2.0
#include "locfuse/filters/noise_shape.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "locfuse/error.hpp"
#include "locfuse/math/types.hpp"

namespace locfuse {
namespace {

constexpr double kMaxDof = 1e6;

/// Variances of a Student-t's Gaussians, in powers of ten: close where most are, then far.
double exponent(int k) { return k <= 12 ? (k - 6) / 6.0 : 1.0 + 0.5 * (k - 12); }
constexpr int kTails = 27;

/// exp(-x x / 2) is nothing beyond.
constexpr double kMaxResidualSigmas = 8.0;

/// Information of Gaussian noise for a filter that assumes `shape` of `scale`, beyond what that
/// filter believes: eq. (2.7) of docs/models/updates.md.
double surplus(const NoiseShape& shape, double scale) {
  double sum = 0.0;
  for (int i = -80; i <= 80; ++i) {
    const double r = kMaxResidualSigmas * i / 80.0;
    double total = 0.0;
    double score = 0.0;
    double curvature = 0.0;
    for (const NoiseShape::Part& part : shape) {
      const double S = scale * part.variance;
      const double weight =
          std::exp(part.log_share - 0.5 * std::log(part.variance) - 0.5 * r * r / S);
      total += weight;
      score += weight * r / S;
      curvature += weight * (1.0 / S - r * r / (S * S));
    }
    score /= total;
    curvature = curvature / total + score * score;
    sum += std::exp(-0.5 * r * r) * (score * score - curvature);
  }
  return sum;
}

/// The scale at which clean noise leaves a filter as sure as it should be.
double consistent_scale(const NoiseShape& shape) {
  double low = 0.1;
  double high = 2.0;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (surplus(shape, middle) > 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

NoiseShape::NoiseShape(const Config& config) : one_sided_(config.kind == NoiseKind::kOneSided) {
  if (!(config.dof >= 1.0 && config.dof <= kMaxDof)) {
    throw std::invalid_argument("dof of noise is " + std::to_string(config.dof) +
                                ", expected 1 to 1e6");
  }
  if (!(config.late_share > 0.0 && config.late_share < 1.0)) {
    throw std::invalid_argument("late_share of noise is " + std::to_string(config.late_share) +
                                ", expected a number between 0 and 1");
  }
  if (config.kind == NoiseKind::kGaussian) {
    return;
  }
  if (one_sided_) {
    constexpr int kLate =
        17;  // nobody knows how late: each octave from three sigma on is as likely
    add(1.0 - config.late_share, 0.0, 1.0);
    for (int k = 0; k < kLate; ++k) {
      const double mean = 3.0 * std::pow(2.0, k);
      add(config.late_share / kLate, mean, 1.0 + 0.16 * mean * mean);
    }
    return;
  }
  const double half = config.kind == NoiseKind::kCauchy ? 0.5 : 0.5 * config.dof;
  for (int k = 0; k < kTails; ++k) {
    const double variance = std::pow(10.0, exponent(k));
    const double width =
        0.5 * (exponent(std::min(k + 1, kTails - 1)) - exponent(std::max(k - 1, 0)));
    // Of 1 / variance, a gamma variable of mean 1, over its logarithm.
    const double share = width * std::exp(half * (1.0 - std::log(variance) - 1.0 / variance));
    if (share > 0.0) {
      add(share, 0.0, variance);
    }
  }
  const double scale = consistent_scale(*this);
  for (Part& part : parts_) {
    part.variance *= scale;
  }
}

void NoiseShape::add(double share, double mean, double variance) {
  parts_[count_++] = {std::log(share), mean, variance};
}

template <int MaxM>
NoiseShape::MomentMatched<MaxM> NoiseShape::moment_match(
    const typename MomentMatched<MaxM>::Residual& residual,
    const typename MomentMatched<MaxM>::Noise& C,
    const typename MomentMatched<MaxM>::Noise& noise) const {
  using Residual = typename MomentMatched<MaxM>::Residual;
  using R = typename MomentMatched<MaxM>::Noise;
  const Eigen::Index rows = residual.size();
  const R zero = R::Zero(rows, rows);
  if (one_sided_ && !(residual(0) > 0.0)) {
    return {residual, noise, zero};
  }
  std::array<double, kMaxParts> weights;  // at first their logarithms
  std::array<Residual, kMaxParts> scores;
  const double shift = one_sided_ ? std::sqrt(noise(0, 0)) : 0.0;
  const auto innovation_of = [&](const Part& part) {
    Eigen::LLT<R> factor(C + part.variance * noise);
    if (factor.info() != Eigen::Success) {
      throw NumericalError("innovation covariance is not positive definite");
    }
    return factor;
  };
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < count_; ++k) {
    const Eigen::LLT<R> factor = innovation_of(parts_[k]);
    Residual off = residual;
    off(0) -= parts_[k].mean * shift;
    weights[k] = parts_[k].log_share - factor.matrixLLT().diagonal().array().log().sum() -
                 0.5 * factor.matrixL().solve(off).squaredNorm();
    scores[k] = factor.solve(off);
    largest = std::max(largest, weights[k]);
  }
  double sum = 0.0;
  Residual score = Residual::Zero(rows);
  R information = zero;
  R wide = zero;
  for (std::size_t k = 0; k < count_; ++k) {
    const double weight = std::exp(weights[k] - largest);
    weights[k] = weight < 1e-12 ? 0.0 : weight;
    if (weights[k] == 0.0) {
      continue;
    }
    const R inverse = innovation_of(parts_[k]).solve(R::Identity(rows, rows));
    sum += weight;
    score += weight * scores[k];
    information += weight * inverse;
    wide += weight * parts_[k].variance * inverse;
  }
  score /= sum;
  using Spread = typename MomentMatched<MaxM>::Spread;
  Spread spread = Spread::Zero(rows, static_cast<Eigen::Index>(count_));
  for (std::size_t k = 0; k < count_; ++k) {
    if (weights[k] > 0.0) {
      spread.col(static_cast<Eigen::Index>(k)) = std::sqrt(weights[k] / sum) * (scores[k] - score);
    }
  }
  const Eigen::LLT<R> factor(information / sum);
  const R matched = factor.solve(R(wide / sum * noise));
  return {factor.solve(score), 0.5 * (matched + matched.transpose()), spread};
}

template NoiseShape::MomentMatched<1> NoiseShape::moment_match<1>(const Vector<1>&,
                                                                  const Matrix<1, 1>&,
                                                                  const Matrix<1, 1>&) const;
template NoiseShape::MomentMatched<3> NoiseShape::moment_match<3>(
    const MomentMatched<3>::Residual&, const MomentMatched<3>::Noise&,
    const MomentMatched<3>::Noise&) const;
template NoiseShape::MomentMatched<Eigen::Dynamic> NoiseShape::moment_match<Eigen::Dynamic>(
    const Eigen::VectorXd&, const Eigen::MatrixXd&, const Eigen::MatrixXd&) const;

}  // namespace locfuse
