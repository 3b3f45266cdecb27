// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "locfuse/estimators/air_ekf.hpp"

namespace locfuse {

/// A Gaussian sum of AirEkf: the places of a body that ranges allow where they cannot be fused one
/// by one, since the belief is so vague that a sphere about an anchor is not flat in it, as after
/// seconds without any. docs/air.md, "Vague beliefs".
///
/// Ranges that are too near for a place are kept for an epoch, and then fused together about each
/// place that they and the belief allow. A cheap value. Every `on` throws as that of an AirEkf.
class AirSum {
 public:
  struct Config {
    double epoch_s = 0.2;         ///< ranges this close together give places [s]
    double wrong_share = 0.01;    ///< of the ranges that say nothing
    double wrong_span_m = 20.0;   ///< what is wrong is wrong by anything up to this [m]
    double correlation_s = 10.0;  ///< the ranges of a link err the same way for so long [s]
  };

  /// At headings all around where that of `start` is unknown and matters.
  AirSum(const Config& config, const AirEkf& start);

  /// Whether a range is fused together with others rather than by itself.
  [[nodiscard]] static bool is_vague(const AirEkf& ekf, const Range& z);

  /// Another place, to which the body may have been moved, `odds` times as likely as the likeliest.
  void add(const AirEkf& start, double odds);
  /// Its mirror image beside a single place, if ranges cannot tell them apart.
  void add_image(const AirEkf& image, double odds);

  /// What became of it by the likeliest place; kIgnored for what is kept for an epoch, odometry
  /// apart.
  Outcome on(const Range& z);
  Outcome on(const Velocity& u);
  Outcome on(const Increment& u);
  Outcome on(const Imu& z);
  Outcome on(const PositionFix& z);
  Outcome on(const Altitude& z);
  Outcome on(const Heading& z);
  Outcome on(const PoseObservation& z);
  Outcome on(const RangeBearing& z);

  /// The only place that is left, once ranges may be fused there one by one.
  [[nodiscard]] const AirEkf* decided() const;
  /// Whether the likeliest place is one that was added.
  [[nodiscard]] bool has_moved() const { return components_.front().moved; }
  /// Whether the heading of any place is known well enough, or nothing depends on it.
  [[nodiscard]] bool has_headings() const;
  /// Whether several are left.
  [[nodiscard]] bool is_ambiguous() const { return components_.size() > 1; }
  /// The mean of all places, with the covariance of their mixture.
  [[nodiscard]] AirEkf mean() const;

 private:
  struct Component {
    AirEkf ekf;
    double log_weight;
    bool moved;               // was added after the body was lost
    double log_inside = 0.0;  // the least so far: a place outside the room is none
  };
  struct Link {  // when the ranges of a link were evidence
    Id tag;
    Id anchor;
    Stamp stamp;
  };

  template <class M>
  Outcome take(const M& message);
  template <class M>
  Outcome weigh(const M& z, double news = 1.0);
  template <class M>
  Outcome keep(const M& message);
  void close_when_due(Stamp stamp);
  void close();
  void forget(Stamp until);
  void fuse_epoch(const Component& from, const std::vector<Range>& ranges,
                  const std::vector<double>& news, std::vector<Component>& to) const;
  void fuse_at(const Component& from, const Vector<3>& place, const std::vector<double>& news,
               std::vector<Component>& to) const;
  [[nodiscard]] double news_of(const Range& z);
  [[nodiscard]] double bend(const Component& component) const;
  void reduce();

  Config config_;
  std::vector<Component> components_;  // the likeliest first
  std::vector<Message> epoch_;         // ranges that are kept, and what came after the first
  Stamp begun_ = 0;                    // of the last try to fuse them
  std::vector<Link> links_;
};

}  // namespace locfuse
