// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/gyro_odometry.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "estimators/recipe.hpp"
#include "locfuse/geometry/pose2.hpp"
#include "locfuse/math/angle.hpp"
#include "math/sigma.hpp"

namespace locfuse {
namespace {

/// Constants that are not settings; docs/models/motion.md.
struct Tuning {
  static constexpr double kGravity = 9.81;          ///< [m/s^2]
  static constexpr double kGravityBand = 2.5;       ///< specific force beyond it shows no vertical
  static constexpr double kUpSeconds = 5.0;         ///< time constant of the vertical [s]
  static constexpr Stamp kMaxGap = 100'000'000;     ///< between samples [ns]
  static constexpr Stamp kMaxHold = 1'000'000'000;  ///< of a velocity, and of samples kept [ns]
  static constexpr double kWindow = 0.5;            ///< over which turns are compared [s]
  static constexpr double kGate = 10.83;            ///< chi-square of one row at 0.999
  static constexpr double kCalmAfter = 0.5;         ///< that ends a contradiction [s]
  static constexpr double kNeitherAfter = 5.0;      ///< of contradiction: the gyro may be wrong [s]
  static constexpr double kNeitherBefore = 10.0;  ///< of agreement: what is known may be wrong [s]
  static constexpr double kMinRelearn = 5.0;      ///< of contradiction: as at the start [s]
  static constexpr double kMaxRelearn = 15.0;     ///< or as long as they agreed, up to that [s]
  static constexpr double kWider = 5.0;           ///< sigma of the bias then
  static constexpr double kFloor = 1e-4;          ///< sigma of the turn that wheels report [rad]
  static constexpr double kBiasLasts = 60.0;      ///< that the rest of the bias lasts at most [s]
  static constexpr double kScaleLasts = kPi;      ///< what is left of a scale, as noise [rad]
  static constexpr double kSlip = 0.25;           ///< sigma of the way of wheels that slip
  static constexpr double kSlipLasts = 3.0;       ///< for how long [s]
  static constexpr double kMaxTurn = 1e3;         ///< of a motion that can be compared [rad]
  static constexpr double kMaxVariance = 1e6;     ///< of its turn [rad^2]
  static constexpr double kMinVariance = 1e-30;   ///< of bias and scale, where rounding left less
  static constexpr std::size_t kFrozenSamples = 10;  ///< of one value: the gyro has stopped
};

GyroOdometry::Config checked(const GyroOdometry::Config& c) {
  internal::positive("gyro.sigma_turn_per_sqrt_s", c.sigma_turn_per_sqrt_s);
  internal::positive("gyro.sigma_bias_radps", c.sigma_bias_radps);
  internal::sigma_in_bounds("gyro.sigma_turn_per_sqrt_s", c.sigma_turn_per_sqrt_s);
  internal::sigma_in_bounds("gyro.sigma_bias_radps", c.sigma_bias_radps);
  internal::sigma_in_bounds("gyro.sigma_bias_radps_per_sqrt_s", c.sigma_bias_radps_per_sqrt_s);
  internal::sigma_in_bounds("gyro.sigma_scale", c.sigma_scale);
  internal::sigma_in_bounds("gyro.sigma_turn_scale", c.sigma_turn_scale);
  return c;
}

/// A motion with another turn: the direction of travel deviates by half of what that corrects.
Increment turned_by(double turn, const Increment& wheels, const Vector<3>& variance) {
  const Pose2 aside{0.0, 0.0, 0.5 * (turn - wheels.motion.heading)};
  const Vector<2> way = aside.act(wheels.motion.position());
  return {wheels.begin, wheels.stamp, {way.x(), way.y(), wrap_angle(turn)}, variance};
}

}  // namespace

GyroOdometry::GyroOdometry(const Config& config)
    : config_(checked(config)), wheels_(config.odometry) {
  start_learning(config_.sigma_bias_radps);
}

double GyroOdometry::sigma_bias() const { return std::sqrt(P_(0, 0)); }

/// Nothing is known of bias and scale but their sigmas.
void GyroOdometry::start_learning(double sigma_bias) {
  x_.setZero();
  P_ << sigma_bias * sigma_bias, 0.0, 0.0, config_.sigma_turn_scale * config_.sigma_turn_scale;
  difference_ = variance_ = contradicted_s_ = calm_s_ = agreed_s_ = age_s_ = rate_ = 0.0;
  H_.setZero();
}

/// Follows the vertical, eq. (2.1), and takes the rate about it.
void GyroOdometry::on(const Imu& z) {
  validate(z);
  if (!samples_.empty() && z.stamp <= samples_.back().stamp) {
    return;
  }
  const double seconds =
      samples_.empty() ? 0.0 : std::min(1.0, seconds_between(samples_.back().stamp, z.stamp));
  up_ -= seconds * z.angular_rate.cross(up_);
  if (z.specific_force) {
    const double force = z.specific_force->norm();
    if (std::abs(force - Tuning::kGravity) < Tuning::kGravityBand) {
      const double gain = has_up_ ? seconds / (Tuning::kUpSeconds + seconds) : 1.0;
      up_ += gain * (*z.specific_force / force - up_);
      has_up_ = true;
    }
  }
  up_.normalize();
  samples_.push_back({z.stamp, z.angular_rate.dot(up_)});
  if (samples_.back().stamp - samples_.front().stamp > 2 * Tuning::kMaxHold) {  // no wheels
    const auto first = std::find_if(samples_.begin(), samples_.end(), [&](const Sample& sample) {
      return sample.stamp >= samples_.back().stamp - Tuning::kMaxHold;
    });
    samples_.erase(samples_.begin(), first);
  }
}

std::optional<GyroOdometry::Motion> GyroOdometry::on(const Velocity& u) {
  validate(u);
  const std::optional<Velocity> before = held_;
  if (before && u.stamp <= before->stamp) {
    return std::nullopt;
  }
  held_ = u;
  if (!before || u.stamp - before->stamp > Tuning::kMaxHold) {
    return std::nullopt;
  }
  const double seconds = seconds_between(before->stamp, u.stamp);
  return turned(
      before->stamp, u.stamp,
      arc(before->forward * seconds, before->left * seconds, before->turn_rate * seconds));
}

std::optional<GyroOdometry::Motion> GyroOdometry::on(const Increment& u) {
  validate(u);
  return turned(u.begin, u.stamp, u.motion);
}

/// The motion with its turn by both; as it came where no sample is near.
GyroOdometry::Motion GyroOdometry::turned(Stamp begin, Stamp stamp, const Pose2& motion) {
  const Increment wheels{begin, stamp, motion};
  const std::optional<double> measured = turn_between(begin, stamp);
  Motion found = measured ? combined(wheels, *measured) : Motion{Verdict::kNoGyro, wheels};
  const auto next =
      std::upper_bound(samples_.begin(), samples_.end(), stamp,
                       [](Stamp s, const Sample& sample) { return s < sample.stamp; });
  if (next - samples_.begin() > 1) {  // the one before the end stays
    samples_.erase(samples_.begin(), next - 1);
  }
  return found;
}

/// The turn by both, eq. (2.2) to (2.7).
GyroOdometry::Motion GyroOdometry::combined(const Increment& wheels, double measured) {
  const Pose2& motion = wheels.motion;
  const double seconds = seconds_between(wheels.begin, wheels.stamp);
  P_(0, 0) += config_.sigma_bias_radps_per_sqrt_s * config_.sigma_bias_radps_per_sqrt_s * seconds;
  age_s_ += seconds;
  const double by_gyro = measured - x_(0) * seconds;
  // Noise follows the turn of the last half second: that of one motion has the noise of the
  // difference, and would make it weigh most where it is smallest.
  const bool stands = motion.heading == 0.0 && motion.position().squaredNorm() == 0.0;
  rate_ += (1.0 - std::exp(-seconds / Tuning::kWindow)) * (by_gyro / seconds - rate_);
  if (!(std::abs(rate_) * std::max(seconds, Tuning::kWindow) < Tuning::kMaxTurn)) {
    rate_ = 0.0;
    return {Verdict::kNoGyro, wheels};
  }
  const double mean_turn = stands ? 0.0 : rate_ * seconds;
  Vector<3> variance =
      wheels_.propagate(Pose2{}, {motion.x, motion.y, mean_turn}, seconds).noise.diagonal();
  const double wheels_white = variance.z() + Tuning::kFloor * Tuning::kFloor;
  const double gyro_white =
      config_.sigma_turn_per_sqrt_s * config_.sigma_turn_per_sqrt_s * seconds +
      config_.sigma_scale * config_.sigma_scale * Tuning::kScaleLasts * std::abs(mean_turn);

  const Vector<2> H(seconds, mean_turn);
  const double difference = measured - motion.heading;
  const double white = gyro_white + wheels_white;
  if (!(white < Tuning::kMaxVariance && std::abs(difference) < Tuning::kMaxTurn)) {
    return {Verdict::kNoGyro, wheels};
  }
  if (contradicts(difference, H, white, seconds)) {
    if (is_frozen()) {
      return {Verdict::kNoGyro, wheels};
    }
    const double slip = Tuning::kSlip * motion.position().norm() / seconds;
    variance.head<2>().array() += slip * slip * Tuning::kSlipLasts * seconds;
    variance.z() = gyro_white + lasting_bias(seconds);
    if (contradicted_s_ > Tuning::kNeitherAfter || agreed_s_ < Tuning::kNeitherBefore) {
      const double rate = difference_ / Tuning::kWindow;
      variance.z() += rate * rate * Tuning::kNeitherAfter * seconds;
    }
    if (contradicted_s_ > std::clamp(agreed_s_, Tuning::kMinRelearn, Tuning::kMaxRelearn)) {
      start_learning(Tuning::kWider * config_.sigma_bias_radps);
    }
    return {Verdict::kSlipped, turned_by(by_gyro, wheels, variance)};
  }
  agreed_s_ += seconds;
  learn(difference, H, white);
  const double gyro_variance = gyro_white + lasting_bias(seconds);
  const double wheels_variance =
      wheels_white + P_(1, 1) * Tuning::kScaleLasts * std::abs(mean_turn);
  const double of_gyro =
      config_.turn == Turn::kAverage ? 0.5 : wheels_variance / (gyro_variance + wheels_variance);
  const double of_wheels = 1.0 - of_gyro;
  variance.z() = of_gyro * of_gyro * gyro_variance + of_wheels * of_wheels * wheels_variance;
  const double turn =
      of_gyro * (measured - x_(0) * seconds) + of_wheels * (1.0 + x_(1)) * motion.heading;
  return {Verdict::kTurned, turned_by(turn, wheels, variance)};
}

/// What is left of the bias adds up, not as noise does: its variance after a time t is P t^2, which
/// grows by 2 P t per second, eq. (2.7).
double GyroOdometry::lasting_bias(double seconds) const {
  return P_(0, 0) * seconds * (seconds + 2.0 * std::min(age_s_, Tuning::kBiasLasts));
}

/// Integral of the rate by trapezoids; the first and the last sample hold for kMaxGap at most.
std::optional<double> GyroOdometry::turn_between(Stamp begin, Stamp end) const {
  if (end <= begin || samples_.empty() || samples_.front().stamp > begin + Tuning::kMaxGap ||
      samples_.back().stamp < end - Tuning::kMaxGap) {
    return std::nullopt;
  }
  double turn = 0.0;
  Stamp at = begin;
  for (std::size_t k = 0; k < samples_.size() && at < end; ++k) {
    const Sample& sample = samples_[k];
    if (k > 0 && sample.stamp > at) {
      const Sample& before = samples_[k - 1];
      if (sample.stamp - before.stamp > Tuning::kMaxGap) {
        return std::nullopt;
      }
      const double slope =
          (sample.rate - before.rate) / seconds_between(before.stamp, sample.stamp);
      const double rate = before.rate + slope * seconds_between(before.stamp, at);
      const Stamp until = std::min(sample.stamp, end);
      const double rate_then = before.rate + slope * seconds_between(before.stamp, until);
      turn += 0.5 * (rate + rate_then) * seconds_between(at, until);
      at = until;
    } else if (k == 0 && sample.stamp > at) {
      const Stamp until = std::min(sample.stamp, end);
      turn += sample.rate * seconds_between(at, until);
      at = until;
    }
  }
  if (at < end) {
    turn += samples_.back().rate * seconds_between(at, end);
  }
  return turn;
}

bool GyroOdometry::is_frozen() const {
  return samples_.size() >= Tuning::kFrozenSamples &&
         std::all_of(samples_.begin(), samples_.end(),
                     [&](const Sample& one) { return one.rate == samples_.front().rate; });
}

/// Whether the turns of the last half second differ by more than their variances explain, eq.
/// (2.4).
bool GyroOdometry::contradicts(double difference, const Vector<2>& H, double variance,
                               double seconds) {
  const double kept = std::exp(-seconds / Tuning::kWindow);
  difference_ = kept * difference_ + difference;
  H_ = kept * H_ + H;
  variance_ = kept * variance_ + variance;
  const double innovation = difference_ - H_.dot(x_);
  const double limit = Tuning::kGate * (variance_ + H_.dot(P_ * H_));
  if (innovation * innovation > limit) {
    contradicted_s_ += seconds;
    calm_s_ = 0.0;
  } else if (contradicted_s_ > 0.0) {
    calm_s_ += seconds;
    contradicted_s_ = calm_s_ < Tuning::kCalmAfter ? contradicted_s_ : 0.0;
  }
  return contradicted_s_ > 0.0;
}

/// Learns bias and scale from a difference, eq. (2.5).
void GyroOdometry::learn(double difference, const Vector<2>& H, double variance) {
  const Vector<2> PH = P_ * H;
  const double S = H.dot(PH) + variance;
  const Vector<2> K = PH / S;
  x_ += K * (difference - H.dot(x_));
  const double before = P_(0, 0);
  P_ -= K * PH.transpose();
  P_.diagonal() = P_.diagonal().cwiseMax(Tuning::kMinVariance);
  age_s_ *= P_(0, 0) / before;
  P_ = 0.5 * (P_ + P_.transpose()).eval();
}

}  // namespace locfuse
