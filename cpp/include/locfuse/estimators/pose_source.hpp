// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/types.hpp"
#include "locfuse/time.hpp"

namespace locfuse {

/// What is learnt of another localizer from its poses beside all else: how late its stamps are, how
/// much larger its errors are than it says, and whether they are new with each pose; eq. (3.2) to
/// (3.5) of docs/models/poses.md.
class PoseSource {
 public:
  PoseSource();

  /// One of its poses, beside where everything else but its poses says that the body is.
  struct Compared {
    Stamp stamp;
    Vector<3> off;      ///< of that, x, y and heading
    Vector<3> rate;     ///< of the body in world, per second
    Vector<3> changed;  ///< that rate less the mean since the last pose
    Matrix<3, 3> P;     ///< covariance of what everything else says
    Matrix<3, 3> R;     ///< that is reported
  };

  /// Factors of the variances that are reported, at least 1.
  [[nodiscard]] double position_factor() const { return position_.factor; }
  [[nodiscard]] double heading_factor() const { return heading_.factor; }
  /// Of the variance of x, y or heading.
  [[nodiscard]] double factor(Eigen::Index axis) const {
    return axis < 2 ? position_factor() : heading_factor();
  }

  /// How long before its stamp a pose is of [s].
  [[nodiscard]] double delay() const { return delay_; }
  /// What is not known of the way in that time, as variance of x, y and heading.
  [[nodiscard]] Matrix<3, 3> way_variance(const Vector<3>& rate, const Vector<3>& changed) const;
  /// `rate` less the mean rate of `body` since the last pose.
  [[nodiscard]] Vector<3> changed(Stamp stamp, const Vector<3>& body, const Vector<3>& rate) const;

  /// Whether errors are new with each pose. Not before that has been seen.
  [[nodiscard]] bool is_white() const;

  /// Whether the body has moved since that same pose was reported first, to the last digit.
  [[nodiscard]] bool is_frozen(const Pose2& z, const Pose2& body) const;
  /// When the last pose was fused.
  [[nodiscard]] std::optional<Stamp> stamp() const { return stamp_; }

  /// A pose was fused, with the body at `body`, and there by everything else.
  void take(Stamp stamp, const Pose2& z, const Pose2& body, const Vector<3>& place);
  /// All of its axes were measured.
  void learn(const Compared& z);
  /// The same beside what fused all of its poses so far.
  void learn_scale(const Compared& z);

  /// What everything else says was moved by `shift`: it is no error.
  void shift(const Vector<3>& shift) {
    before_ -= shift;
    mean_ -= shift;
    steady_ -= shift;
    place_ += shift;
  }

 private:
  struct Scale {
    double factor = 1.0;
    double count = 0.0;
    template <int N>
    void learn(const Vector<N>& off, const Matrix<N, N>& P, const Matrix<N, N>& R);
  };
  void learn_delay(const Compared& z, const Vector<3>& variances);

  Scale position_;
  Scale heading_;
  double delay_ = 0.0;
  double delay_variance_;
  Vector<3> before_ = Vector<3>::Zero();  // off, of the last pose
  Vector<3> change_ = Vector<3>::Zero();  // since the one before it, in sigma
  int poses_ = 0;                         // up to 2, so that there is a change to compare with
  double products_ = 0.0;                 // of successive changes
  double squares_ = 0.0;
  double count_ = 0.0;
  Vector<3> mean_ = Vector<3>::Zero();  // off
  double averaged_ = 0.0;
  bool is_offset_ = false;
  Vector<3> steady_ = Vector<3>::Zero();  // off, of the last pose at a steady rate
  Vector<3> steady_rate_ = Vector<3>::Zero();
  std::optional<Stamp> steady_stamp_;
  std::optional<Stamp> stamp_;           // of the last pose
  Vector<3> place_ = Vector<3>::Zero();  // then, by everything else
  Pose2 last_;
  Pose2 body_;  // when that was reported first
};

}  // namespace locfuse
