// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/scan_odometry.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "locfuse/math/symmetric.hpp"
#include "math/refuse.hpp"

namespace locfuse {
namespace {

using internal::refuse;

constexpr double kMaxWindow = 1e6;   // bound of the poses that LocalMap takes [m]
constexpr double kMinSigma = 1e-6;   // of odometry [m], [rad]
constexpr double kRounding = 1e-12;  // magnitude of a negative eigenvalue that may be 0

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

}  // namespace

ScanOdometry::ScanOdometry(const ScanOdometryConfig& config)
    : config_(checked(config)), map_({}, config.map) {}

ScanMotion ScanOdometry::on(const LaserScan& scan, const Pose2& motion,
                            const Matrix<3, 3>& covariance) {
  const Stamp begin = stamp_.value_or(scan.stamp);
  if (stamp_ && scan.stamp <= begin) {
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
  result.match = map_.match(scan, guess, result.covariance);
  result.covariance = result.match.covariance.value_or(result.covariance);
  result.pose = key_ * result.match.pose;
  result.increment = {begin, scan.stamp, inverse(before) * result.pose};
  stamp_ = scan.stamp;
  key_stamp_ = result.key;
  in_key_ = result.match.pose;
  driven_ = driven;
  if (becomes_key(result.match)) {
    set_key(scan, result.match.converged);
  }
  return result;
}

bool ScanOdometry::becomes_key(const ScanMatch& match) const {
  return match.reason != ScanMatch::Reason::kNoReturns &&
         (window_.empty() || std::hypot(in_key_.x, in_key_.y) >= config_.key_distance_m ||
          std::abs(in_key_.heading) >= config_.key_turn_rad);
}

void ScanOdometry::set_key(const LaserScan& scan, bool fits) {
  if (!fits) {  // the poses of earlier scans are no longer known
    window_.clear();
  }
  key_ = key_ * in_key_;
  key_stamp_ = scan.stamp;
  in_key_ = {};
  driven_.setZero();
  window_.push_back({scan, key_});
  while (static_cast<int>(window_.size()) > config_.window_scans ||
         (window_.front().pose.position() - key_.position()).norm() > config_.window_m) {
    window_.pop_front();
  }
  std::vector<PlacedScan> placed(window_.begin(), window_.end());
  for (PlacedScan& scan_in_key : placed) {
    scan_in_key.pose = inverse(key_) * scan_in_key.pose;
  }
  map_ = LocalMap(placed, config_.map);
}

}  // namespace locfuse
