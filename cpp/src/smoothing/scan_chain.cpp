// SPDX-License-Identifier: Apache-2.0
#include "smoothing/scan_chain.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <variant>

#include "locfuse/messages/per_laser.hpp"

namespace locfuse::internal {
namespace {

/// What a fit to the last scans is off beside its covariance, from one key scan to the next.
const Vector<3> kSigmaOfFit(0.01, 0.01, 0.003);

/// Motion by wheels since the last scan.
class Wheels {
 public:
  void on(const Increment& u) {
    so_far_ = so_far_ * u.motion;
    way_.emplace_back(u.stamp, so_far_);
  }
  void on(const Velocity& u) {
    if (velocity_) {
      const double seconds = seconds_between(velocity_->stamp, u.stamp);
      so_far_ = so_far_ * arc(velocity_->forward * seconds, velocity_->left * seconds,
                              velocity_->turn_rate * seconds);
      way_.emplace_back(u.stamp, so_far_);
    }
    velocity_ = u;
  }

  /// The way up to a stamp, from which the next one goes on.
  std::vector<std::pair<Stamp, Pose2>> until(Stamp stamp) {
    const auto beyond =
        std::find_if(way_.begin(), way_.end(), [&](const auto& one) { return one.first >= stamp; });
    std::vector<std::pair<Stamp, Pose2>> found(way_.begin(), beyond);
    const auto [begin, before] = found.empty() ? std::pair(begin_, Pose2{}) : found.back();
    Pose2 here = before;
    if (beyond != way_.end()) {
      const double whole = seconds_between(begin, beyond->first);
      const double share = whole > 0.0 ? seconds_between(begin, stamp) / whole : 1.0;
      here = before * arc_share(inverse(before) * beyond->second, share);
    }
    found.emplace_back(stamp, here);
    way_.erase(way_.begin(), beyond);
    const Pose2 back = inverse(here);
    for (auto& [_, pose] : way_) {
      pose = back * pose;
    }
    so_far_ = back * so_far_;
    begin_ = stamp;
    return found;
  }

 private:
  Stamp begin_ = 0;
  Pose2 so_far_;
  std::vector<std::pair<Stamp, Pose2>> way_;
  std::optional<Velocity> velocity_;
};

class ChainBuilder {
 public:
  explicit ChainBuilder(const ScanDrive::Config& config) : drive_(config) {}

  void on(const Increment& u) { take(u); }
  void on(const Velocity& u) { take(u); }
  void on(const LaserScan& z) {
    validate(z);
    const std::optional<LaserScan> turned = as_of_stamp(z, drive_.turn_rate_at(z.stamp));
    const LaserScan& scan = turned ? *turned : z;
    const std::optional<ScanMotion> before = drive_.fit();
    const std::size_t used = drive_.used();
    (void)drive_.on(scan);
    if (drive_.used() == used) {
      return;
    }
    const std::optional<ScanMotion>& fit = drive_.fit();
    if (!before || fit->key != before->key) {
      begin_node(scan, *fit, before);
    } else if (is_of_new_laser(scan) && fit->match.converged) {
      chain_.nodes.back().scans.push_back({scan, fit->match.pose});
    }
    const bool is_open = fit->match.converged && fit->match.weak_direction;
    chain_.weak += is_open && !drive_.has_wheels_at(scan.stamp) ? 1 : 0;
    ScanFrame frame{scan.stamp, chain_.nodes.size() - 1, fit->match.pose, fit->covariance, {}};
    frame.way = wheels_.until(scan.stamp);
    if (!chain_.frames.empty() && chain_.frames.back().stamp == scan.stamp) {
      frame.way = std::move(chain_.frames.back().way);
      chain_.frames.back() = std::move(frame);
    } else {
      chain_.frames.push_back(std::move(frame));
    }
    last_ = scan;
  }
  template <class M>
  void on(const M& /*other*/) {}

  ScanChain chain() {
    if (chain_.nodes.empty()) {
      throw std::invalid_argument("a map is drawn of laser scans, but there are none");
    }
    return std::move(chain_);
  }

 private:
  template <class M>
  void take(const M& u) {
    drive_.on(u);
    wheels_.on(u);
  }

  /// The scan before became the key scan that this one was fitted to; or this is the first.
  void begin_node(const LaserScan& scan, const ScanMotion& fit,
                  const std::optional<ScanMotion>& before) {
    if (!before) {
      chain_.nodes.push_back({scan.stamp, {}, 0.0, {{scan, {}}}});
      return;
    }
    const ScanNode& last = chain_.nodes.back();
    const Pose2& motion = before->match.pose;
    PoseRelation relation{chain_.nodes.size() - 1, chain_.nodes.size(), motion};
    const Matrix<3, 3> known =
        before->covariance + Matrix<3, 3>(kSigmaOfFit.cwiseAbs2().asDiagonal());
    relation.information = known.llt().solve(Matrix<3, 3>::Identity());
    chain_.relations.push_back(relation);
    chain_.unmatched += before->match.converged ? 0 : 1;
    const double path = last.path + motion.position().norm();
    chain_.nodes.push_back({fit.key, last.pose * motion, path, {{*last_, {}}}});
    ScanFrame& key = chain_.frames.back();
    key.node = chain_.nodes.size() - 1;
    key.in_node = {};
    key.covariance.setZero();
  }

  [[nodiscard]] bool is_of_new_laser(const LaserScan& scan) const {
    const std::vector<PlacedScan>& scans = chain_.nodes.back().scans;
    return scans.size() < kMaxLasers &&
           std::none_of(scans.begin(), scans.end(), [&](const PlacedScan& placed) {
             return are_of_one_laser(*placed.scan.geometry, *scan.geometry);
           });
  }

  ScanDrive drive_;
  Wheels wheels_;
  ScanChain chain_;
  std::optional<LaserScan> last_;
};

}  // namespace

ScanChain make_scan_chain(const ScanDrive::Config& config, const std::vector<Message>& messages,
                          const std::function<void(double)>& progress) {
  std::vector<const Message*> order;
  order.reserve(messages.size());
  for (const Message& message : messages) {
    order.push_back(&message);
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const Message* a, const Message* b) { return precedes(*a, *b); });
  ChainBuilder builder(config);
  for (std::size_t k = 0; k < order.size(); ++k) {
    std::visit([&](const auto& message) { builder.on(message); }, *order[k]);
    if (k % 256 == 0) {
      progress(static_cast<double>(k) / static_cast<double>(order.size()));
    }
  }
  return builder.chain();
}

}  // namespace locfuse::internal
