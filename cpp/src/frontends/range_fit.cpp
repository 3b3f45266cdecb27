// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/range_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace locfuse {

namespace {

/// Constants of fit_ranges; docs/models/ranges.md eq. (2.14) to (2.17).
struct RangeFitTuning {
  static constexpr int kMaxIterations = 50;
  /// Decrease of the cost below which the fit has converged: it moves the position by less than
  /// 1e-4 of its sigma, and the remaining error is the square of that. Also as a share of the cost,
  /// where rounding exceeds it.
  static constexpr double kConvergedDecrease = 1e-8;
  static constexpr double kConvergedShare = 1e-13;
  /// Distance from an anchor below which a range has no direction [m].
  static constexpr double kMinDistance = 1e-12;
  /// Minimum pivot of a positive definite matrix, beside its diagonal: rounding of a double.
  static constexpr double kMinPivot = 1e-14;
  /// Levenberg-Marquardt damping [trace of the information]: minimum ridge, first value after a
  /// step that fails, factors on failure and success, and the value below which it is 0.
  static constexpr double kMinRidge = 1e-9;
  static constexpr double kFirstDamping = 1e-3;
  static constexpr double kDampingGrowth = 10.0;
  static constexpr double kDampingDecay = 0.1;
  static constexpr double kNoDamping = 1e-6;
  /// Scales of a robust loss, from wide to narrow [scale].
  static constexpr double kWidenings[] = {16.0, 4.0, 1.0};
  /// Scales at which a loss is 95 % efficient on Gaussian noise [sigmas].
  static constexpr double kHuberScale = 1.345;
  static constexpr double kCauchyScale = 2.385;
};

/// Loss of z with rho' and rho'' as functions of z^2, eq. (2.15) of docs/models/ranges.md.
struct LossValue {
  double rho;
  double slope;
  double bend;
};

template <RangeLossKind kKind>
LossValue loss_at(double z, double scale) {
  const double s = z * z;
  if constexpr (kKind == RangeLossKind::kHuber) {
    const double magnitude = std::abs(z);
    if (magnitude > scale) {
      const double slope = scale / magnitude;
      return {2.0 * scale * magnitude - scale * scale, slope, -0.5 * slope / s};
    }
  }
  if constexpr (kKind == RangeLossKind::kCauchy || kKind == RangeLossKind::kOneSided) {
    if (kKind == RangeLossKind::kCauchy || z > 0.0) {
      const double squared_scale = scale * scale;
      const double slope = 1.0 / (1.0 + s / squared_scale);
      return {squared_scale * std::log1p(s / squared_scale), slope, -slope * slope / squared_scale};
    }
  }
  return {s, 1.0, 0.0};
}

LossValue loss_of(const RangeLoss& loss, double z) {
  switch (loss.kind) {
    case RangeLossKind::kHuber:
      return loss_at<RangeLossKind::kHuber>(z, loss.effective_scale());
    case RangeLossKind::kCauchy:
      return loss_at<RangeLossKind::kCauchy>(z, loss.effective_scale());
    case RangeLossKind::kOneSided:
      return loss_at<RangeLossKind::kOneSided>(z, loss.effective_scale());
    case RangeLossKind::kNone:
      break;
  }
  return {z * z, 1.0, 0.0};
}

/// Cost, half its gradient and half its Hessian, eq. (2.16), and the Gauss-Newton part of the
/// latter.
template <int N>
struct Expansion {
  double cost = 0.0;
  Vector<N> gradient = Vector<N>::Zero();
  Matrix<N, N> gauss_newton = Matrix<N, N>::Zero();
  Matrix<N, N> hessian = Matrix<N, N>::Zero();
};

template <int N, RangeLossKind kKind>
Expansion<N> expand(const RangeLayout<N>& layout, const RangesView& ranges, double scale,
                    const PositionPrior<N>& prior, const Vector<N>& x) {
  Expansion<N> at;
  double isotropic = 0.0;
  for (int i = 0; i < layout.size; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const Vector<N> d = x - layout.offset(i);
    const double h = std::sqrt(d.squaredNorm() + layout.height_squared[slot]);
    const double inverse = h > RangeFitTuning::kMinDistance ? 1.0 / h : 0.0;
    const Vector<N> u = inverse * d;
    const double error = h - ranges[i];
    double weight = layout.information[slot];
    double bend = 0.0;
    if constexpr (kKind == RangeLossKind::kNone) {
      at.cost += weight * error * error;
    } else {
      const LossValue loss = loss_at<kKind>(-error / layout.sigma[slot], scale);
      at.cost += loss.rho;
      bend = 2.0 * weight * loss.bend * error * error * weight;
      weight *= loss.slope;
    }
    const double curl = weight * error * inverse;
    at.gradient += (weight * error) * u;
    isotropic += curl;
    for (int k = 0; k < N; ++k) {
      for (int l = 0; l <= k; ++l) {
        const double uu = u(k) * u(l);
        at.gauss_newton(k, l) += weight * uu;
        at.hessian(k, l) += (bend - curl) * uu;
      }
    }
  }
  for (int k = 0; k < N; ++k) {
    const double from_prior = x(k) - prior.mean(k);
    at.cost += prior.information(k) * from_prior * from_prior;
    at.gradient(k) += prior.information(k) * from_prior;
    at.gauss_newton(k, k) += prior.information(k);
    at.hessian(k, k) += isotropic;
    for (int l = 0; l <= k; ++l) {
      at.hessian(k, l) += at.gauss_newton(k, l);
      at.hessian(l, k) = at.hessian(k, l);
      at.gauss_newton(l, k) = at.gauss_newton(k, l);
    }
  }
  return at;
}

/// Solves A x = b; false unless the symmetric A is clearly positive definite.
bool solve_positive(const Matrix<2, 2>& A, const Vector<2>& b, Vector<2>& x) {
  const double determinant = A(0, 0) * A(1, 1) - A(1, 0) * A(1, 0);
  if (!(A(0, 0) > 0.0 && determinant > RangeFitTuning::kMinPivot * A(0, 0) * A(1, 1))) {
    return false;
  }
  const double inverse = 1.0 / determinant;
  x << (A(1, 1) * b(0) - A(1, 0) * b(1)) * inverse, (A(0, 0) * b(1) - A(1, 0) * b(0)) * inverse;
  return true;
}

bool solve_positive(const Matrix<3, 3>& A, const Vector<3>& b, Vector<3>& x) {
  const double l10 = A(1, 0) / A(0, 0);
  const double l20 = A(2, 0) / A(0, 0);
  const double d1 = A(1, 1) - l10 * A(1, 0);
  const double c21 = A(2, 1) - l20 * A(1, 0);
  const double l21 = c21 / d1;
  const double d2 = A(2, 2) - l20 * A(2, 0) - l21 * c21;
  if (!(A(0, 0) > 0.0 && d1 > RangeFitTuning::kMinPivot * A(1, 1) &&
        d2 > RangeFitTuning::kMinPivot * A(2, 2))) {
    return false;
  }
  const double y1 = b(1) - l10 * b(0);
  const double y2 = b(2) - l20 * b(0) - l21 * y1;
  x(2) = y2 / d2;
  x(1) = y1 / d1 - l21 * x(2);
  x(0) = b(0) / A(0, 0) - l10 * x(1) - l20 * x(2);
  return true;
}

/// Newton's step where the Hessian is positive definite, else a damped Gauss-Newton step.
template <int N>
bool step_of(const Expansion<N>& at, double damping, Vector<N>& step) {
  if (damping == 0.0 && solve_positive(at.hessian, Vector<N>(-at.gradient), step)) {
    return true;
  }
  const double ridge = std::max(damping, RangeFitTuning::kMinRidge) * at.gauss_newton.trace();
  const Matrix<N, N> damped = at.gauss_newton + ridge * Matrix<N, N>::Identity();
  (void)solve_positive(damped, Vector<N>(-at.gradient), step);
  return false;
}

template <int N, RangeLossKind kKind>
RangeFit<N> descend(const RangeLayout<N>& layout, const RangesView& ranges, const Vector<N>& start,
                    double scale, const PositionPrior<N>& prior) {
  RangeFit<N> fit;
  fit.position = start;
  Expansion<N> at = expand<N, kKind>(layout, ranges, scale, prior, start);
  double damping = 0.0;
  while (fit.iterations < RangeFitTuning::kMaxIterations && !fit.converged) {
    ++fit.iterations;
    Vector<N> step = Vector<N>::Zero();
    const bool newton = step_of<N>(at, damping, step);
    const double gain = -at.gradient.dot(step);
    const Vector<N> next = fit.position + step;
    if (gain <=
        std::max(RangeFitTuning::kConvergedDecrease, RangeFitTuning::kConvergedShare * at.cost)) {
      fit.position = next;
      fit.converged = newton || damping <= RangeFitTuning::kFirstDamping;
      Vector<N> unused;
      fit.saddle = !newton && !solve_positive(at.hessian, at.gradient, unused);
      at.cost = std::max(at.cost - gain, 0.0);
      damping *= RangeFitTuning::kDampingDecay;
      continue;
    }
    const Expansion<N> there = expand<N, kKind>(layout, ranges, scale, prior, next);
    if (there.cost <= at.cost) {
      fit.position = next;
      at = there;
      damping =
          damping <= RangeFitTuning::kNoDamping ? 0.0 : RangeFitTuning::kDampingDecay * damping;
    } else {
      damping = std::max(RangeFitTuning::kFirstDamping, RangeFitTuning::kDampingGrowth * damping);
    }
  }
  fit.cost = at.cost;
  fit.information = at.gauss_newton;
  return fit;
}

template <int N, RangeLossKind kKind>
RangeFit<N> descend_graduated(const RangeLayout<N>& layout, const RangesView& ranges,
                              const Vector<N>& start, double scale, const PositionPrior<N>& prior) {
  RangeFit<N> fit;
  fit.position = start;
  int iterations = 0;
  for (const double widening : RangeFitTuning::kWidenings) {
    fit = descend<N, kKind>(layout, ranges, fit.position, widening * scale, prior);
    iterations += fit.iterations;
  }
  fit.iterations = iterations;
  return fit;
}

}  // namespace

