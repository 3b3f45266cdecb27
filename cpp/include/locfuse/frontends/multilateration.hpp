// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "locfuse/frontends/range_fit.hpp"
#include "locfuse/frontends/squared_range.hpp"

namespace locfuse {

/// What range-only positioning can say.
enum class PositionStatus : std::uint8_t {
  kUnique,           ///< one position fits
  kInconsistent,     ///< one position fits best, but worse than the sigmas allow
  kAmbiguous,        ///< several positions fit
  kUnderdetermined,  ///< the ranges leave a direction open, or a whole curve or surface
  kExcluded,         ///< every position that fits is outside the bounding box
  kNotConverged,     ///< no minimum was reached
  kBadRange,         ///< a range is zero, negative or infinite; nothing was computed
};

/// How sure a single position has to be.
struct PositionRules {
  /// Chance that of two positions the wrong one is returned alone: eq. (20).
  double wrong_side_probability = 1e-6;
  /// Chance that a fit to good ranges is called inconsistent.
  double false_alarm_probability = 1e-3;
};

/// Position at one moment.
template <int N>
struct RangePosition {
  PositionStatus status = PositionStatus::kUnderdetermined;
  Vector<N> position = Vector<N>::Zero();  ///< best fit; nothing if `has_position` is false [m]
  Matrix<N, N> covariance = Matrix<N, N>::Zero();  ///< first order [m^2]
  double cost = 0.0;                               ///< eq. (14)
  bool has_position = false;
};

/// Distinct local minima of the cost, the best first.
template <int N>
struct RangeMinima {
  static constexpr int kMost = 8;

  int count = 0;
  std::array<RangeFit<N>, kMost> fit;

  /// Keeps `found` unless it is there already.
  void add(const RangeFit<N>& found, double resolution);
};

namespace internal {

/// Least of the costs below which eq. (19) excludes a second position; negative if none does.
template <int N>
[[nodiscard]] double strong_below(const RangeLayout<N>& layout, double side_margin);

/// Minima from SR-LS, its second solution, and the mirror image where `strong` does not exclude it.
template <int N>
[[nodiscard]] RangeMinima<N> find_minima(const RangeLayout<N>& layout, const double* ranges,
                                         const RangeLoss& loss, double strong);

/// Verdict on the best of the minima; neither how well the ranges fit it nor how far first order
/// holds is looked at.
template <int N>
[[nodiscard]] PositionStatus judge(const RangeMinima<N>& minima, const RangeLayout<N>& layout,
                                   const double* ranges, double side_margin);

/// Three sigmas along the least certain direction the cost does not rise by about nine: what fits
/// is longer than the covariance says, or bent.
template <int N>
[[nodiscard]] bool defies_first_order(const RangeFit<N>& fit, const RangeLayout<N>& layout,
                                      const double* ranges, const RangeLoss& loss);

/// The information leaves some direction with a sigma beyond `reach`.
template <int N>
[[nodiscard]] bool leaves_open(const Matrix<N, N>& information, double reach);

/// The same number. Throws std::invalid_argument outside (0, 1).
double checked_alarm(double false_alarm_probability);

/// Square of the normal quantile: eq. (20). Throws std::invalid_argument outside (0, 0.5).
[[nodiscard]] double side_margin(double wrong_side_probability);

}  // namespace internal

/// Range-only positioning over one set of anchors: SR-LS, then maximum likelihood, and the mirror
/// image wherever it could fit as well. docs/models/multilateration.md. No heap.
template <int N>
class Multilateration {
 public:
  struct Config {
    RangeLoss loss;
    PositionRules rules;
  };

  /// Throws std::invalid_argument on what `validate` refuses, a probability outside (0, 1) or a
  /// table that is not for positions of N dimensions. Copies what it needs.
  Multilateration(const AnchorTable& anchors, const double* sigma, const Config& config);

  /// One range per anchor [m]; NaN where it was not heard. Throws std::invalid_argument if one is
  /// zero, negative or infinite.
  [[nodiscard]] RangePosition<N> solve(const double* ranges) const;

  /// The same rules over other anchors; every range is a positive number.
  [[nodiscard]] RangePosition<N> solve_over(const RangeLayout<N>& layout,
                                            const double* ranges) const {
    return solve_on(layout, ranges, internal::strong_below<N>(layout, side_margin_));
  }

  /// The anchors as they were given.
  [[nodiscard]] AnchorTable table() const;
  [[nodiscard]] const double* sigma() const { return sigma_.data(); }
  [[nodiscard]] const RangeLayout<N>& layout() const { return layout_; }
  [[nodiscard]] const Config& config() const { return config_; }
  /// Below this cost no other position can fit as well: eq. (19).
  [[nodiscard]] double strong_below() const { return strong_below_; }
  /// Least difference of costs that decides between two positions, eq. (20).
  [[nodiscard]] double side_margin() const { return side_margin_; }
  /// Largest cost of good ranges by number of ranges, 0 to kMaxRanges.
  [[nodiscard]] double cost_limit(int ranges) const {
    return cost_limit_.at(static_cast<std::size_t>(ranges));
  }

 private:
  [[nodiscard]] RangePosition<N> solve_on(const RangeLayout<N>& layout, const double* ranges,
                                          double strong) const;

  Config config_;
  std::array<double, std::size_t{3} * kMaxRanges> rows_;
  std::array<double, kMaxRanges> sigma_;
  AnchorTable table_;
  RangeLayout<N> layout_;
  double side_margin_;
  double strong_below_;
  std::array<double, kMaxRanges + 1> cost_limit_;
};

}  // namespace locfuse
