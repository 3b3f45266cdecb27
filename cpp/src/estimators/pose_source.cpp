// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/pose_source.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "locfuse/math/angle.hpp"

namespace locfuse {
namespace {

/// How the errors of a source of poses are learnt; docs/models/poses.md.
struct PoseSourceTuning {
  static constexpr double kPrior = 10.0;    ///< poses that the reported covariance counts as
  static constexpr double kMemory = 200.0;  ///< poses
  static constexpr double kMaxNisPerRow = 9.0;
  static constexpr double kMaxFactor = 1e4;
  static constexpr double kMaxChange = 6.0;  ///< in sigma; larger ones count as this
  /// Of successive changes, -1/2 where errors are white: so far an average of such errors has the
  /// variance that it claims.
  static constexpr double kWhite = -1.0 / 3.0;
  static constexpr double kSigmaDelay = 0.2;      ///< before anything is known [s]
  static constexpr double kMinSigmaDelay = 0.01;  ///< [s]
  static constexpr double kAveraged = 20.0;       ///< poses
  /// NIS of three components: one of a thousand is larger.
  static constexpr double kMaxNis = 16.27;
  static constexpr double kFrozenMotion = 0.1;  ///< [m or rad]
  static constexpr double kMaxAge_s = 5.0;      ///< of a pose that another is compared with
};

}  // namespace

template <int N>
void PoseSource::Scale::learn(const Vector<N>& off, const Matrix<N, N>& P, const Matrix<N, N>& R) {
  const Matrix<N, N> noise = factor * R;
  const Eigen::LLT<Matrix<N, N>> S(P + noise);
  if (S.info() != Eigen::Success) {
    return;
  }
  const double nis =
      std::min(S.matrixL().solve(off).squaredNorm() / N, PoseSourceTuning::kMaxNisPerRow);
  const double of_noise = S.solve(noise).trace() / N;
  const double step = of_noise * (nis - 1.0) / (PoseSourceTuning::kPrior + count);
  if (!std::isfinite(step)) {
    return;
  }
  factor = std::clamp(factor * (1.0 + step), 1.0, PoseSourceTuning::kMaxFactor);
  count = std::min(count + of_noise, PoseSourceTuning::kMemory - PoseSourceTuning::kPrior);
}

PoseSource::PoseSource() : delay_variance_(std::pow(PoseSourceTuning::kSigmaDelay, 2)) {}

bool PoseSource::is_white() const {
  return !is_offset_ && squares_ > 0.0 &&
         products_ / squares_ + 1.0 / std::sqrt(count_) < PoseSourceTuning::kWhite;
}

bool PoseSource::is_frozen(const Pose2& z, const Pose2& body) const {
  if (!stamp_ || z.x != last_.x || z.y != last_.y || z.heading != last_.heading) {
    return false;
  }
  const Vector<3> moved = local(body_, body);
  return moved.head<2>().norm() > PoseSourceTuning::kFrozenMotion ||
         std::abs(moved.z()) > PoseSourceTuning::kFrozenMotion;
}

void PoseSource::take(Stamp stamp, const Pose2& z, const Pose2& body, const Vector<3>& place) {
  if (!stamp_ || z.x != last_.x || z.y != last_.y || z.heading != last_.heading) {
    last_ = z;
    body_ = body;
  }
  stamp_ = stamp;
  place_ = place;
}

Vector<3> PoseSource::changed(Stamp stamp, const Vector<3>& body, const Vector<3>& rate) const {
  if (!stamp_ || stamp <= *stamp_) {
    return rate;
  }
  Vector<3> moved = body - place_;
  moved.z() = wrap_angle(moved.z());
  return rate - moved / seconds_between(*stamp_, stamp);
}

Matrix<3, 3> PoseSource::way_variance(const Vector<3>& rate, const Vector<3>& changed) const {
  return delay_variance_ * rate * rate.transpose() +
         (delay_variance_ + delay_ * delay_) * changed * changed.transpose();
}

void PoseSource::learn_scale(const Compared& z) {
  const Vector<3> off = z.off + delay_ * z.rate;
  const Matrix<3, 3> P = z.P + way_variance(z.rate, z.changed);
  const double before = position_.factor;
  position_.learn<2>(off.head<2>(), P.topLeftCorner<2, 2>(), z.R.topLeftCorner<2, 2>());
  // Headings may say little of their own errors, and a localizer is seldom too sure of one alone.
  heading_.factor = std::max(1.0, heading_.factor * position_.factor / before);
  heading_.learn<1>(off.tail<1>(), P.bottomRightCorner<1, 1>(), z.R.bottomRightCorner<1, 1>());
}

/// Of two poses at rates that differ, each as it has been since the pose before: what stays
/// in their errors plays no part.
void PoseSource::learn_delay(const Compared& z, const Vector<3>& variances) {
  const Vector<3> lag = PoseSourceTuning::kSigmaDelay * z.changed;
  constexpr double kSteady = 0.25;  // half a sigma
  if ((lag.array().square() > kSteady * variances.array()).any()) {
    return;
  }
  const Vector<3> of_rate = z.rate - steady_rate_;
  const Vector<3> change = z.off - steady_ + delay_ * of_rate;
  const bool is_comparable =
      steady_stamp_ && seconds_between(*steady_stamp_, z.stamp) < PoseSourceTuning::kMaxAge_s;
  steady_ = z.off;
  steady_rate_ = z.rate;
  steady_stamp_ = z.stamp;
  if (!is_comparable) {
    return;
  }
  Matrix<3, 3> noise = delay_variance_ * of_rate * of_rate.transpose();
  noise.diagonal() += 2.0 * variances;
  const Eigen::LLT<Matrix<3, 3>> S(noise);
  const double nis = S.matrixL().solve(change).squaredNorm();
  const Vector<3> gain =
      S.solve(of_rate) * delay_variance_ / std::max(1.0, nis / PoseSourceTuning::kMaxNis);
  if (S.info() != Eigen::Success || !gain.allFinite()) {
    return;
  }
  delay_ -= gain.dot(change);
  delay_variance_ = std::max(delay_variance_ * (1.0 - gain.dot(of_rate)),
                             std::pow(PoseSourceTuning::kMinSigmaDelay, 2));
}

void PoseSource::learn(const Compared& z) {
  learn_scale(z);
  const Vector<3> off = z.off + delay_ * z.rate;
  const Vector<3> variances(position_.factor * z.R(0, 0), position_.factor * z.R(1, 1),
                            heading_.factor * z.R(2, 2));
  averaged_ = std::min(averaged_ + 1.0, PoseSourceTuning::kAveraged);
  mean_ += (off - mean_) / averaged_;
  Matrix<3, 3> of_mean = z.P;
  of_mean.diagonal() += variances / averaged_;
  const Eigen::LLT<Matrix<3, 3>> S(of_mean);
  is_offset_ = !(S.info() == Eigen::Success &&
                 S.matrixL().solve(mean_).squaredNorm() < PoseSourceTuning::kMaxNis);
  if (poses_ > 0) {
    const Vector<3> change = ((off - before_).array() / variances.array().sqrt())
                                 .max(-PoseSourceTuning::kMaxChange)
                                 .min(PoseSourceTuning::kMaxChange);
    if (poses_ > 1) {
      constexpr double kKept = 1.0 - 1.0 / PoseSourceTuning::kMemory;
      products_ = kKept * products_ + change.dot(change_);
      squares_ = kKept * squares_ + 0.5 * (change.squaredNorm() + change_.squaredNorm());
      count_ = kKept * count_ + 3.0;
    }
    change_ = change;
  }
  before_ = off;
  poses_ += poses_ < 2 ? 1 : 0;
  learn_delay(z, variances);
}

}  // namespace locfuse
