// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "locfuse/filters/belief.hpp"
#include "locfuse/maps/anchor_map.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/models/measurement/range.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// An error of a robot's sensors, as far as it is known.
struct CalibratedError {
  std::string name;
  std::optional<Id> anchor;  ///< whose error it is, if it is one's
  double value = 0.0;
  double sigma = 0.0;
  double sigma_start = 0.0;
};

/// Which errors of odometry, of the sensor of landmarks and of ranges are states of a belief,
/// behind its body: the pose and they are estimated together, or they are considered. Derivation:
/// docs/models/updates.md.
class Calibration {
 public:
  /// How far off each may be at the start, as a standard deviation. 0: it is right, and no state.
  struct Config {
    double sigma_scale = 0.0;                     ///< of the distance by odometry
    double sigma_direction_rad = 0.0;             ///< of travel
    double sigma_turn_scale = 0.0;                ///< of the turn by odometry
    double sigma_turn_bias_radps = 0.0;           ///< of a gyro
    double sigma_turn_bias_radps_per_sqrt_s = 0;  ///< by which that bias wanders
    double sigma_sensor_m = 0.0;                  ///< of the sensor's place, x and y
    double sigma_sensor_rad = 0.0;                ///< of the sensor's heading in body
    double sigma_range_offset_m = 0.0;            ///< of ranges to landmarks
    double sigma_range_scale = 0.0;               ///< of the range
    double sigma_delay_s = 0.0;                   ///< of sightings behind their stamps
    double sigma_anchor_offset_m = 0.0;           ///< of ranges, for each anchor of the map
    double anchor_offset_correlation_s = 0.0;     ///< correlation time of those; 0: constant
    double sigma_anchor_scale = 0.0;              ///< added to the anchor's
    double sigma_range_delay_s = 0.0;             ///< of all ranges behind their stamps
    /// Of headings, beyond heading.offset_rad: a state from the first one on. Pi: unknown.
    double sigma_heading_offset_rad = kPi;
    double sigma_heading_offset_rad_per_sqrt_s = 0.03;  ///< by which that wanders
    bool consider = false;  ///< they are accounted for, and none is learnt (Schmidt)
  };

  /// Nothing is a state.
  Calibration() : Calibration(Config{}) {}

  /// Throws std::invalid_argument on a number that is negative or not finite, and on a bias or
  /// offsets that wander without being states.
  explicit Calibration(const Config& config, const AnchorMap& anchors = {});

  [[nodiscard]] bool is_empty() const { return states_.empty(); }

  /// Puts the states into a belief that holds nothing but its body, each 0; the offset of headings
  /// follows with the first heading.
  void add_to(GaussianBelief& belief) const;
  /// The body and the states, once they are in the belief.
  [[nodiscard]] const std::vector<Slot>& slots() const { return slots_; }
  /// The body and the errors of odometry, if any are states: what a motion depends on.
  [[nodiscard]] const std::vector<Slot>& motion_slots() const { return motion_slots_; }
  [[nodiscard]] bool has_odometry() const { return motion_slots_.size() > 1; }
  [[nodiscard]] std::vector<CalibratedError> errors(const GaussianBelief& belief) const;

  /// What moves `motion_slots` for a motion by odometry, eq. (3.1).
  [[nodiscard]] Propagation<Eigen::VectorXd, Eigen::Dynamic> propagate(
      const GaussianBelief& belief, const OdometryMotion& model, const Pose2& motion,
      double seconds, const std::optional<Vector<3>>& variance) const;

  /// Whether the offsets of anchors change with time.
  [[nodiscard]] bool has_wandering() const { return correlation_s_ > 0.0 && !offsets_.empty(); }
  /// What moves `wandering_slots` in that time, eq. (3.4).
  [[nodiscard]] Propagation<Eigen::VectorXd, Eigen::Dynamic> wander(const GaussianBelief& belief,
                                                                    double seconds) const;
  [[nodiscard]] const std::vector<Slot>& wandering_slots() const { return offsets_; }

  /// Whether the offset of headings is a state once there is one.
  [[nodiscard]] bool learns_heading() const { return heading_sigma_ > 0.0; }
  [[nodiscard]] bool has_heading(const GaussianBelief& belief) const {
    return belief.dimension() > static_cast<int>(slots_.size()) + 2;
  }
  void add_heading_to(GaussianBelief& belief) const;
  /// The variance that the offset of headings gets per second [rad^2/s].
  [[nodiscard]] double heading_wander() const { return heading_wander_; }
  /// The body and the offset of headings, once that is in the belief.
  [[nodiscard]] const std::vector<Slot>& heading_slots() const { return heading_slots_; }

  /// The body and the states that a range to this anchor depends on; null if it depends on none.
  [[nodiscard]] const std::vector<Slot>* slots_of(Id anchor) const {
    const AnchorStates* states = ranges_.empty() ? nullptr : find(anchor);
    return states != nullptr ? &states->slots : nullptr;
  }

  /// What a range says of those, eq. (3.3). Empty as of the model.
  [[nodiscard]] std::optional<Linearization<1, Eigen::Dynamic>> linearize(
      const GaussianBelief& belief, const RangeModel& model, const Range& z,
      const Pose2& rate) const;

  /// What a sighting says of body and states, eq. (3.2). Empty as of the model.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, Eigen::Dynamic>> linearize(
      const GaussianBelief& belief, const RangeBearingModel& model, const Vector<2>& landmark,
      const RangeBearing& z, const Pose2& rate) const;

 private:
  static constexpr int kCount = OdometryErrors::kCount + LandmarkErrors::kCount;
  static constexpr int kNone = -1;

  struct State {
    std::string name;
    int error;  // index among all; of ranges: kCount and their RangeErrors'
    double sigma;
    std::optional<Id> anchor = {};
  };
  struct AnchorStates {
    Id anchor;
    std::vector<Slot> slots;
    std::array<int, RangeErrors::kCount> columns{kNone, kNone, kNone};  // of slots
  };
  void add(State state);
  void add_ranges(const Config& config, const AnchorMap& anchors);
  void prepare_heading(const Config& config);
  [[nodiscard]] const AnchorStates* find(Id anchor) const;
  /// All errors of odometry and the sensor of landmarks, 0 where they are no states.
  [[nodiscard]] std::array<double, kCount> values(const GaussianBelief& belief) const;

  std::vector<State> states_;
  std::vector<Slot> slots_;
  std::vector<Slot> motion_slots_;
  std::vector<AnchorStates> ranges_;  // in order of anchor; none if ranges are right
  std::vector<Slot> offsets_;         // of anchors
  double offset_variance_ = 0.0;
  double correlation_s_ = 0.0;
  std::vector<Slot> heading_slots_;
  double heading_sigma_ = 0.0;
  double heading_wander_ = 0.0;
  double wander_;  // variance of the bias per second
  bool consider_;
};

}  // namespace locfuse
