// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "locfuse/filters/correlated_errors.hpp"
#include "locfuse/filters/covariance.hpp"
#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/types.hpp"
#include "locfuse/time.hpp"

namespace locfuse {

/// What a slot of a belief holds.
enum class SlotKind : std::uint8_t {
  kPose2,   ///< x, y, heading; the third row is an angle
  kPoint2,  ///< x, y
  kScalar,  ///< one number, such as a height or an error of a sensor
  kPoint3,  ///< three numbers, such as the errors of a sensor along its axes
};

[[nodiscard]] constexpr int dimension_of(SlotKind kind) {
  switch (kind) {
    case SlotKind::kPose2:
    case SlotKind::kPoint3:
      return 3;
    case SlotKind::kPoint2:
      return 2;
    default:
      return 1;
  }
}

/// Standard deviations between which the filter keeps a variable, in its own unit:
/// docs/models/updates.md. Below `min` an update is lost to rounding beside the largest
/// there are, and above `max` one with a sigma of 1 mm would be; a heading that is as
/// unknown is anywhere.
struct SigmaBounds {
  double min;
  double max;
};
inline constexpr SigmaBounds kPositionBounds{1e-6, 1e4};  ///< [m], and velocities of points [m/s]
inline constexpr SigmaBounds kHeadingBounds{1e-7, 10.0};  ///< [rad]
inline constexpr SigmaBounds kScalarBounds{1e-9, 1e4};    ///< such as a height or a sensor's error

/// Handle of a variable in a belief. An id, not an offset: removing one never invalidates another,
/// nor is its own given again.
struct Slot {
  int id = 0;
};

/// Several slots in the order of a model's Jacobian columns. A view: use it as an argument only.
class Slots {
 public:
  Slots(const Slot& slot) : first_(&slot), size_(1) {}  // NOLINT: reads best
  Slots(const std::vector<Slot>& slots) : first_(slots.data()), size_(slots.size()) {}  // NOLINT
  [[nodiscard]] const Slot* begin() const { return first_; }
  [[nodiscard]] const Slot* end() const { return first_ + size_; }

 private:
  const Slot* first_;
  std::size_t size_;
};

/// Gaussian over named slots at one stamp: mean x, covariance P of the error state (positions in
/// world, headings separately).
///
/// Only the functions of filters/kalman.hpp write it. Copying it is a snapshot; assigning one of
/// the same size allocates nothing.
class GaussianBelief {
 public:
  /// One pose, named `body`. Throws std::invalid_argument unless `pose` is finite and `covariance`
  /// is symmetric positive definite.
  static GaussianBelief of_pose(Stamp stamp, const Pose2& pose, const Matrix<3, 3>& covariance);

  /// Adds an uncorrelated variable. Throws std::invalid_argument on a name that is taken, a size
  /// that does not fit, numbers that are not finite or a covariance that is not positive definite.
  Slot add(const std::string& name, SlotKind kind, const Eigen::Ref<const Eigen::VectorXd>& mean,
           const Eigen::Ref<const Eigen::MatrixXd>& covariance);

  /// Marginalises a variable out. Throws std::invalid_argument if it is not there.
  void remove(Slot slot);

  /// From now on no measurement moves this variable: what is not known of it is accounted for, and
  /// never learnt (Schmidt); eq. (1.16) of docs/models/updates.md. Throws std::invalid_argument if
  /// it is not there.
  void consider(Slot slot);

  /// The slot of that name. Throws std::invalid_argument, listing the names there are.
  [[nodiscard]] Slot slot(const std::string& name) const;

  /// Row of the slot's first variable. Throws std::invalid_argument if it was removed.
  [[nodiscard]] int offset(Slot slot) const { return variable(slot).offset; }
  [[nodiscard]] SlotKind kind(Slot slot) const { return variable(slot).kind; }
  [[nodiscard]] int dimension() const { return static_cast<int>(x.size()); }

