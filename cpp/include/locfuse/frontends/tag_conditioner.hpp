// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "locfuse/maps/tags.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// Outcome of a fix.
enum class TagVerdict : std::uint8_t {
  kPassed,
  kRestarted,   ///< accepted as a new start after repeated jumps
  kJump,        ///< farther than the robot can have driven, or than 1e12 m from the origin
  kFrozen,      ///< identical to the previous fix, although the tag moved by odometry
  kStale,       ///< older than the last one that passed
  kUnknownTag,  ///< without a tag, or of one that is not on the body
};

struct ConditionedFix {
  TagVerdict verdict = TagVerdict::kUnknownTag;
  std::optional<PositionFix> fix;  ///< if it passed: bias removed, low-passed
  /// Of kJump, from the last that passed, and of kFrozen, 0 [m]; else NaN.
  double distance = std::numeric_limits<double>::quiet_NaN();
  /// What the distance had to be at most, for kJump, or the tag moved more than, for kFrozen [m].
  double limit = std::numeric_limits<double>::quiet_NaN();
};

/// Conditions the fixes of an RTLS for a filter (celan2017, section III.C): removes a constant
/// bias, rejects jumps and frozen values, and low-passes the rest, tag by tag;
/// docs/models/poses.md eq. (7.9) to (7.14). Fed in order of effective stamps.
class TagConditioner {
 public:
  struct Config {
    double cutoff_hz = 0.4;        ///< of the low-pass; 0: off [Hz]
    double bias_x_m = 0.0;         ///< subtracted from every fix, in world [m]
    double bias_y_m = 0.0;         ///< [m]
    double max_speed_mps = 1.4;    ///< of a tag: 5 km/h [m/s]
    double jump_margin_m = 0.8;    ///< beyond the distance that max_speed_mps allows [m]
    int restart_after = 5;         ///< consecutive jumps
    double frozen_motion_m = 0.1;  ///< distance driven after which a fix must have changed [m]
    double hold_s = 1.0;           ///< timeout of a velocity [s]
  };

  /// Throws std::invalid_argument on a config out of range or tags that are not valid.
  TagConditioner(const Config& config, const std::vector<Tag>& tags);

  /// Wheel odometry, for the distance that each tag moves.
  void on(const Velocity& u);
  void on(const Increment& u);

  /// Conditions one fix. What the low-pass lags behind at most is added to its covariance, unless
  /// that is unknown: eq. (7.14). Throws std::invalid_argument if it is not valid.
  ConditionedFix on(const PositionFix& z);

  /// The same where fixes of other antennas arrive, too: a fix of kUnknownTag passes as it is.
  std::optional<PositionFix> conditioned(const PositionFix& z) {
    const ConditionedFix result = on(z);
    return result.verdict == TagVerdict::kUnknownTag ? z : result.fix;
  }

 private:
  struct Track {  // of one tag
    Id tag;
    Vector<2> lever;
    bool has_fix = false;
    Vector<2> reported = Vector<2>::Zero();  // latest value as received
    double driven = 0.0;                     // since that value was first received [m]
    Vector<2> passed = Vector<2>::Zero();    // latest that passed, without bias
    Vector<2> smooth = Vector<2>::Zero();    // low-passed
    Stamp stamp = 0;                         // of the latest that passed
    double moved = 0.0;                      // since then, by odometry [m]
    double lag = 0.0;                        // of smooth at most [m]
    int jumps = 0;                           // since the latest that passed, in a row
  };

  void drive_to(Stamp stamp);
  [[nodiscard]] double most_moved(const Track& track, Stamp stamp) const;
  ConditionedFix pass(Track& track, const PositionFix& z, const Vector<2>& position,
                      TagVerdict verdict) const;

  Config config_;
  std::vector<Track> tracks_;
  std::optional<Velocity> held_;  // its stamp: until when it was integrated
  Stamp held_until_ = 0;
  Stamp driven_until_ = std::numeric_limits<Stamp>::min();  // end of what odometry has measured
};

}  // namespace locfuse
