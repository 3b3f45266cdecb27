// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include "locfuse/frontends/scan_odometry.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// Odometry of the scans of one or several lasers, where the motion by wheels, if there are any, is
/// where a fit begins; docs/models/scans.md, "As the odometry of a run".
///
/// Without wheels, or while they are silent for more than a second, the body is expected to go on
/// as it did in the last scans, give or take 0.5 m/s and 0.5 rad/s. Feed messages in order of
/// arrival. A value: copying it is a snapshot.
class ScanDrive {
 public:
  struct Config {
    ScanOdometryConfig scans;
    OdometryMotion::Config odometry;  ///< noise of the wheels
  };

  ScanDrive() : ScanDrive(Config{}) {}
  /// Throws std::invalid_argument on a setting out of bounds.
  explicit ScanDrive(const Config& config);

  /// Takes the motion of the wheels; one that begins before the end of the last is dropped. Throws
  /// std::invalid_argument if it is not valid.
  void on(const Velocity& u);
  void on(const Increment& u);
  /// Puts the beams where the body was at the stamp, by how fast it turns now, and returns the
  /// motion since the last scan used; empty for the first one, for one that is late,
  /// and for one of another laser at the same stamp, whose correction the next motion has. Without
  /// wheels a second laser is used once scans of the first have shown how the body moves. Throws
  /// std::invalid_argument if it is not valid.
  std::optional<Increment> on(const LaserScan& z);

  /// How many scans were used, and how the last of them was fitted.
  [[nodiscard]] std::size_t used() const { return used_; }
  [[nodiscard]] const std::optional<ScanMotion>& fit() const { return fit_; }
  /// Whether wheels say how the body moves at a stamp that comes next.
  [[nodiscard]] bool has_wheels_at(Stamp stamp) const;
  /// How fast the body turns at a stamp that comes next, by wheels or else by scans [rad/s].
  [[nodiscard]] double turn_rate_at(Stamp stamp) const {
    return has_wheels_at(stamp) ? rate_.z() : twist_.z();
  }

 private:
  /// A motion and the covariance of its (x, y, heading).
  struct Guess {
    Pose2 motion;
    Matrix<3, 3> covariance = Matrix<3, 3>::Zero();
  };

  const ScanMotion& fit(const LaserScan& scan, const Guess& guess);
  [[nodiscard]] bool take_wheels(Stamp begin, Stamp stamp);
  [[nodiscard]] Guess by_wheels(Stamp stamp, double seconds);
  [[nodiscard]] Guess by_scans(double seconds) const;
  void correct(const LaserScan& scan);
  void follow(const Pose2& motion, double seconds);

  OdometryMotion model_;
  ScanOdometry odometry_;
  std::size_t used_ = 0;
  std::optional<ScanMotion> fit_;
  std::optional<Stamp> at_;          // stamp of the last scan used
  std::optional<Pose2> correction_;  // by other scans of that stamp
  bool has_twist_ = false;
  Vector<3> twist_ = Vector<3>::Zero();  // by the last scans, per second
  Pose2 since_;                          // motion by scans that is not yet in it
  double seconds_ = 0.0;                 // of that
  std::optional<Stamp> wheels_;          // end of what wheels say
  Vector<3> rate_ = Vector<3>::Zero();   // of the wheels, per second
  Pose2 moved_;                          // by wheels, from the last scan to their end
};

}  // namespace locfuse