  /// Throws std::invalid_argument if the slot is not a pose.
  [[nodiscard]] Pose2 pose(Slot slot) const {
    const Variable& v = variable(slot);
    if (v.kind != SlotKind::kPose2) {
      throw std::invalid_argument("slot '" + v.name + "' is not a pose");
    }
    return {x(v.offset), x(v.offset + 1), x(v.offset + 2)};
  }
  /// Mean and covariance of some variables, in the order asked for; with what correlated errors
  /// add to P.
  [[nodiscard]] Eigen::VectorXd mean(Slots slots) const;
  [[nodiscard]] Eigen::MatrixXd marginal(Slots slots) const;
  /// That of the first N variables.
  template <int N>
  [[nodiscard]] Matrix<N, N> marginal_of_first() const {
    const Matrix<N, N> own = P.template topLeftCorner<N, N>();
    return correlated.is_empty()
               ? own
               : with_excess<N>(own, correlated.excess().template topLeftCorner<N, N>());
  }

  /// A covariance and what correlated errors add to it, or the first alone if the sum is none.
  template <int N>
  [[nodiscard]] static Matrix<N, N> with_excess(const Matrix<N, N>& own,
                                                const Matrix<N, N>& excess) {
    const Matrix<N, N> all = own + 0.5 * (excess + excess.transpose());
    return all.allFinite() && all.llt().info() == Eigen::Success ? all : own;
  }

  /// Rows of all these slots, in order.
  [[nodiscard]] std::vector<int> rows(Slots slots) const;
  /// Whether these slots, in this order, are all there is, of `dimension` rows.
  [[nodiscard]] bool is_whole(Slots slots, int dimension) const {
    int next = 0;
    for (const Slot slot : slots) {
      const Variable& v = variable(slot);
      if (v.offset != next) {
        return false;
      }
      next += dimension_of(v.kind);
    }
    return next == dimension && x.size() == dimension;
  }
  /// Rows that are angles.
  [[nodiscard]] const std::vector<int>& angle_rows() const { return layout_->angle_rows; }
  /// Rows that no measurement moves.
  [[nodiscard]] const std::vector<int>& considered_rows() const { return layout_->considered_rows; }

  /// Variances between which each row is kept.
  [[nodiscard]] const std::vector<SigmaBounds>& variance_bounds() const {
    return layout_->variance_bounds;
  }

  Stamp stamp = 0;
  Eigen::VectorXd x;                ///< mean, angles wrapped
  Covariance P;                     ///< of the error state, were all errors independent
  CorrelatedErrors correlated;      ///< what those that are not add to it
  std::uint64_t interventions = 0;  ///< how often the filter put a variance back into its bounds

 private:
  struct Variable {
    int id;  // of its slot
    std::string name;
    SlotKind kind;
    int offset;
    bool considered = false;
  };
  struct Layout {
    std::vector<Variable> variables;  // ascending, id and offset
    int next_id = 0;
    std::vector<int> angle_rows;
    std::vector<int> considered_rows;
    std::vector<SigmaBounds> variance_bounds;
  };
  /// Where all that were added are still there, the id is the index.
  [[nodiscard]] std::size_t index_of(Slot slot) const {
    const std::vector<Variable>& all = layout_->variables;
    auto index = static_cast<std::size_t>(slot.id);
    if (index >= all.size() || all[index].id != slot.id) {
      const auto found = std::lower_bound(all.begin(), all.end(), slot.id,
                                          [](const Variable& v, int id) { return v.id < id; });
      if (found == all.end() || found->id != slot.id) {
        throw std::invalid_argument("slot " + std::to_string(slot.id) + " is not in this belief");
      }
      index = static_cast<std::size_t>(found - all.begin());
    }
    return index;
  }
  [[nodiscard]] const Variable& variable(Slot slot) const {
    return layout_->variables[index_of(slot)];
  }
  Layout& own_layout();
  void find_rows();

  std::shared_ptr<Layout> layout_ = std::make_shared<Layout>();  // written only while not shared
};

}  // namespace locfuse
