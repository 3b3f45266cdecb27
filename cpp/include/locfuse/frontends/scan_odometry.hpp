// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>

#include "locfuse/frontends/local_map.hpp"

namespace locfuse {

struct ScanOdometryConfig {
  LocalMapConfig map;
  int window_scans = 10;        ///< key scans that make the local map; 1 is scan to scan
  double window_m = 5.0;        ///< how far from the newest of them the others may be
  double key_distance_m = 0.3;  ///< from the newest key scan, after which a scan becomes the next
  double key_turn_rad = 0.3;    ///< likewise
  /// That odometry is known to at best, whatever it says of itself: it is not told in the very
  /// moment of the scan, and a robot that seems to stand may be on its way.
  double least_sigma_m = 0.01;
  double least_sigma_rad = 0.01;  ///< likewise
};

/// What a scan says of the motion.
struct ScanMotion {
  Increment increment;  ///< since the scan before; of no duration for the first one
  Pose2 pose;           ///< T_start_body: increments from the first scan on

  /// Against the local map, in the body frame of the newest key scan, T_key_body. Of the first scan
  /// there is none: kTooFewMatches.
  ScanMatch match;
  Stamp key = 0;            ///< when that key scan was taken
  Matrix<3, 3> covariance;  ///< of T_key_body; without a match what odometry alone says
};

/// Motion of a body from its laser, without a map: each scan is fitted to the key scans driven
/// through last, next to what odometry says. docs/models/scan_matching.md, "Without a map".
///
/// A value: copying it is a snapshot.
class ScanOdometry {
 public:
  /// Throws std::invalid_argument on a setting out of bounds.
  explicit ScanOdometry(const ScanOdometryConfig& config = {});

  [[nodiscard]] const ScanOdometryConfig& config() const { return config_; }

  /// Next scan, with the motion since the one before as odometry tells it, and the covariance of
  /// that (3x3, of (x, y, heading) in the body frame where it begins; zero if it did not move).
  ///
  /// Where the scan does not fit, the motion is odometry's. Throws std::invalid_argument, and
  /// changes nothing, if scan, motion or covariance are not valid or the stamp is not later than
  /// the one before.
  ScanMotion on(const LaserScan& scan, const Pose2& motion, const Matrix<3, 3>& covariance);

 private:
  [[nodiscard]] bool becomes_key(const ScanMatch& match) const;
  void set_key(const LaserScan& scan, bool fits);

  ScanOdometryConfig config_;
  std::deque<PlacedScan> window_;  // T_start_body, the newest key scan last
  LocalMap map_;                   // in the body frame of that
  std::optional<Stamp> stamp_;     // of the scan before
  Stamp key_stamp_ = 0;
  Pose2 key_;                                   // T_start_key
  Pose2 in_key_;                                // T_key_body of the scan before
  Matrix<3, 3> driven_ = Matrix<3, 3>::Zero();  // covariance of odometry since the key scan
};

}  // namespace locfuse
