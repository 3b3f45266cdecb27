// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "locfuse/frontends/range_fit.hpp"
#include "locfuse/frontends/squared_range.hpp"

namespace locfuse {

/// Status of a position from ranges.
enum class PositionStatus : std::uint8_t {
  kUnique,           ///< one position fits
  kInconsistent,     ///< one position fits best, but worse than the sigmas allow
  kAmbiguous,        ///< several positions fit
  kUnderdetermined,  ///< the ranges leave a direction open, or a whole curve or surface
  kExcluded,         ///< every position that fits is outside the bounding box
  kNotConverged,     ///< no minimum was reached
  kBadRange,         ///< a range is zero, negative or infinite; nothing was computed
};

/// Error probabilities of the decision for a single position.
struct PositionRules {
  /// Probability that the wrong one of two positions is returned alone: eq. (2.20).
  double wrong_side_probability = 1e-6;
  /// Probability that a fit to good ranges is called inconsistent.
  double false_alarm_probability = 1e-3;
};

/// Position from the ranges of one epoch.
template <int N>
struct RangePosition {
  PositionStatus status = PositionStatus::kUnderdetermined;
  Vector<N> position = Vector<N>::Zero();  ///< best fit; undefined unless `has_position` [m]
  Matrix<N, N> covariance = Matrix<N, N>::Zero();  ///< first order [m^2]
  double cost = 0.0;                               ///< eq. (2.14)
  bool has_position = false;
};

/// SR-LS or SR-WLS alone, with first-order covariance, eq. (2.13), and without a test of fit.
template <int N>
[[nodiscard]] RangePosition<N> solve_by_squares(const RangeLayout<N>& layout,
                                                const RangesView& ranges,
                                                SquaredRangeWeights weights);

/// Distinct local minima of the cost, by increasing cost.
template <int N>
struct RangeMinima {
  static constexpr int kCapacity = 8;

  int count = 0;
  std::array<RangeFit<N>, kCapacity> fit;

  /// Adds `found` unless a minimum within `resolution` [m] is there already.
  void add(const RangeFit<N>& found, double resolution);
};

namespace internal {

/// Cost below which eq. (2.19) excludes a second position; negative if there is none.
template <int N>
[[nodiscard]] double strong_below(const RangeLayout<N>& layout, double side_margin);

/// Minima from SR-LS, its second solution, and the mirror image where `strong` does not exclude it.
template <int N>
[[nodiscard]] RangeMinima<N> find_minima(const RangeLayout<N>& layout, const RangesView& ranges,
                                         const RangeLoss& loss, double strong,
                                         RangeMl ml = RangeMl::kNewton);

/// Status of the best minimum, without a test of fit or of first order.
template <int N>
[[nodiscard]] PositionStatus judge(const RangeMinima<N>& minima, const RangeLayout<N>& layout,
                                   const RangesView& ranges, double side_margin);

/// Whether the cost three sigmas along the least certain direction does not rise by about nine: the
/// region that fits is longer than the covariance, or bent.
template <int N>
[[nodiscard]] bool defies_first_order(const RangeFit<N>& fit, const RangeLayout<N>& layout,
                                      const RangesView& ranges, const RangeLoss& loss);

/// Whether the information leaves a direction with a sigma beyond `reach` [m].
template <int N>
[[nodiscard]] bool leaves_open(const Matrix<N, N>& information, double reach);

/// Returns its argument. Throws std::invalid_argument outside (0, 1).
double checked_alarm(double false_alarm_probability);

/// Square of the normal quantile: eq. (2.20). Throws std::invalid_argument outside (0, 0.5).
[[nodiscard]] double side_margin(double wrong_side_probability);

}  // namespace internal

/// Range-only positioning over one set of anchors: SR-LS, then maximum likelihood, also from the
/// mirror image where that could fit as well. docs/models/ranges.md. No heap.
template <int N>
class Multilateration {
 public:
  struct Config {
    RangeLoss loss;
    PositionRules rules;
  };

  /// Throws std::invalid_argument on what `validate` refuses, a probability outside (0, 1) or a
  /// table that is not for positions of N dimensions. Copies what it needs.
  Multilateration(const AnchorTable& anchors, const RangesView& sigma, const Config& config);

  /// Position from one range per anchor [m]; NaN where none was received. Throws
  /// std::invalid_argument if a range is zero, negative or infinite, or their number is wrong.
  [[nodiscard]] RangePosition<N> solve(const RangesView& ranges) const;

  /// Position over other anchors by the same rules; every range is a positive number.
  [[nodiscard]] RangePosition<N> solve_over(const RangeLayout<N>& layout, const RangesView& ranges,
                                            RangeMl ml = RangeMl::kNewton) const {
    return solve_on(layout, ranges, internal::strong_below<N>(layout, side_margin_), ml);
  }

  /// View of the anchors, as they were given.
  [[nodiscard]] AnchorTable table() const;
  [[nodiscard]] const Ranges& sigma() const { return sigma_; }
  [[nodiscard]] const RangeLayout<N>& layout() const { return layout_; }
  [[nodiscard]] const Config& config() const { return config_; }
  /// Cost below which no other position can fit as well: eq. (2.19).
  [[nodiscard]] double strong_below() const { return strong_below_; }
  /// Minimum difference of costs that decides between two positions, eq. (2.20).
  [[nodiscard]] double side_margin() const { return side_margin_; }
  /// Maximum cost of good ranges by number of ranges, 0 to kMaxRanges.
  [[nodiscard]] double cost_limit(int ranges) const {
    return cost_limit_.at(static_cast<std::size_t>(ranges));
  }

 private:
  [[nodiscard]] RangePosition<N> solve_on(const RangeLayout<N>& layout, const RangesView& ranges,
                                          double strong, RangeMl ml) const;

  Config config_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaxRanges, 3> rows_;
  std::optional<double> height_;
  Ranges sigma_;
  RangeLayout<N> layout_;
  double side_margin_;
  double strong_below_;
  std::array<double, kMaxRanges + 1> cost_limit_;
};

}  // namespace locfuse
