// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "locfuse/math/types.hpp"
#include "locfuse/messages/messages.hpp"
#include "locfuse/models/motion/odometry.hpp"

namespace locfuse {

/// Odometry whose turn is measured by wheels and a gyro together; docs/models/motion.md.
///
/// The gyro's bias and the scale of the wheels' turn are learnt from their differences, at rest
/// above all. Where the two contradict each other wheels slip: then the turn is the gyro's, and the
/// way counts as uncertain. With an accelerometer the turn is that about the vertical, however the
/// sensor is mounted; without one the sensor's z axis must point upwards.
///
/// Feed messages in order of arrival. A value: copying it is a snapshot.
class GyroOdometry {
 public:
  /// How the turn is made of both.
  enum class Turn : std::uint8_t {
    kWeighted,  ///< by their variances, eq. (2.6)
    kAverage,   ///< the mean of both: zhang eq. (5)
  };
  struct Config {
    Turn turn = Turn::kWeighted;
    /// White noise of the gyro: heading error after a second [rad / sqrt(s)].
    double sigma_turn_per_sqrt_s = 0.002;
    double sigma_bias_radps = 0.02;             ///< of the gyro's bias at the start [rad/s]
    double sigma_bias_radps_per_sqrt_s = 1e-4;  ///< random walk of the bias [rad/s / sqrt(s)]
    double sigma_scale = 0.01;                  ///< of the gyro's scale
    double sigma_turn_scale = 0.05;             ///< of the scale of the wheels' turn
    OdometryMotion::Config odometry;            ///< noise of the wheels
  };

  /// What became of a motion.
  enum class Verdict : std::uint8_t {
    kTurned,   ///< the turn is of wheels and gyro
    kSlipped,  ///< they contradict each other: the turn is the gyro's
    kNoGyro,   ///< no sample of the gyro near: the motion of the wheels as it came
  };
  struct Motion {
    Verdict verdict = Verdict::kNoGyro;
    Increment increment;  ///< with its variance, unless kNoGyro
  };

  /// Throws std::invalid_argument unless every sigma is finite, > 0 for the gyro and >= 0 for
  /// wheels.
  explicit GyroOdometry(const Config& config);

  /// Takes a sample; one that is not newer than the last is dropped. Throws std::invalid_argument
  /// if it is not valid.
  void on(const Imu& z);
  /// Returns the motion since the velocity before, which held until now; empty for the first one,
  /// and after a pause of more than a second. Throws as `on(Imu)`.
  std::optional<Motion> on(const Velocity& u);
  /// Returns the motion with its turn by both. Throws as `on(Imu)`.
  std::optional<Motion> on(const Increment& u);

  /// Bias of the gyro about the vertical, as known now [rad/s], and its sigma.
  [[nodiscard]] double bias() const { return x_(0); }
  [[nodiscard]] double sigma_bias() const;

 private:
  struct Sample {
    Stamp stamp;
    double rate;  // about the vertical [rad/s]
  };

  [[nodiscard]] Motion turned(Stamp begin, Stamp stamp, const Pose2& motion);
  [[nodiscard]] Motion combined(const Increment& wheels, double measured);
  [[nodiscard]] std::optional<double> turn_between(Stamp begin, Stamp end) const;
  [[nodiscard]] bool is_frozen() const;
  [[nodiscard]] double lasting_bias(double seconds) const;
  [[nodiscard]] bool contradicts(double difference, const Vector<2>& H, double variance,
                                 double seconds);
  void learn(double difference, const Vector<2>& H, double variance);
  void start_learning(double sigma_bias);

  Config config_;
  OdometryMotion wheels_;
  std::vector<Sample> samples_;        // since the last motion, and the one before them
  Vector<3> up_ = Vector<3>::UnitZ();  // in the axes of the sensor
  bool has_up_ = false;
  std::optional<Velocity> held_;
  Vector<2> x_ = Vector<2>::Zero();  // bias [rad/s], scale error of the wheels' turn
  Matrix<2, 2> P_;
  double age_s_ = 0.0;  // of what is known of the bias
  // Over the last half second:
  double rate_ = 0.0;                // of the turn [rad/s]
  double difference_ = 0.0;          // of the turns
  double variance_ = 0.0;            // white part of it
  Vector<2> H_ = Vector<2>::Zero();  // its derivative with respect to x
  double agreed_s_ = 0.0;            // how long they have agreed since learning began
  double contradicted_s_ = 0.0;      // how long they have contradicted each other
  double calm_s_ = 0.0;              // how long they have agreed since
};

}  // namespace locfuse
