// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "locfuse/frontends/range_layout.hpp"

namespace locfuse {

/// Loss of a whitened residual z = (r - h) / sigma: eq. (2.15) of docs/models/ranges.md.
enum class RangeLossKind {
  kNone,      ///< z^2
  kHuber,     ///< grows linearly beyond the scale, either way
  kCauchy,    ///< grows logarithmically beyond the scale, either way
  kOneSided,  ///< Cauchy for ranges that are too long (no line of sight), z^2 for those too short
};

struct RangeLoss {
  RangeLossKind kind = RangeLossKind::kNone;
  double scale = 0.0;  ///< in sigmas; 0: 95 % efficient on Gaussian noise (1.345 or 2.385)

  /// The scale, or the default that 0 stands for.
  [[nodiscard]] double effective_scale() const;
  /// rho'(z^2): weight of a range relative to least squares.
  [[nodiscard]] double weight(double z) const;
  /// rho(z^2).
  [[nodiscard]] double cost(double z) const;
};

/// Throws std::invalid_argument unless the scale is 0 or 1e-3 to 1e6.
void validate(const RangeLoss& loss);

/// Prior of a position: independent Gaussians per axis.
template <int N>
struct PositionPrior {
  Vector<N> mean = Vector<N>::Zero();         ///< relative to the layout's centre [m]
  Vector<N> information = Vector<N>::Zero();  ///< 1 / sigma^2 per axis; 0: no prior
};

/// A local minimum of the cost.
template <int N>
struct RangeFit {
  Vector<N> position = Vector<N>::Zero();  ///< relative to the layout's centre [m]
  double cost = 0.0;                       ///< sum of losses, eq. (2.14): chi-square without
  Matrix<N, N> information = Matrix<N, N>::Zero();  ///< J' W R^-1 J with the prior's [1/m^2]
  int iterations = 0;
  bool converged = false;
  bool saddle = false;  ///< the cost decreases in some direction
};

/// Maximum likelihood from `start` by damped Newton steps of fixed size, no heap; robust losses by
/// a graduated scale. `start` and `prior` are relative to the layout's centre.
template <int N>
[[nodiscard]] RangeFit<N> fit_ranges(const RangeLayout<N>& layout, const RangesView& ranges,
                                     const Vector<N>& start, const RangeLoss& loss = {},
                                     const PositionPrior<N>& prior = {});

/// Options of ceres::Solver.
struct CeresOptions {
  int max_iterations = 50;
  double function_tolerance = 1e-12;   ///< relative change of the cost
  double gradient_tolerance = 1e-10;   ///< largest component of the gradient
  double parameter_tolerance = 1e-10;  ///< relative change of the position
};

/// Maximum likelihood by Ceres: one residual block per range with its loss, analytic Jacobians.
/// `termination`, if given, receives the reason that Ceres states.
template <int N>
[[nodiscard]] RangeFit<N> fit_ranges_ceres(const RangeLayout<N>& layout, const RangesView& ranges,
                                           const Vector<N>& start, const RangeLoss& loss = {},
                                           const PositionPrior<N>& prior = {},
                                           const CeresOptions& options = {},
                                           std::string* termination = nullptr);

/// Solver of maximum likelihood.
enum class RangeMl {
  kNewton,  ///< `fit_ranges`: position and covariance are ours
  kCeres,   ///< `fit_ranges_ceres`: position and covariance are those of Ceres
  kBoth,    ///< as kNewton; `locate` also says how far from it Ceres ends
};

/// One of the two fits. Ceres starts where `fit_ranges` ends under a robust loss, which that
/// reaches by graduated scales, else at `start`; `saddle` is always found by `fit_ranges`.
template <int N>
[[nodiscard]] RangeFit<N> fit_ranges_by(RangeMl ml, const RangeLayout<N>& layout,
                                        const RangesView& ranges, const Vector<N>& start,
                                        const RangeLoss& loss = {},
                                        const PositionPrior<N>& prior = {},
                                        const CeresOptions& options = {},
                                        std::string* termination = nullptr);

/// Gain d x / d r of the fit, one column per range: eq. (2.17). False if a direction is open.
template <int N>
[[nodiscard]] bool range_fit_gain(const RangeLayout<N>& layout, const RangeFit<N>& fit,
                                  RangeGain<N>& gain);

}  // namespace locfuse
