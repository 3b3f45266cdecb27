// SPDX-License-Identifier: Apache-2.0
#include "locfuse/frontends/tag_conditioner.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "locfuse/math/angle.hpp"

namespace locfuse {
namespace {

void require(bool ok, const char* name, double value, const char* expected) {
  if (!ok) {
    throw std::invalid_argument(std::string("tag_conditioner.") + name + " is " +
                                std::to_string(value) + ", expected " + expected);
  }
}

constexpr double kMaxSetting = 1e9;    // magnitude of a setting, so that sums with it are finite
constexpr double kMaxPosition = 1e12;  // magnitude of a coordinate of a tag [m]

bool is_positive(double value) { return std::isfinite(value) && value > 0.0; }

}  // namespace

TagConditioner::TagConditioner(const Config& config, const std::vector<Tag>& tags)
    : config_(config) {
  require(config.cutoff_hz >= 0.0 && config.cutoff_hz <= kMaxSetting, "cutoff_hz", config.cutoff_hz,
          "0 to 1e9");
  require(std::abs(config.bias_x_m) <= kMaxSetting, "bias_x_m", config.bias_x_m, "-1e9 to 1e9");
  require(std::abs(config.bias_y_m) <= kMaxSetting, "bias_y_m", config.bias_y_m, "-1e9 to 1e9");
  require(is_positive(config.max_speed_mps), "max_speed_mps", config.max_speed_mps,
          "a finite number > 0");
  require(is_positive(config.jump_margin_m), "jump_margin_m", config.jump_margin_m,
          "a finite number > 0");
  require(config.restart_after >= 1, "restart_after", config.restart_after, "at least 1");
  require(is_positive(config.frozen_motion_m), "frozen_motion_m", config.frozen_motion_m,
          "a finite number > 0");
  require(is_positive(config.hold_s) && config.hold_s < kMaxSetting, "hold_s", config.hold_s,
          "a finite number > 0");
  const Tags known(tags);
  for (const Tag& tag : known.all()) {
    tracks_.push_back({tag.id, tag.position.head<2>()});
  }
}

/// Adds the distance driven until `stamp` at the held velocity.
void TagConditioner::drive_to(Stamp stamp) {
  if (!held_) {
    return;
  }
  const Stamp until = std::min(stamp, held_until_);
  if (until <= held_->stamp) {
    return;
  }
  const double seconds = seconds_between(held_->stamp, until);
  for (Track& track : tracks_) {
    const Vector<2> velocity(held_->forward - held_->turn_rate * track.lever.y(),
                             held_->left + held_->turn_rate * track.lever.x());
    track.driven += seconds * velocity.norm();
    track.moved += seconds * velocity.norm();
  }
  held_->stamp = until;
  driven_until_ = std::max(driven_until_, until);
}

void TagConditioner::on(const Velocity& u) {
  validate(u);
  drive_to(u.stamp);
  held_ = u;
  held_until_ = u.stamp + static_cast<Stamp>(config_.hold_s * kNanosecondsPerSecond);
}

void TagConditioner::on(const Increment& u) {
  validate(u);
  for (Track& track : tracks_) {
    const double distance = (u.motion.act(track.lever) - track.lever).norm();
    track.driven += distance;
    track.moved += distance;
  }
  driven_until_ = std::max(driven_until_, u.stamp);
}

/// Eq. (7.9) and (7.10) of docs/models/poses.md.
ConditionedFix TagConditioner::on(const PositionFix& z) {
  validate(z);
  const auto track = std::find_if(tracks_.begin(), tracks_.end(),
                                  [&](const Track& known) { return z.tag == known.tag; });
  if (track == tracks_.end()) {
    return {TagVerdict::kUnknownTag, {}};
  }
  const Vector<2> position = z.position - Vector<2>(config_.bias_x_m, config_.bias_y_m);
  if (track->has_fix && z.stamp < track->stamp) {
    return {TagVerdict::kStale, {}};
  }
  if (!(position.cwiseAbs().maxCoeff() <= kMaxPosition)) {
    return {TagVerdict::kJump, {}};
  }
  drive_to(z.stamp);
  if (!track->has_fix) {
    track->reported = z.position;
    track->driven = 0.0;
    return pass(*track, z, position, TagVerdict::kPassed);
  }
  if (z.position != track->reported) {
    track->reported = z.position;
    track->driven = 0.0;
  } else if (track->driven > config_.frozen_motion_m) {
    return {TagVerdict::kFrozen, {}, 0.0, config_.frozen_motion_m};
  }
  const double seconds = seconds_between(track->stamp, z.stamp);
  const double reach = config_.max_speed_mps * seconds + config_.jump_margin_m;
  const double distance = (position - track->passed).norm();
  if (distance <= reach) {
    return pass(*track, z, position, TagVerdict::kPassed);
  }
  if (++track->jumps < config_.restart_after) {
    return {TagVerdict::kJump, {}, distance, reach};
  }
  track->has_fix = false;
  return pass(*track, z, position, TagVerdict::kRestarted);
}

/// How far a tag has moved since the last fix that passed: by odometry, and at full speed since
/// that has ended.
double TagConditioner::most_moved(const Track& track, Stamp stamp) const {
  const Stamp covered = std::min(stamp, std::max(driven_until_, track.stamp));
  const double moved = track.moved + config_.max_speed_mps * seconds_between(covered, stamp);
  return std::min(moved, kMaxPosition);
}

/// Eq. (7.9), and (7.13) and (7.14) for the covariance.
ConditionedFix TagConditioner::pass(Track& track, const PositionFix& z, const Vector<2>& position,
                                    TagVerdict verdict) const {
  if (track.has_fix && config_.cutoff_hz > 0.0) {
    const double share =  // of the new value
        -std::expm1(-2.0 * kPi * config_.cutoff_hz * seconds_between(track.stamp, z.stamp));
    track.smooth += share * (position - track.smooth);
    track.lag = (1.0 - share) * std::min(track.lag + most_moved(track, z.stamp), kMaxPosition);
  } else {
    track.smooth = position;
    track.lag = 0.0;
  }
  track.has_fix = true;
  track.passed = position;
  track.stamp = z.stamp;
  track.moved = 0.0;
  track.jumps = 0;
  PositionFix fix = z;
  fix.position = track.smooth;
  if (z.covariance.diagonal().minCoeff() > 0.0) {
    fix.covariance.diagonal().array() += track.lag * track.lag;
  }
  return {verdict, fix};
}

}  // namespace locfuse
