// SPDX-License-Identifier: Apache-2.0
#include "locfuse/estimators/scan_drive.hpp"

#include <algorithm>

#include "locfuse/geometry/pose2.hpp"

namespace locfuse {
namespace {

struct ScanDriveTuning {
  static constexpr double kMeasured = 0.1;  ///< a velocity by scans is measured over so long [s]
  static constexpr Stamp kHold = 1'000'000'000;  ///< wheels that are silent for longer say nothing
  /// How long a second laser waits for the first to measure a velocity [s].
  static constexpr double kPatience = 1.0;
  /// How much a body may change its velocity between two scans, where no wheels measure it.
  static constexpr double kSigmaSpeed = 0.5;     ///< [m/s]
  static constexpr double kSigmaTurnRate = 0.5;  ///< [rad/s]
  /// Change of a velocity by scans, in those sigmas, from which on it is a jump of the body.
  static constexpr double kJump = 6.0;
};

Pose2 driven(const Vector<3>& rate, double seconds) {
  return arc(rate.x() * seconds, rate.y() * seconds, rate.z() * seconds);
}

Vector<3> rate_of(const Pose2& motion, double seconds) {
  return seconds > 0.0 ? Vector<3>(arc_twist(motion) / seconds) : Vector<3>::Zero();
}

}  // namespace

ScanDrive::ScanDrive(const Config& config) : model_(config.odometry), odometry_(config.scans) {}

void ScanDrive::on(const Velocity& u) {
  validate(u);
  if (take_wheels(u.stamp, u.stamp)) {
    rate_ = {u.forward, u.left, u.turn_rate};
  }
}

void ScanDrive::on(const Increment& u) {
  validate(u);
  if (take_wheels(u.begin, u.stamp)) {
    rate_ = rate_of(u.motion, seconds_between(u.begin, u.stamp));
    moved_ = moved_ * u.motion;
  }
}

bool ScanDrive::has_wheels_at(Stamp stamp) const {
  return wheels_ && stamp <= *wheels_ + ScanDriveTuning::kHold;
}

/// Goes on by the rate of the wheels to where their next motion begins.
bool ScanDrive::take_wheels(Stamp begin, Stamp stamp) {
  if (wheels_ && begin < *wheels_) {
    return false;
  }
  if (wheels_) {
    const Stamp held = std::min(begin, *wheels_ + ScanDriveTuning::kHold);
    moved_ = moved_ * driven(rate_, seconds_between(*wheels_, held));
  }
  wheels_ = stamp;
  return true;
}

std::optional<Increment> ScanDrive::on(const LaserScan& z) {
  validate(z);
  const bool has_wheels = has_wheels_at(z.stamp);
  const std::optional<LaserScan> turned = as_of_stamp(z, turn_rate_at(z.stamp));
  const LaserScan& scan = turned ? *turned : z;
  if (!at_) {
    fit(scan, {});
    at_ = scan.stamp;
    moved_ = {};
    return std::nullopt;
  }
  if (odometry_.is_late(scan)) {
    return std::nullopt;
  }
  if (scan.stamp == *at_) {
    correct(scan);
    return std::nullopt;
  }
  const double seconds = seconds_between(*at_, scan.stamp);
  if (!has_wheels && !has_twist_ && seconds <= ScanDriveTuning::kPatience &&
      odometry_.is_of_new_laser(scan)) {
    return std::nullopt;
  }
  const Guess guess = has_wheels ? by_wheels(scan.stamp, seconds) : by_scans(seconds);
  const ScanMotion& fitted = fit(scan, guess);
  Increment found{*at_, scan.stamp, fitted.increment.motion};
  if (correction_) {
    found.motion = *correction_ * found.motion;
    correction_.reset();
  }
  at_ = scan.stamp;
  if (fitted.match.converged) {
    follow(found.motion, seconds);
  }
  return found;
}

const ScanMotion& ScanDrive::fit(const LaserScan& scan, const Guess& guess) {
  fit_ = odometry_.on(scan, guess.motion, guess.covariance);
  ++used_;
  return *fit_;
}

/// Takes a scan of the last stamp by another laser, from where the last one left the body.
void ScanDrive::correct(const LaserScan& scan) {
  correction_ = correction_.value_or(Pose2{}) * fit(scan, {}).increment.motion;
}

/// Measures the velocity over a while: scans may come at once, and each is off a little.
void ScanDrive::follow(const Pose2& motion, double seconds) {
  since_ = since_ * motion;
  seconds_ += seconds;
  if (seconds_ >= ScanDriveTuning::kMeasured) {
    const Vector<3> rate = rate_of(since_, seconds_);
    const Vector<3> sigma(ScanDriveTuning::kSigmaSpeed, ScanDriveTuning::kSigmaSpeed,
                          ScanDriveTuning::kSigmaTurnRate);
    const bool is_jump =
        has_twist_ &&
        ((rate - twist_).cwiseAbs().array() > ScanDriveTuning::kJump * sigma.array()).any();
    has_twist_ = !is_jump;
    twist_ = is_jump ? Vector<3>(Vector<3>::Zero()) : rate;
    since_ = {};
    seconds_ = 0.0;
  }
}

/// The motion since the last scan; what is beyond it is kept.
ScanDrive::Guess ScanDrive::by_wheels(Stamp stamp, double seconds) {
  const Pose2 beyond = driven(rate_, seconds_between(stamp, *wheels_));
  const Pose2 motion = moved_ * inverse(beyond);
  moved_ = beyond;
  return {motion, model_.propagate(Pose2{}, motion, seconds).noise};
}

ScanDrive::Guess ScanDrive::by_scans(double seconds) const {
  const Vector<3> sigma =
      seconds * Vector<3>(ScanDriveTuning::kSigmaSpeed, ScanDriveTuning::kSigmaSpeed,
                          ScanDriveTuning::kSigmaTurnRate);
  const double held = std::min(seconds, 1e-9 * static_cast<double>(ScanDriveTuning::kHold));
  return {driven(twist_, held), sigma.cwiseAbs2().asDiagonal()};
}

}  // namespace locfuse