void validate(const RangeLoss& loss) {
  if (!(loss.scale == 0.0 || (loss.scale >= 1e-3 && loss.scale <= 1e6))) {
    throw std::invalid_argument("the scale of a loss is " + std::to_string(loss.scale) +
                                " sigmas, expected 0 for the usual one, or 1e-3 to 1e6");
  }
}

double RangeLoss::effective_scale() const {
  if (scale > 0.0) {
    return scale;
  }
  return kind == RangeLossKind::kHuber ? RangeFitTuning::kHuberScale : RangeFitTuning::kCauchyScale;
}

double RangeLoss::weight(double z) const { return loss_of(*this, z).slope; }

double RangeLoss::cost(double z) const { return loss_of(*this, z).rho; }

template <int N>
RangeFit<N> fit_ranges(const RangeLayout<N>& layout, const RangesView& ranges,
                       const Vector<N>& start, const RangeLoss& loss,
                       const PositionPrior<N>& prior) {
  const double scale = loss.effective_scale();
  switch (loss.kind) {
    case RangeLossKind::kHuber:
      return descend_graduated<N, RangeLossKind::kHuber>(layout, ranges, start, scale, prior);
    case RangeLossKind::kCauchy:
      return descend_graduated<N, RangeLossKind::kCauchy>(layout, ranges, start, scale, prior);
    case RangeLossKind::kOneSided:
      return descend_graduated<N, RangeLossKind::kOneSided>(layout, ranges, start, scale, prior);
    case RangeLossKind::kNone:
      break;
  }
  return descend<N, RangeLossKind::kNone>(layout, ranges, start, scale, prior);
}

