// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "locfuse/maps/tags.hpp"
#include "locfuse/messages/messages.hpp"

namespace locfuse {

/// What became of a fix.
enum class TagVerdict : std::uint8_t {
  kPassed,
  kRestarted,   ///< so many were jumps that this one is where it starts anew
  kJump,        ///< further than the machine can have gone, or than 1e12 m from the origin
  kFrozen,      ///< bit for bit the fix before, though the wheels say that the tag moved
  kStale,       ///< before the one that passed last
  kUnknownTag,  ///< of no tag, or of one that is not on the body
};

struct ConditionedFix {
  TagVerdict verdict = TagVerdict::kUnknownTag;
  std::optional<PositionFix> fix;  ///< where it passed: bias removed, low-passed
};

/// Conditions the fixes of an RTLS before a filter sees them (celan2017, section III.C): removes a
/// constant bias, rejects jumps and values that are stuck, and low-passes the rest, tag by tag;
/// docs/models/tag_triangle_ekf.md eq. (9) to (12).
class TagConditioner {
 public:
  struct Config {
    double cutoff_hz = 0.4;        ///< of the low-pass; 0 is none [Hz]
    double bias_x_m = 0.0;         ///< taken from every fix, in world [m]
    double bias_y_m = 0.0;         ///< [m]
    double max_speed_mps = 1.4;    ///< of a tag: 5 km/h [m/s]
    double jump_margin_m = 0.8;    ///< beyond what that speed allows [m]
    int restart_after = 5;         ///< jumps in a row
    double frozen_motion_m = 0.1;  ///< a tag that went further has another fix [m]
    double hold_s = 1.0;           ///< how long a velocity is believed without a new one [s]
  };

  /// Throws std::invalid_argument on a config out of range or tags that are not valid.
  TagConditioner(const Config& config, const std::vector<Tag>& tags);

  /// Wheel odometry, which tells how far each tag went.
  void on(const Velocity& u);
  void on(const Increment& u);

  /// Its covariance stays what it was. Throws std::invalid_argument if it is not valid.
  ConditionedFix on(const PositionFix& z);

 private:
  struct Track {  // of one tag
    Id tag;
    Vector<2> lever;
    bool has_fix = false;
    Vector<2> heard = Vector<2>::Zero();   // the latest value, as it came
    double driven = 0.0;                   // since that value came first [m]
    Vector<2> passed = Vector<2>::Zero();  // the latest that passed, without bias
    Vector<2> smooth = Vector<2>::Zero();  // the low-pass
    Stamp stamp = 0;                       // of what passed
    int jumps = 0;                         // since then
  };

  void drive_to(Stamp stamp);
  ConditionedFix pass(Track& track, const PositionFix& z, const Vector<2>& position,
                      TagVerdict verdict) const;

  Config config_;
  std::vector<Track> tracks_;
  std::optional<Velocity> held_;  // its stamp: how far it was driven
  Stamp held_until_ = 0;
};

}  // namespace locfuse
