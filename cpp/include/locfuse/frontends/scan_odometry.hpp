// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "locfuse/frontends/local_map.hpp"

namespace locfuse {

struct ScanOdometryConfig {
  LocalMapConfig map;
  int window_scans = 10;        ///< of each laser in the local map; 1 is scan to scan
  double window_m = 5.0;        ///< maximum distance of the others from the newest
  double key_distance_m = 0.3;  ///< from the newest key scan, from which on a scan becomes the next
  double key_turn_rad = 0.3;    ///< the same as a turn
  /// Minimum uncertainty of odometry, added to the reported one: odometry and scan are not taken at
  /// the same moment.
  double least_sigma_m = 0.01;
  double least_sigma_rad = 0.01;
};

/// Motion from one scan.
struct ScanMotion {
  /// Since the previous scan; of no duration for the first one, and for one of another laser at the
  /// same stamp.
  Increment increment;
  Pose2 pose;  ///< T_start_body: sum of the increments

  /// Match against the local map, in the body frame of the newest key scan: T_key_body. The first
  /// scan has none: kTooFewMatches.
  ScanMatch match;
  Stamp key = 0;            ///< stamp of that key scan
  Matrix<3, 3> covariance;  ///< of T_key_body; without a match from odometry alone
};

/// Motion of a body from its laser, without a map: each scan is matched with the latest key scans,
/// near the pose that odometry predicts. docs/models/scans.md, "Without a map".
///
/// A body may have several lasers, each known by its mount: the local map has scans of each.
///
/// A value: copying it is a snapshot.
class ScanOdometry {
 public:
  /// Throws std::invalid_argument on a setting out of bounds.
  explicit ScanOdometry(const ScanOdometryConfig& config = {});

  [[nodiscard]] const ScanOdometryConfig& config() const { return config_; }

  /// Processes the next scan, with the motion since the previous one by odometry and its covariance
  /// (3x3, of (x, y, heading) in the body frame where the motion begins; zero if it did not move).
  ///
  /// Where the scan does not match, the motion is odometry's. Throws std::invalid_argument, and
  /// changes nothing, if scan, motion or covariance are not valid or the scan is late.
  ScanMotion on(const LaserScan& scan, const Pose2& motion, const Matrix<3, 3>& covariance);

  /// Whether a valid scan is not later than the previous one; one of another laser may have its
  /// stamp.
  [[nodiscard]] bool is_late(const LaserScan& scan) const;
  /// Whether the local map has scans, but none of the laser of this valid one: where it lies is
  /// then known by the motion.
  [[nodiscard]] bool is_of_new_laser(const LaserScan& scan) const;

 private:
  [[nodiscard]] ScanMatch match(const LaserScan& scan, const Pose2& guess,
                                const Matrix<3, 3>& covariance) const;
  [[nodiscard]] bool becomes_key(const LaserScan& scan, const ScanMatch& match) const;
  [[nodiscard]] bool joins_key(const LaserScan& scan, const ScanMatch& match) const;
  void set_key(const LaserScan& scan, bool fits);
  void add_to_map(const LaserScan& scan);
  void drop_oldest(const LaserScan& scan);

  ScanOdometryConfig config_;
  std::deque<PlacedScan> window_;  // key scans and those that joined them, T_start_body, by stamp
  LocalMap map_;                   // in the body frame of the newest key scan
  std::optional<Stamp> stamp_;     // of the previous scan
  std::vector<std::shared_ptr<const LaserGeometry>> at_stamp_;  // of the scans of that stamp
  Stamp key_stamp_ = 0;
  Pose2 key_;                                   // T_start_key
  Pose2 in_key_;                                // T_key_body of the previous scan
  Matrix<3, 3> driven_ = Matrix<3, 3>::Zero();  // covariance of odometry since the key scan
};

}  // namespace locfuse
