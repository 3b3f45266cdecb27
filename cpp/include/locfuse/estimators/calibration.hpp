// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "locfuse/filters/belief.hpp"
#include "locfuse/math/linearization.hpp"
#include "locfuse/models/measurement/range_bearing.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// An error of a robot's sensors, as far as it is known.
struct CalibratedError {
  std::string name;  ///< of the belief's slot
  double value = 0.0;
  double sigma = 0.0;
};

/// Which errors of odometry and of the sensor of landmarks are states of a belief, behind its body:
/// the pose and they are estimated together. Derivation: docs/models/calibration.md.
class Calibration {
 public:
  /// How far off each may be at the start, as a standard deviation. 0: it is right, and no state.
  struct Config {
    double sigma_scale = 0.0;                     ///< of the way that odometry tells
    double sigma_direction_rad = 0.0;             ///< of travel
    double sigma_turn_scale = 0.0;                ///< of the turn that odometry tells
    double sigma_turn_bias_radps = 0.0;           ///< of a gyro
    double sigma_turn_bias_radps_per_sqrt_s = 0;  ///< by which that bias wanders
    double sigma_sensor_m = 0.0;                  ///< of the sensor's place, x and y
    double sigma_sensor_rad = 0.0;                ///< of the sensor's heading in body
    double sigma_range_offset_m = 0.0;            ///< of ranges to landmarks
    double sigma_range_scale = 0.0;               ///< likewise
    double sigma_delay_s = 0.0;                   ///< of sightings behind their stamps
  };

  /// Nothing is a state.
  Calibration() : Calibration(Config{}) {}

  /// Throws std::invalid_argument on a sigma that is negative or not finite, and on a bias that
  /// wanders without being a state.
  explicit Calibration(const Config& config);

  [[nodiscard]] bool is_empty() const { return states_.empty(); }

  /// Puts the states into a belief that holds nothing but its body, each 0.
  void add_to(GaussianBelief& belief) const;
  /// The body and the states, once they are in the belief.
  [[nodiscard]] const std::vector<Slot>& slots() const { return slots_; }
  [[nodiscard]] std::vector<CalibratedError> errors(const GaussianBelief& belief) const;

  /// What moves body and states for a motion that odometry told, eq. (1).
  [[nodiscard]] Propagation<Eigen::VectorXd, Eigen::Dynamic> propagate(const GaussianBelief& belief,
                                                                       const OdometryMotion& model,
                                                                       const Pose2& motion,
                                                                       double seconds) const;

  /// What a sighting says of body and states, eq. (2). Empty as of the model.
  [[nodiscard]] std::optional<Linearization<Eigen::Dynamic, Eigen::Dynamic>> linearize(
      const GaussianBelief& belief, const RangeBearingModel& model, const Vector<2>& landmark,
      const RangeBearing& z, const Pose2& rate) const;

 private:
  static constexpr int kCount = OdometryErrors::kCount + SightErrors::kCount;

  struct State {
    int error;  // index among all
    double sigma;
  };
  /// All errors, 0 where they are no states.
  [[nodiscard]] std::array<double, kCount> values(const GaussianBelief& belief) const;

  std::vector<State> states_;
  std::vector<Slot> slots_;
  double wander_;  // variance of the bias per second
};

}  // namespace locfuse
