// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/scan_odometry.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "locfuse/math/chi_squared.hpp"
#include "locfuse/math/symmetric.hpp"
#include "locfuse/messages/per_laser.hpp"
#include "math/refuse.hpp"

namespace locfuse {
namespace {

using internal::kMaxLasers;
using internal::refuse;

constexpr double kMaxWindow = 1e6;   // bound of the poses that LocalMap takes [m]
constexpr double kMinSigma = 1e-6;   // of odometry [m], [rad]
constexpr double kRounding = 1e-12;  // magnitude of a negative eigenvalue that may be 0
// Probability that the guess for a scan whose laser is new to the map is no farther off than this.
constexpr double kGuessConfidence = 0.999;

ScanOdometryConfig checked(const ScanOdometryConfig& config) {
  if (config.window_scans < 1) {
    refuse("ScanOdometryConfig.window_scans", config.window_scans, "1 or more");
  }
  const auto require = [](const char* what, double value, double min = 0.0) {
    if (!std::isfinite(value) || value < min) {
      refuse(what, value, min > 0.0 ? "a finite number >= 1e-6" : "a finite number >= 0");
    }
  };
  require("ScanOdometryConfig.window_m", config.window_m);
  if (!(config.window_m < kMaxWindow)) {
    refuse("ScanOdometryConfig.window_m", config.window_m, "less than a million");
  }
  require("ScanOdometryConfig.key_distance_m", config.key_distance_m);
  require("ScanOdometryConfig.key_turn_rad", config.key_turn_rad);
  require("ScanOdometryConfig.least_sigma_m", config.least_sigma_m, kMinSigma);
  require("ScanOdometryConfig.least_sigma_rad", config.least_sigma_rad, kMinSigma);
  return config;
}

void require_semidefinite(const Matrix<3, 3>& covariance) {
  const bool symmetric = is_symmetric(covariance);
  if (!covariance.allFinite() || !symmetric ||
      Eigen::SelfAdjointEigenSolver<Matrix<3, 3>>(covariance, Eigen::EigenvaluesOnly)
              .eigenvalues()(0) < -kRounding) {
    std::ostringstream text;
    text << "covariance of the motion is not a symmetric positive semidefinite matrix:\n"
         << covariance;
    throw std::invalid_argument(text.str());
  }
}

bool are_of_one_laser(const PlacedScan& placed, const LaserScan& scan) {
  return internal::are_of_one_laser(*placed.scan.geometry, *scan.geometry);
}

}  // namespace

ScanOdometry::ScanOdometry(const ScanOdometryConfig& config)
    : config_(checked(config)), map_({}, config.map) {}

ScanMotion ScanOdometry::on(const LaserScan& scan, const Pose2& motion,
                            const Matrix<3, 3>& covariance) {
  validate(scan);
  const Stamp begin = stamp_.value_or(scan.stamp);
  if (is_late(scan)) {
    throw std::invalid_argument("stamp of the scan is " + std::to_string(scan.stamp) +
                                " ns, expected later than that of the scan before, " +
                                std::to_string(begin) + " ns");
  }
  validate(Increment{begin, scan.stamp, motion});
  require_semidefinite(covariance);
  const Pose2 before = key_ * in_key_;
  const Pose2 guess = stamp_ ? in_key_ * motion : in_key_;
  const Matrix<3, 3> driven =
      stamp_ ? covariance_after(in_key_, driven_, motion, covariance) : driven_;
  ScanMotion result{{}, {}, {}, stamp_ ? key_stamp_ : scan.stamp, driven};
  result.covariance.diagonal() +=
      Vector<3>(config_.least_sigma_m, config_.least_sigma_m, config_.least_sigma_rad).cwiseAbs2();
  result.match = match(scan, guess, result.covariance);
  result.covariance = result.match.covariance.value_or(result.covariance);
  result.pose = key_ * result.match.pose;
  result.increment = {begin, scan.stamp, inverse(before) * result.pose};
  if (stamp_ != scan.stamp) {
    at_stamp_.clear();
  }
  at_stamp_.push_back(scan.geometry);
  stamp_ = scan.stamp;
  key_stamp_ = result.key;
  in_key_ = result.match.pose;
  driven_ = driven;
  if (becomes_key(scan, result.match)) {
    set_key(scan, result.match.converged);
  } else if (joins_key(scan, result.match)) {
    add_to_map(scan);
  }
  return result;
}

bool ScanOdometry::is_late(const LaserScan& scan) const {
  return stamp_ && (scan.stamp < *stamp_ ||
                    (scan.stamp == *stamp_ &&
                     std::any_of(at_stamp_.begin(), at_stamp_.end(), [&](const auto& laser) {
                       return internal::are_of_one_laser(*laser, *scan.geometry);
                     })));
}

bool ScanOdometry::is_of_new_laser(const LaserScan& scan) const {
  return !window_.empty() &&
         std::none_of(window_.begin(), window_.end(),
                      [&](const PlacedScan& placed) { return are_of_one_laser(placed, scan); });
}

/// Matches a scan with the local map. One whose laser is new to it sees what the map has not, and
/// may fit best where it is not: in a room with two equal ends, turned around.
ScanMatch ScanOdometry::match(const LaserScan& scan, const Pose2& guess,
                              const Matrix<3, 3>& covariance) const {
  ScanMatch found = map_.match(scan, guess, covariance);
  if (!found.converged || !is_of_new_laser(scan)) {
    return found;
  }
  const Vector<3> off = local(found.pose, guess);
  if (off.dot(covariance.llt().solve(off)) <= chi_squared_quantile(3, kGuessConfidence)) {
    return found;
  }
  ScanMatch none;
  none.pose = guess;
  none.reason = ScanMatch::Reason::kTooFewMatches;
  return none;
}

/// Whether a scan is the first in a map, or far enough from its newest key scan. One that fits
/// nothing is no reason for another map where its laser is new to this one.
bool ScanOdometry::becomes_key(const LaserScan& scan, const ScanMatch& match) const {
  const bool is_far = std::hypot(in_key_.x, in_key_.y) >= config_.key_distance_m ||
                      std::abs(in_key_.heading) >= config_.key_turn_rad;
  return match.reason != ScanMatch::Reason::kNoReturns &&
         (window_.empty() || (is_far && (match.converged || !is_of_new_laser(scan))));
}

/// Whether a scan is the first of its laser since the newest key scan, which is of another.
bool ScanOdometry::joins_key(const LaserScan& scan, const ScanMatch& match) const {
  const auto first = std::find_if(window_.begin(), window_.end(), [&](const PlacedScan& placed) {
    return placed.scan.stamp >= key_stamp_;
  });
  return match.reason != ScanMatch::Reason::kNoReturns &&
         static_cast<std::size_t>(window_.end() - first) < kMaxLasers &&
         std::none_of(first, window_.end(),
                      [&](const PlacedScan& placed) { return are_of_one_laser(placed, scan); });
}

void ScanOdometry::set_key(const LaserScan& scan, bool fits) {
  if (!fits) {  // the poses of earlier scans are no longer known
    window_.clear();
  }
  key_ = key_ * in_key_;
  key_stamp_ = scan.stamp;
  in_key_ = {};
  driven_.setZero();
  add_to_map(scan);
}

void ScanOdometry::add_to_map(const LaserScan& scan) {
  window_.push_back({scan, key_ * in_key_});
  drop_oldest(scan);
  std::vector<PlacedScan> placed(window_.begin(), window_.end());
  for (PlacedScan& scan_in_key : placed) {
    scan_in_key.pose = inverse(key_) * scan_in_key.pose;
  }
  map_ = LocalMap(placed, config_.map);
}

/// Keeps the window as small as it is asked to be, after a scan was added.
void ScanOdometry::drop_oldest(const LaserScan& scan) {
  const auto is_of_laser = [&](const PlacedScan& placed) { return are_of_one_laser(placed, scan); };
  if (std::count_if(window_.begin(), window_.end(), is_of_laser) > config_.window_scans) {
    window_.erase(std::find_if(window_.begin(), window_.end(), is_of_laser));
  }
  const std::size_t most = kMaxLasers * static_cast<std::size_t>(config_.window_scans);
  while (window_.size() > most ||
         (window_.front().pose.position() - key_.position()).norm() > config_.window_m) {
    window_.pop_front();
  }
}

}  // namespace locfuse
