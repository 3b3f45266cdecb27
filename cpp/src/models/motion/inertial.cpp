// SPDX-License-Identifier: Apache-2.0
#include "locfuse/models/motion/inertial.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "locfuse/geometry/rotation.hpp"

namespace locfuse {
namespace {

/// How long the error of the gyro's scale acts the same way: a turn, and back [s].
constexpr double kTurnLasts = 1.0;

}  // namespace

InertialMotion::InertialMotion(const Config& config)
    : config_(config), mount_(rotation_of(config.mount.x(), config.mount.y(), config.mount.z())) {
  for (const auto& [name, sigma] :
       {std::pair("sigma_turn_per_sqrt_s", config.sigma_turn_per_sqrt_s),
        {"sigma_velocity_per_sqrt_s", config.sigma_velocity_per_sqrt_s},
        {"sigma_bias_radps", config.sigma_bias_radps},
        {"sigma_bias_mps2", config.sigma_bias_mps2},
        {"sigma_bias_radps_per_sqrt_s", config.sigma_bias_radps_per_sqrt_s},
        {"sigma_bias_mps2_per_sqrt_s", config.sigma_bias_mps2_per_sqrt_s},
        {"sigma_scale", config.sigma_scale}}) {
    if (!(sigma > 0.0 && sigma * sigma > 0.0 && std::isfinite(sigma * sigma))) {
      throw std::invalid_argument(std::string("imu.") + name + " is " + std::to_string(sigma) +
                                  ", expected a finite number > 0, its square as well");
    }
  }
  if (!mount_.allFinite()) {
    throw std::invalid_argument("imu.mount is not finite");
  }
}

InertialMotion::Step InertialMotion::propagate(const State& state, const Vector<3>& rate,
                                               const Vector<3>& force, double seconds,
                                               double heading_share) const {
  const double T = seconds;
  const Vector<3> turn = T * (rate - state.rate_bias);
  const Matrix<3, 3> middle = state.attitude * rotation_by(0.5 * turn);
  const Vector<3> pushed = middle * (force - state.force_bias);  // in world, with gravity's support
  const Vector<3> acceleration = pushed - kGravity * Vector<3>::UnitZ();

  Step step{state, Matrix<kVariables, kVariables>::Identity(),
            Matrix<kVariables, kVariables>::Zero()};
  step.moved.position += T * state.velocity + 0.5 * T * T * acceleration;
  step.moved.velocity += T * acceleration;
  step.moved.attitude = orthonormal(state.attitude * rotation_by(turn));

  Matrix<kVariables, kVariables>& F = step.jacobian;
  Matrix<3, 3> by_rotation = -T * cross_matrix(pushed);
  by_rotation.col(2) *= heading_share;
  const Matrix<3, 3> by_bias = -T * middle;
  F(kPosition, kVelocity).diagonal().setConstant(T);
  F(kPosition, kRotation) = 0.5 * T * by_rotation;
  F(kPosition, kForceBias) = 0.5 * T * by_bias;
  F(kPosition, kRateBias) = 0.25 * T * by_rotation * by_bias;
  F(kVelocity, kRotation) = by_rotation;
  F(kVelocity, kRateBias) = 0.5 * by_rotation * by_bias;
  F(kVelocity, kForceBias) = by_bias;
  F(kRotation, kRateBias) = by_bias;

  const double white = config_.sigma_velocity_per_sqrt_s * config_.sigma_velocity_per_sqrt_s;
  const double scale = config_.sigma_scale * config_.sigma_scale;
  const double angular = config_.sigma_turn_per_sqrt_s * config_.sigma_turn_per_sqrt_s;
  Matrix<kVariables, kVariables>& Q = step.noise;
  Q(kPosition, kPosition).diagonal().setConstant(white * T * T * T / 3.0);
  Q(kPosition, kVelocity).diagonal().setConstant(white * T * T / 2.0);
  Q(kVelocity, kPosition).diagonal().setConstant(white * T * T / 2.0);
  Q(kVelocity, kVelocity).diagonal().setConstant(white * T);
  // An error of the gyro's scale turns about the axis of the turn.
  const Vector<3> about = middle * rate;
  Q(kRotation, kRotation) = scale * kTurnLasts * T * about * about.transpose();
  Q(kRotation, kRotation).diagonal().array() += angular * T;
  Q(kRateBias, kRateBias)
      .diagonal()
      .setConstant(config_.sigma_bias_radps_per_sqrt_s * config_.sigma_bias_radps_per_sqrt_s * T);
  Q(kForceBias, kForceBias)
      .diagonal()
      .setConstant(config_.sigma_bias_mps2_per_sqrt_s * config_.sigma_bias_mps2_per_sqrt_s * T);
  return step;
}

}  // namespace locfuse