template <int N>
RangeFit<N> fit_ranges_by(RangeMl ml, const RangeLayout<N>& layout, const RangesView& ranges,
                          const Vector<N>& start, const RangeLoss& loss,
                          const PositionPrior<N>& prior, const CeresOptions& options,
                          std::string* termination) {
  if (ml != RangeMl::kCeres) {
    RangeFit<N> fit = fit_ranges<N>(layout, ranges, start, loss, prior);
    if (termination != nullptr) {
      *termination = fit.converged ? "converged: our own solver" : "our own solver took all steps";
    }
    return fit;
  }
  const bool robust = loss.kind != RangeLossKind::kNone;
  const Vector<N> near =
      robust ? fit_ranges<N>(layout, ranges, start, loss, prior).position : start;
  RangeFit<N> fit = fit_ranges_ceres<N>(layout, ranges, near, loss, prior, options, termination);
  fit.saddle = fit_ranges<N>(layout, ranges, fit.position, loss, prior).saddle;
  return fit;
}

template <int N>
bool range_fit_gain(const RangeLayout<N>& layout, const RangeFit<N>& fit, RangeGain<N>& gain) {
  gain.resize(N, layout.size);
  const Eigen::LDLT<Matrix<N, N>> factor(fit.information);
  if (!factor.isPositive() || !(factor.rcond() > RangeFitTuning::kMinPivot)) {
    return false;
  }
  for (int i = 0; i < layout.size; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const Vector<N> d = fit.position - layout.offset(i);
    const double h = std::sqrt(d.squaredNorm() + layout.height_squared[slot]);
    gain.col(i) = (h > RangeFitTuning::kMinDistance ? layout.information[slot] / h : 0.0) * d;
  }
  gain = factor.solve(gain).eval();
  return true;
}

#define LOCFUSE_INSTANTIATE(N)                                                                   \
  template RangeFit<N> fit_ranges<N>(const RangeLayout<N>&, const RangesView&, const Vector<N>&, \
                                     const RangeLoss&, const PositionPrior<N>&);                 \
  template RangeFit<N> fit_ranges_by<N>(                                                         \
      RangeMl, const RangeLayout<N>&, const RangesView&, const Vector<N>&, const RangeLoss&,     \
      const PositionPrior<N>&, const CeresOptions&, std::string*);                               \
  template bool range_fit_gain<N>(const RangeLayout<N>&, const RangeFit<N>&, RangeGain<N>&);
LOCFUSE_INSTANTIATE(2)
LOCFUSE_INSTANTIATE(3)
#undef LOCFUSE_INSTANTIATE

}  // namespace locfuse
